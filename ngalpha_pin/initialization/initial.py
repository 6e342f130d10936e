"""The start of a run: initial values checked, and accelerations and contact forces that agree with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.common.tolerances import CLOSED, GRAVITY, PENETRATION
from ngalpha_pin.constraints.frame_forces import BoundSpring
from ngalpha_pin.contact.compliant import elastic_forces
from ngalpha_pin.contact.kernel_rows import rows_at
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.errors import Penetration, SceneError
from ngalpha_pin.numerics.block_matrix import BlockMatrix, solve_positive
from ngalpha_pin.numerics.even_forces import AGREE, even_forces
from ngalpha_pin.numerics.gauss_seidel import FreeProblem, forces_of_closed_contacts
from ngalpha_pin.numerics.proximal_newton import Rows
from ngalpha_pin.scene.model_checks import body_of
from ngalpha_pin.system.actuation import NO_ACTUATION, Actuation
from ngalpha_pin.system.adhesion import NONE, holds, lets_go, sticky
from ngalpha_pin.system.contact_search import contact_speed, load_slots, not_solid, only_hulls
from ngalpha_pin.system.extra_states import starting
from ngalpha_pin.system.sampling import begun, with_samples
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import ContactRows, System

if TYPE_CHECKING:
    from ngalpha_pin.contact.point_rows import KinematicRows

# pairs of solids that are this near at the start get their features
NEAR = 1e-3
# violation of constraints at the start, in parts of speeds of the scene, which assembly leaves far below; and rows of
# a constraint that no motion changes
CONSISTENT, INERT = 1e-8, 1e-13
ILL = 1e15  # condition of a mass matrix from which no digit of an acceleration is left
UNIT = 1e-9  # what the length of a quaternion may differ from one: as numbers of nine digits in a file do


def initial_state(system: System, q0: np.ndarray, v0: np.ndarray | None = None, t0: float = 0.0) -> State:
    """The state at t0 with consistent accelerations and forces of contacts, joint friction and constraints.

    Sampled controls take their first sample, at the contact forces without what they hold.

    Contacts that are closed and do not open get la_N and la_F from Signorini's law on acceleration level (60) and from
    Coulomb's law: sticking on acceleration level, or slipping along the slip velocity (120).

    Args:
        system: compiled scene.
        q0: configuration, shape (nq,).
        v0: velocity, shape (nv,); None is rest.
        t0: time [s].

    Raises:
        SceneError: nothing moves, wrong shape, not finite, a quaternion that is not a unit one, or a constraint that is
            not fulfilled.
        Penetration: a contact has a negative gap at q0.
    """
    if system.nv == 0:
        raise SceneError(f"nothing in {system.tree.name or 'the scene'} moves: it has no degree of freedom")
    q, v = checked_values(system, q0, v0)
    check_start(system, t0, q, v)
    state = held_state(system, t0, q, v)
    if system.samplers:
        sampled = with_samples(system, begun(system, state), t0)
        state = replace(held_state(system, t0, q, v, sampled.actuation), sampled=sampled.sampled)
    return _frozen(state)


def check_start(system: System, t0: float, q: np.ndarray, v: np.ndarray) -> None:
    """A run can start at a motion: bodies resist, constraints hold, nothing penetrates; slots have their features.

    Raises:
        SceneError: it cannot. Penetration: a contact has a negative gap.
    """
    table = system.contacts
    dynamics = system.dynamics(t0, q, v, np.zeros(system.nv))
    M = dynamics.M.tree if isinstance(dynamics.M, BlockMatrix) else dynamics.M
    if len(M) and not np.linalg.cond(M) < ILL:
        raise SceneError(
            f"the mass matrix at q0 is singular: a moving body needs mass and inertia (or armature), look at "
            f"{_lightest(system, M)}"
        )
    if system.constraints.names:
        _check_constraints(system, t0, q, v)
    for force in system.forces:
        if isinstance(force, BoundSpring):
            force.check_start(q)
    if table.n:
        system.place(q)
        near = np.arange(table.n)
        if system.slots.n:
            loaded = load_slots(system, State(t0, q, v, v), 0.0, NEAR * table.length)
            near = np.union1d(not_solid(system), loaded)
        gaps = system.gaps(table.subset(near), q)
        gaps = np.where(table.soft[near], 0.0, gaps)
        _check_gaps(system, near, gaps)


def consistent_state(
    system: System, t: float, q: np.ndarray, v: np.ndarray, actuation: Actuation = NO_ACTUATION
) -> State:
    """Accelerations and forces just after t, of the contacts that rest at (q, v) and of what else acts."""
    state = free_state(system, t, q, v, system.slots.contents(), actuation)
    sub, speed = resting_contacts(system, q, v)
    return state if system.layout(sub).n == 0 else with_forces(system, sub, state, speed)


def held_state(system: System, t: float, q: np.ndarray, v: np.ndarray, actuation: Actuation = NO_ACTUATION) -> State:
    """As `consistent_state`, where every contact with adhesion that rests begins to hold, as far as its force goes."""
    if not system.contacts.adheres:
        return consistent_state(system, t, q, v, actuation)
    system.place(q)
    holding = sticky(system, resting_contacts(system, q, v)[0].index)
    return without_lost(system, consistent_state(system, t, q, v, holds(actuation, holding)))


def without_lost(system: System, state: State) -> State:
    """A consistent state without the contacts that let go in it; others that lose their hold by that go with them."""
    while len(lost := lets_go(system, state)):
        actuation = holds(state.actuation, np.setdiff1d(state.holding, lost))
        state = consistent_state(system, state.t, state.q, state.v, actuation)
    return state


def free_state(
    system: System, t: float, q: np.ndarray, v: np.ndarray, slots: np.ndarray, actuation: Actuation = NO_ACTUATION
) -> State:
    """The motion with the accelerations that it has without contacts, constraints and joint friction, and no forces."""
    dynamics = system.dynamics(t, q, v, np.zeros(system.nv), actuation)
    a = solve_positive(dynamics.M, -dynamics.residual)
    zero_f, zero_b = np.zeros(system.joint_friction.f), np.zeros(system.constraints.kb + system.constraints.mb)
    return State(
        t, q, v, a, tau_f=zero_f, P_f=zero_f, la_b=zero_b, La_b=zero_b, slots=slots,
        tau=np.zeros(0) if actuation.tau is None else actuation.tau,
        holding=NONE if actuation.holding is None else actuation.holding,
    )  # fmt: skip


def closed_contacts(system: System, q: np.ndarray, near: np.ndarray | None = None) -> Subset:
    """The rigid contacts that touch at q, after `dynamics` or `place` there; of these alone, or of all."""
    table = system.contacts
    there = np.arange(table.n) if near is None else near
    if system.slots.n:
        empty = table.n_fixed + np.flatnonzero(~system.slots.loaded)
        there = np.delete(there, empty)
    if len(there) == 0:
        return table.subset(there)
    touches = system.gaps(table.subset(there), q) <= CLOSED * table.yardstick[there]
    return table.subset(there[touches & ~table.soft[there]])


def soft_contacts(system: System, q: np.ndarray) -> np.ndarray:
    """Numbers of the compliant contacts that touch at q, after `dynamics` or `place` there."""
    table = system.contacts
    there = np.flatnonzero(table.soft)
    if len(there) == 0:
        return there
    return there[system.gaps(table.subset(there), q) <= CLOSED * table.yardstick[there]]


def resting_contacts(
    system: System, q: np.ndarray, v: np.ndarray, near: np.ndarray | None = None
) -> tuple[Subset, float]:
    """The contacts that touch at q and neither open nor meet an impact, and the speed that counts as none [m/s].

    Compliant ones have a force however they move. Of those that are rigid only `near` ones are looked at, or all.
    """
    sub, soft = closed_contacts(system, q, near), soft_contacts(system, q)
    if len(soft):
        sub = system.contacts.subset(np.union1d(sub.index, soft))
    if sub.k == 0:
        return sub, 0.0
    rows = system.contact_rows_at(sub, q, v, 0.0)  # no gap feels how surfaces move along themselves
    speed = contact_speed(system, rows)
    resting = np.abs(rows.rate[: sub.k]) <= speed
    resting[sub.soft] = True
    return (sub if resting.all() else system.contacts.subset(sub.index[resting])), speed


def joint_speed(system: System) -> float:
    """Velocity of a joint with dry friction that counts as none [rad/s or m/s]."""
    return CLOSED * float(np.sqrt(GRAVITY / system.contacts.length))


def with_forces(
    system: System,
    sub: Subset,
    state: State,
    speed: float,
    response: Callable[[np.ndarray], np.ndarray] | None = None,
) -> State:
    """The state with consistent forces of contacts, joint friction and constraints, from the accelerations without.

    Args:
        system: compiled scene.
        sub: contacts that may carry a force.
        state: q, v and the accelerations without such forces.
        speed: slip velocity that counts as none [m/s].
        response: accelerations that forces of shape (nv, r) make; by default those of the mass matrix.
    """
    t, q, v, a = state.t, state.q, state.v, state.a
    layout, friction = system.layout(sub), system.joint_friction
    dynamics = system.dynamics(t, q, v, a)
    M = dynamics.M.copy()
    contacts = rows_at(system, sub, q, v, a, t) if sub.k else None
    parts: list[KinematicRows] = [] if contacts is None else [contacts]
    parts += [friction.rows(v, a)] if layout.f else []
    parts += [system.constraint_rows(t, q, v, a)] if layout.kb + layout.mb else []
    W = system.directions(parts)
    by_M = solve_positive(M, W.T) if response is None else response(W.T)
    problem = FreeProblem(W @ by_M, np.concatenate([part.acceleration for part in parts]), layout.constraints.start)
    k, cones = sub.k, sub.cones
    gamma_F = parts[0].rate[k : k + sub.m] if sub.m else np.zeros(0)
    slip = np.where((cones.sizes(gamma_F) > speed)[cones.of_row], gamma_F, 0.0)
    closed, bounds = np.ones(k, dtype=bool), friction.bounds_at(v, joint_speed(system))
    mu, of, o = cones.coefficients(slip)[0], cones.contact if cones.rolls else None, cones.of_row
    G, b = problem.G, problem.b
    if contacts is not None and len(sub.soft):
        G, b = _with_given(problem, sub, contacts)
    la, converged = forces_of_closed_contacts(
        G, b, mu, o, closed, slip, bounds=bounds, of_cone=of, enough=AGREE, in_engine=True
    )  # forces that are not unique are made even below
    if not converged:  # much friction against this slip has no solution: the forces as if it had just stopped
        la, _ = forces_of_closed_contacts(G, b, cones.mu, o, closed, np.zeros(sub.m), bounds=bounds, of_cone=of)
    if not len(sub.soft):
        la = even_forces(G, b, Rows(cones.mu, o, bounds, of), la, closed, slip)
    la_b = problem.constraint_forces(la)
    a = a + by_M @ np.concatenate((la, la_b))
    la_N, la_F, tau_f = np.split(la, (k, k + sub.m))
    zero_N, zero_F = np.zeros(k), np.zeros(sub.m)
    return State(
        t, q, v, a, sub.index, la_N, la_F, zero_N, zero_F, zero_N, zero_F,
        tau_f, np.zeros(layout.f), la_b, np.zeros(len(la_b)), slots=state.slots, tau=state.tau,
        holding=state.holding,
    )  # fmt: skip


def _with_given(problem: FreeProblem, sub: Subset, rows: ContactRows) -> tuple[np.ndarray, np.ndarray]:
    """G and b of a problem whose normal rows of compliant contacts say what their forces are."""
    G, b, i = problem.G.copy(), problem.b.copy(), sub.soft
    G[i] = 0.0
    G[i, i] = problem.G[i, i]
    b[i] = -problem.G[i, i] * elastic_forces(sub, np.minimum(rows.g_N, 0.0), rows.rate[: sub.k])[0]
    return G, b


def _lightest(system: System, M: np.ndarray) -> str:
    """The body, with its inertia, on the joint that a motion without kinetic energy moves most."""
    direction, tree = np.linalg.eigh(0.5 * (M + M.T))[1][:, 0], system.tree
    joint = int(np.repeat(np.arange(tree.njoints), list(tree.nvs))[np.argmax(np.abs(direction))])
    inertia = tree.inertias[joint]
    moments = np.linalg.eigvalsh(inertia.inertia)
    of = ", ".join(f"{x:.3g}" for x in np.where(np.abs(moments) > INERT * inertia.mass, moments, 0.0))
    return f"{body_of(tree, tree.names[joint])}, of {inertia.mass:.3g} kg and {of} kg m^2"


def _check_constraints(system: System, t: float, q: np.ndarray, v: np.ndarray) -> None:
    """G and its rate vanish at the start, and some motion changes them.

    Raises:
        SceneError: they do not; the message names the constraint that is worst.
    """
    names, motion = system.constraints.names, np.zeros(system.nv)
    system.dynamics(t, q, v, motion)
    rows = system.constraint_rows(t, q, v, motion)
    # what is left of a direction that vanishes is rounding of lengths and of the unit vectors of translations
    inert = np.abs(system.directions([rows])).max(axis=1) <= INERT * min(1.0, system.contacts.length)
    for i in np.flatnonzero(inert):
        if system.constraints.by_group(~inert * 1.0)[i] < 1.0:
            raise SceneError(f"no motion at q0 changes the constraint {names[i]!r}: it cannot be held there")
    speed = max(rows.sizes[1], system.contacts.speed)
    for error, unit, what, remedy in (
        (
            np.abs(rows.whole(system.motion(v, motion))[0]),
            max(rows.sizes[0], system.contacts.length),
            "q0 does not fulfil",
            "q0",
        ),
        (np.abs(rows.rate), speed, "v0 does not fulfil", "v0"),
    ):
        worst = int(np.argmax(error)) if len(error) else 0
        if len(error) and not error[worst] <= CONSISTENT * unit:
            name = (system.constraints.names_of_every_g if remedy == "q0" else names)[worst]
            raise SceneError(
                f"{what} the constraint {name!r}: it is off by {error[worst]:.3g}; "
                "ngalpha_pin.assemble(scene, q0, v0) finds values that do"
            )


def checked_values(system: System, q0: np.ndarray, v0: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Initial values as arrays of their own.

    Raises:
        SceneError: wrong shape, not finite, or a quaternion that is not a unit one.
    """
    model = system.scene.model
    if system.states is not None and np.shape(q0) == (model.nq,):  # states begin where they say
        v = np.zeros(model.nv) if v0 is None else checks.vector("v0", v0, model.nv)
        q0, v0 = starting(system.scene.states, checks.vector("q0", q0, model.nq), v, system.unilaterals is not None)
    q = checks.vector("q0", q0, system.nq)
    v = np.zeros(system.nv) if v0 is None else checks.vector("v0", v0, system.nv)
    for name, i, n in zip(model.names, model.idx_qs, model.nqs, strict=True):
        alone = pin.neutral(model)
        alone[i : i + n] = q[i : i + n]
        if pin.isNormalized(model, alone, UNIT):
            continue
        raise SceneError(
            f"q0: the quaternion (x, y, z, w) or the pair (cos, sin) of joint {name!r} does not have norm 1; "
            "normalise it, e.g. with pin.normalize(model, q)"
        )
    return q, v


def _check_gaps(system: System, contacts: np.ndarray, gaps: np.ndarray) -> None:
    deep = np.flatnonzero(gaps < -PENETRATION * system.contacts.yardstick[contacts])
    if len(deep):
        names = [system.contacts.names[i] for i in contacts]
        worst = deep[np.argsort(gaps[deep])]
        units = ["" if name.endswith(" limit") else " m" for name in names]
        listed = ", ".join(f"{names[i]} by {-gaps[i]:.3g}{units[i]}" for i in worst[:5])
        more = f" and {len(deep) - 5} more" if len(deep) > 5 else ""
        remedy = "move the bodies apart or leave the pair out"
        if names[worst[0]].endswith(" limit"):
            remedy = (
                "start within the limits of the joints, or leave them out with scene.joints = JointLaws(limits=False)"
            )
        remedy += only_hulls(system, [names[i] for i in deep])
        raise Penetration(f"q0 penetrates: {listed}{more}; {remedy}")


def _frozen(state: State) -> State:
    for name in State.__slots__:
        value = getattr(state, name)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return state
