"""Steps in which nothing happens, taken by the compiled engine without Python in between.

A step is plain where Newton's method converges from the accelerations and forces of its start and no other contact
closes. The engine does the same arithmetic as `attempt`, so that it does not matter to a run which of the two made a
step; whatever is not plain, it leaves alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ngalpha_pin.contact.table import Subset
from ngalpha_pin.engine import PlainSteps
from ngalpha_pin.kernel import binding as kernel
from ngalpha_pin.step_equations.compiled import CONSTANTS
from ngalpha_pin.step_equations.parameters import Parameters
from ngalpha_pin.system.actuation import Actuation
from ngalpha_pin.system.contact_search import RELAXED
from ngalpha_pin.system.regime import COMPILED, LOOKED_AGAIN
from ngalpha_pin.system.state import Auxiliary, SolvedBy, State, StepResult
from ngalpha_pin.system.system import System


@dataclass
class Plain:
    """A scene as the engine knows it.

    Attributes:
        engine: makes the steps.
        numbers: of the subsets that it has been given.
        refused: the last state from which it could not go on.
    """

    engine: Any
    numbers: dict[Subset, int] = field(default_factory=dict)
    refused: State | None = None

    def number(self, system: System, sub: Subset) -> int:
        """The number of a subset, which the engine is given at the first request."""
        found = self.numbers.get(sub)
        if found is None:
            bodies = [int(body) for body in sub.bodies]
            found = self.numbers[sub] = self.engine.add(kernel.plan_of(system, sub).address, bodies)
        return found


def plain_steps(parameters: Parameters, system: System, state: State, dt: float, n: int) -> list[StepResult]:
    """Up to n steps, as far as they are plain; none is an empty list."""
    plain = _plain(system)
    if plain is None or state is plain.refused or parameters.solver == "fixed_point":
        return []
    memory, table = state.memory, system.contacts
    if memory is None or state.dt != dt or len(state.contacts) > COMPILED:
        return []
    sub, near = table.subset(state.contacts), table.subset(state.near)
    if sub.points is not sub or near.points is not near:  # limits of joints
        return []
    apart = not np.array_equal(state.near, state.contacts)
    is_open = ~np.isin(state.near, state.contacts) if apart else np.zeros(0, dtype=bool)
    loaded = system.loaded(state.actuation)
    laws = parameters.laws
    flags = (laws.paper, laws.displaces, laws.accelerates, loaded, system.flat)
    numbers = (dt, *parameters.coefficients, parameters.tol, system.weight, *CONSTANTS, *flags)
    rows = plain.engine.run(
        plain.number(system, sub), plain.number(system, near) if apart else -1, is_open.tolist(),
        [float(number) for number in numbers], parameters.max_iter, sub.bounces, LOOKED_AGAIN, RELAXED,
        _Loads(system, state.actuation) if loaded else None, state.t, state.clearance, state.q, state.v, state.a,
        memory.a_bar, np.concatenate((state.la_N, state.la_F)), np.concatenate((memory.la_N_bar, memory.la_F_bar)), n,
    )  # fmt: skip
    if len(rows) == 0:
        plain.refused = state
        return []
    return [_result(system, sub, state, row) for row in rows]


class _Loads:
    """What `System.loads` gives, for the engine."""

    def __init__(self, system: System, actuation: Actuation):
        self._system, self._actuation = system, actuation

    def __call__(self, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Force and derivatives at (t, q, v)."""
        return self._system.loads(t, q, v, self._actuation)


def _plain(system: System) -> Plain | None:
    """The scene as the engine knows it, made at the first request; None where it has more than contact points."""
    if system.plain is None:
        simple = (
            kernel.library is not None
            and system.beams is None
            and system.trees is None
            and system.slots.n == 0
            and system.joint_friction.f == 0
            and not system.constraints.names
        )
        system.plain = Plain(_engine(system)) if simple else False
    return system.plain or None


def _engine(system: System) -> PlainSteps:
    slides, lengths, angles = system.kinds_of_coordinates
    table = system.contacts
    return PlainSteps(
        system.model.saveToString(), table.reach.tolist(), float(table.length), lengths.tolist(),
        angles.tolist(), slides.tolist(), table.n > 0, bool(system.flat),
    )  # fmt: skip


def _result(system: System, sub: Subset, before: State, row: np.ndarray) -> StepResult:
    """One of the steps, from its numbers."""
    nq, nv, k, m = system.nq, system.nv, sub.k, sub.m
    ends = np.cumsum([4, nq, nv, nv, nv, k, m, k, m, k, m, k, m, k]).tolist()
    head, q, v, a, a_bar, la_N, la_F, La_N, La_F, P_N, P_F, N_bar, F_bar, kept = (
        row[start:end] for start, end in zip([0, *ends], ends, strict=False)
    )
    t, clearance, n_iter, error = head.tolist()
    keep = kept != 0.0
    contacts = sub.index
    if not keep.all():
        of_F = keep[sub.of_F]
        contacts, la_N, La_N, P_N, N_bar = contacts[keep], la_N[keep], La_N[keep], P_N[keep], N_bar[keep]
        la_F, La_F, P_F, F_bar = la_F[of_F], La_F[of_F], P_F[of_F], F_bar[of_F]
    memory = Auxiliary(a_bar, N_bar, F_bar, before.tau_f)
    end = State(
        t, q, v, a, contacts, la_N, la_F, P_N, P_F, La_N, La_F, memory=memory, near=before.near, clearance=clearance,
        slots=before.slots, tau=before.tau, dt=before.dt,
    )  # fmt: skip
    return StepResult(end, True, int(n_iter), SolvedBy.NEWTON, error)
