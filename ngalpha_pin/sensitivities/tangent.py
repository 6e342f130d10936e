"""The derivative of a state by some parameters: what the method remembers, column by column."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ngalpha_pin.system.system import System


@dataclass(frozen=True, eq=False)
class Tangent:
    """Derivative of a `State` by p parameters.

    Attributes:
        contacts: numbers of the contacts in `la` and `la_bar`, shape (k,).
        q: in the tangent space at q, shape (nv, p).
        v, a, a_bar: shape (nv, p).
        la, la_bar: of the contacts, normal entries first, shape (k + m, p).
        tau_f, tau_f_bar: of dry friction in joints, shape (f, p).
        dt: of the length of the last part, shape (p,).
        t: of the time, zero but within a step, shape (p,).
    """

    contacts: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    a_bar: np.ndarray
    la: np.ndarray
    la_bar: np.ndarray
    tau_f: np.ndarray
    tau_f_bar: np.ndarray
    dt: np.ndarray
    t: np.ndarray

    @property
    def p(self) -> int:
        """Number of columns."""
        return self.q.shape[1]

    def widened(self) -> Tangent:
        """One more column, of zeros."""
        return self._with({name: np.concatenate((x, np.zeros((*x.shape[:-1], 1))), axis=-1) for name, x in self._all()})

    def folded(self, d: np.ndarray) -> Tangent:
        """The last column times d, shape (p,), added to the others."""
        return self._with({name: x[..., :-1] + x[..., -1:] * d for name, x in self._all()})

    def of(self, system: System, contacts: np.ndarray) -> Tangent:
        """The same for other contacts: those that are not known have no derivative yet."""
        if np.array_equal(contacts, self.contacts):
            return self
        old, new = places(system, self.contacts), places(system, contacts)
        known = np.isin(new, old)
        at = np.searchsorted(old, new[known])
        found = {}
        for name in ("la", "la_bar"):
            array = np.zeros((len(new), self.p))
            array[known] = getattr(self, name)[at]
            found[name] = array
        return replace(self, contacts=contacts, **found)

    def _all(self) -> list[tuple[str, np.ndarray]]:
        return [(f.name, getattr(self, f.name)) for f in fields(self) if f.name != "contacts"]

    def _with(self, arrays: dict[str, Any]) -> Tangent:
        return replace(self, **arrays)

    def as_vector(self) -> np.ndarray:
        """All that the method remembers between steps, one below the other: shape (s, p)."""
        parts = (self.q, self.v, self.a, self.a_bar, self.la, self.la_bar, self.tau_f, self.tau_f_bar, self.dt[None])
        return np.concatenate(parts)


def from_vector(system: System, contacts: np.ndarray, x: np.ndarray) -> Tangent:
    """The inverse of `Tangent.as_vector`, between steps."""
    nv, f, sub = system.nv, system.joint_friction.f, system.contacts.subset(contacts)
    j = sub.k + sub.m
    ends = np.cumsum([nv, nv, nv, nv, j, j, f, f]).tolist()
    q, v, a, a_bar, la, la_bar, tau_f, tau_f_bar, dt = np.split(x, ends)
    return Tangent(contacts, q, v, a, a_bar, la, la_bar, tau_f, tau_f_bar, dt[0], np.zeros(x.shape[1]))


def places(system: System, contacts: np.ndarray) -> np.ndarray:
    """Increasing numbers that tell the rows of any contacts apart, shape (k + m,)."""
    sub = system.contacts.subset(contacts)
    return np.concatenate((sub.index, system.contacts.n + sub.rows_F)).astype(int)


def still(system: System, q: np.ndarray, v: np.ndarray, t: np.ndarray | None = None) -> Tangent:
    """A tangent of a motion alone, without forces and accelerations."""
    p, f, zero = q.shape[1], system.joint_friction.f, np.zeros_like(v)
    nothing, torques = np.zeros((0, p)), np.zeros((f, p))
    no_time = np.zeros(p)
    contacts = np.zeros(0, dtype=int)
    time = no_time if t is None else t
    return Tangent(contacts, q, v, zero, zero, nothing, nothing, torques, torques, no_time, time)
