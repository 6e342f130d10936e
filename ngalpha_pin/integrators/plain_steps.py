"""Steps in which nothing happens, taken by the compiled engine without Python in between.

A step is plain where Newton's method converges from the accelerations and forces of its start and no other contact
closes. The engine does the same arithmetic as `attempt`, so that it does not matter to a run which of the two made a
step, but for the rounding of springs and wrenches; whatever is not plain, it leaves alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ngalpha_pin.collision.manifold import TOUCH_STEPS
from ngalpha_pin.constraints.constraint_set import Constraints
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.engine import Beams, GapMotion, PlainSteps, Ties
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.integrators.native_forces import NativeForces
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.step.cascade import PATIENCE
from ngalpha_pin.step.compiled import CONSTANTS
from ngalpha_pin.step.contact_history import keep_contacts
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.contact_search import RELAXED
from ngalpha_pin.system.fly_past import may_fly_past
from ngalpha_pin.system.regime import BANDED, COMPILED, LOOKED_AGAIN, Regime
from ngalpha_pin.system.state import State, StepResult
from ngalpha_pin.system.stretch import Stretch
from ngalpha_pin.system.system import System

# sets of contacts that the engine keeps: in a long run with many corners their number has no bound
MOST_SUBSETS = 1024
# corrections after which a step is left to the cascade, which begins anew: most take less, and the others more
SOON = 8


@dataclass
class Plain:
    """A scene as the engine knows it.

    Attributes:
        engine: makes the steps.
        forces: of the scene.
        numbers: of the subsets that it has been given.
        refused: the last state from which it could not go on.
    """

    engine: Any
    forces: NativeForces
    numbers: dict[Subset, int] = field(default_factory=dict)
    refused: State | None = None

    def number(self, system: System, sub: Subset) -> int:
        """The number of a subset, which the engine is given at the first request."""
        found = self.numbers.get(sub)
        if found is None:
            bodies = [int(body) for body in sub.points.bodies]
            found = self.numbers[sub] = self.engine.add(kernel.plan_of(system, sub).address, bodies)
        return found

    def follows(self, system: System) -> Callable[[float], np.ndarray] | None:
        """What constraints follow over time, or None where they do not."""
        return system.constraints.wanted if system.constraints.over_time else None


def plain_steps(first: Piece, n: int) -> Stretch | None:
    """Up to n steps of one length, as far as they are plain: None where the first of them is not."""
    parameters, system, state, dt = first
    plain = plain_of(system)
    if plain is None or system.contacts.adheres or state is plain.refused or parameters.solver == "fixed_point":
        return None
    memory, table = state.memory, system.contacts
    if memory is None or state.dt != dt or len(state.contacts) > COMPILED or len(state.slots):
        return None
    sub, near = table.subset(state.contacts), table.subset(state.near)
    if len(near.own) or not sub.plain:
        return None
    pairs = system.slots.proximity.native if system.slots.n else None
    if pairs is not None and not pairs.seen:
        return None
    if len(plain.numbers) > MOST_SUBSETS:
        plain = system.plain = _made(system)
    regime = Regime(sub.k, joints=system.joint_friction.f)
    apart = not np.array_equal(state.near, state.contacts)
    is_open = ~np.isin(state.near, state.contacts) if apart else np.zeros(0, dtype=bool)
    others = state.near[is_open] if apart else state.near[:0]
    if apart and may_fly_past(system, state.q, state.v, others, dt) is not None:
        return None
    rows = plain.engine.run(
        plain.number(system, sub),
        plain.number(system, near) if apart else -1,
        is_open.tolist(),
        numbers_of(first),
        patience(parameters, regime),
        sub.bounces,
        LOOKED_AGAIN,
        RELAXED,
        not parameters.paper and first.divides,
        TOUCH_STEPS * dt,
        pairs,
        plain.forces.loads(system, state.actuation),
        plain.follows(system),
        state.t,
        state.clearance,
        *(state.q, state.v, state.a, memory.a_bar),
        np.concatenate((state.la_N, state.la_F)),
        np.concatenate((memory.la_N_bar, memory.la_F_bar)),
        *(state.tau_f, memory.tau_f_bar, state.la_b),
        n,
    )
    if len(rows) == 0:
        plain.refused = state
        return None
    steps = results(system, sub, state, dt, rows)
    return _slow(system, others, dt, steps) if apart else steps


def _slow(system: System, near: np.ndarray, dt: float, steps: Stretch) -> Stretch:
    """The steps up to the first that ends so fast that points may fly past round surfaces in the next one."""

    def fast(step: StepResult) -> bool:
        return may_fly_past(system, step.state.q, step.state.v, near, dt) is not None

    if not fast(steps[-1]):
        return steps
    first = next(i for i, step in enumerate(steps) if fast(step))
    return steps if first == len(steps) - 1 else steps.head(first + 1)


def patience(parameters: Parameters, regime: Regime) -> int:
    """Newton corrections of a step in the engine."""
    return min(parameters.max_iter, PATIENCE if parameters.auto and regime.crowded else SOON)


def numbers_of(piece: Piece) -> list[float]:
    """The first entries of the block of a step, see kernel.h."""
    parameters, system, state, dt = piece
    laws, loaded = parameters.laws, system.loaded(state.actuation)
    flags = (laws.paper, laws.displaces, laws.accelerates, loaded, system.flat, laws.monotone)
    numbers = (dt, *parameters.coefficients, parameters.tol, system.weight, *CONSTANTS, *flags)
    return [float(number) for number in numbers]


def plain_of(system: System) -> Plain | None:
    """The scene as the engine knows it, made at the first request; None where it has more than the kernel knows."""
    if kernel.library is None:
        return None
    if system.plain is None:
        simple = (
            (system.beams is None or (system.slots.n == 0 and system.beams.n <= BANDED))
            and not system.many_trees
            and (system.constraints.compiled or not system.constraints.names)
        )
        system.plain = _made(system) if simple else False
    return system.plain or None


def _made(system: System) -> Plain:
    engine = _engine(system)
    return Plain(engine, NativeForces(system, engine, _places(system)))


def _engine(system: System) -> PlainSteps:
    slides, lengths, angles = system.kinds_of_coordinates
    table = system.contacts
    return PlainSteps(
        system.model.saveToString(), table.reach.tolist(), float(table.length), lengths.tolist(),
        angles.tolist(), slides.tolist(), table.n > 0, bool(system.flat), _ties(system.constraints),
        _motion(system), Beams() if system.beams is None else system.beams.native(),
    )  # fmt: skip


def _motion(system: System) -> Any:
    """What bounds the change of gaps where there are pairs of solids."""
    if system.slots.n == 0:
        return GapMotion()
    table = system.contacts
    measure = table.measure[table.n_points : table.n_shapes].tolist()
    of_points = [x.tolist() for x in (table.pairs_a, table.pairs_b, table.limit_dof)]
    return GapMotion(np.ravel(table.support).tolist(), of_points, measure, system.nv)


def _ties(constraints: Constraints) -> Any:
    """The constraints as the engine takes them."""
    if not constraints.compiled:
        return Ties()
    (_, joints, unit), *of_frames = kernel.frames_of(constraints)
    _, *of_couplings = kernel.couplings_of(constraints)
    numbers, arrays, more_numbers, more_arrays = ([x.tolist() for x in part] for part in (*of_frames, *of_couplings))
    rest = unit, constraints.vanishes, more_numbers, more_arrays
    return Ties(constraints.kb, numbers, arrays, joints.tolist(), *rest, constraints.follows.tolist())


def _places(system: System) -> np.ndarray:
    model = system.model if system.beams is None else system.tree
    place = np.full(model.nv, -1)
    for q, v, nq, nv in zip(model.idx_qs, model.idx_vs, model.nqs, model.nvs, strict=True):
        if nq == nv:
            place[v : v + nv] = np.arange(q, q + nv)
    return place


# what `PlainSteps` records of a step, behind four numbers: fields of a state, and what the method remembers
FIELDS = (
    "q", "v", "a", "a_bar", "la_N", "la_F", "La_N", "La_F", "P_N", "P_F", "la_N_bar", "la_F_bar", "tau_f", "P_f",
    "tau_f_bar", "La_b", "la_b",
)  # fmt: skip


def results(system: System, sub: Subset, before: State, dt: float, rows: np.ndarray) -> Stretch:
    """The steps from their numbers."""
    nq, nv, k, m, f, b = system.nq, system.nv, sub.k, sub.m, len(before.tau_f), len(before.la_b)
    ends = np.cumsum([4, nq, nv, nv, nv, k, m, k, m, k, m, k, m, f, f, f, b, b]).tolist()
    arrays = {name: rows[:, start:end] for name, start, end in zip(FIELDS, ends, ends[1:], strict=False)}
    t, clearance, n_iter, residual = rows[:, :4].T
    arrays |= {"t": t, "clearance": clearance}
    found = Stretch(before, dt, sub.index, arrays, n_iter.astype(int), residual)
    kept = rows[-1, -k:] if k else np.zeros(0)
    if kept.all():
        return found
    # in the last of them alone: contacts that have let go of all force are forgotten
    return replace(found, last=keep_contacts(system, found[-1].state, kept != 0.0))
