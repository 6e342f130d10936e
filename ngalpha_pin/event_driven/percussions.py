"""Percussions between two recorded times of a run whose steps are not those of the method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.contact.table import Subset
from ngalpha_pin.system.state import Impact, State
from ngalpha_pin.system.system import System


class Percussions:
    """Sums of percussions over all contacts since the last recorded time.

    Args:
        system: compiled scene.
    """

    def __init__(self, system: System):
        self._system = system
        self._every = system.contacts.subset(np.arange(system.contacts.n))
        self._clear()

    def _clear(self) -> None:
        k, m, constraints = self._every.k, self._every.m, self._system.constraints
        self._P_N, self._La_N, self._P_F, self._La_F = np.zeros(k), np.zeros(k), np.zeros(m), np.zeros(m)
        self._P_f, self._La_b = np.zeros(self._system.joint_friction.f), np.zeros(constraints.kb + constraints.mb)

    def add_forces(self, sub: Subset, P: np.ndarray, P_f: np.ndarray) -> None:
        """Integrals of the contact forces (k + m,) and of the torques of joint friction (f,).

        Forces that run away at the end of a phase leave an error in them, which must not pull or leave the cone.
        """
        P_N = np.maximum(P[: sub.k], 0.0)
        self._P_N[sub.index] += P_N
        self._P_F[sub.rows_F] += in_cones(sub, P_N, P[sub.k :])
        self._P_f += P_f

    def add_impact(self, hit: Impact) -> None:
        """The percussions of an impact."""
        sub = self._system.contacts.subset(hit.contacts)
        self._add(sub, hit.P_N, hit.P_F, hit.P_N, hit.P_F)
        self._La_b += hit.P_b

    def add_step(self, state: State) -> None:
        """The percussions of a step of the method."""
        sub = self._system.contacts.subset(state.contacts)
        self._add(sub, state.P_N, state.P_F, state.La_N, state.La_F)
        self._P_f += state.P_f if len(state.P_f) else 0.0
        self._La_b += state.La_b if len(state.La_b) else 0.0

    def _add(self, sub: Subset, P_N: np.ndarray, P_F: np.ndarray, La_N: np.ndarray, La_F: np.ndarray) -> None:
        self._P_N[sub.index] += P_N
        self._La_N[sub.index] += La_N
        self._P_F[sub.rows_F] += P_F
        self._La_F[sub.rows_F] += La_F

    def take(self, state: State) -> State:
        """The state with all percussions since the last time, which begin anew."""
        table = self._system.contacts
        contacts = np.union1d(state.contacts, np.flatnonzero((self._P_N != 0.0) | (self._La_N != 0.0)))
        sub, own = table.subset(contacts), table.subset(state.contacts)
        N, F = np.searchsorted(sub.index, own.index), np.searchsorted(sub.rows_F, own.rows_F)

        def spread(values: np.ndarray, places: np.ndarray, size: int) -> np.ndarray:
            full = np.zeros(size)
            full[places] = values
            return full

        la_N, la_F = spread(state.la_N, N, sub.k), spread(state.la_F, F, sub.m)
        memory = None if state.memory is None else replace(state.memory, la_N_bar=la_N, la_F_bar=la_F)
        taken = replace(
            state, contacts=contacts, memory=memory, la_N=la_N, la_F=la_F,
            P_N=self._P_N[sub.index], La_N=self._La_N[sub.index], P_F=self._P_F[sub.rows_F],
            La_F=self._La_F[sub.rows_F], P_f=self._P_f, La_b=self._La_b,
        )  # fmt: skip
        self._clear()
        return taken


def in_cones(sub: Subset, P_N: np.ndarray, P_F: np.ndarray) -> np.ndarray:
    """Friction percussions shortened to what the normal ones allow, shape (m,) [N s]."""
    unit, size = sub.cones.unit(P_F)
    return unit * np.minimum(size, sub.cones.mu_F * P_N[sub.of_F])
