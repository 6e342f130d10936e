"""The start of a run: initial values checked, and accelerations and contact forces that agree with them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from .contact_kinematics import Rows
from .contact_problem import forces_of_closed_contacts
from .contact_table import Subset
from .errors import Penetration, SceneError
from .state import State
from .system import System

# parts of the length of the scene, and of a velocity, that count as zero at the start
CLOSED = 1e-10
PENETRATION = 1e-9


def initial_state(system: System, q0: np.ndarray, v0: np.ndarray | None = None, t0: float = 0.0) -> State:
    """The state at t0 with consistent accelerations and contact forces.

    Contacts that are closed and do not open get la_N and la_F from Signorini's law on acceleration level (60) and from
    Coulomb's law: sticking on acceleration level, or slipping along the slip velocity (120).

    Args:
        system: compiled scene.
        q0: configuration, shape (nq,).
        v0: velocity, shape (nv,); None is rest.
        t0: time [s].

    Raises:
        SceneError: wrong shape, not finite, or a quaternion that is not a unit one.
        Penetration: a contact has a negative gap at q0.
    """
    q, v = _checked(system.model, q0, v0)
    table = system.contacts
    dynamics = system.dynamics(t0, q, v, np.zeros(system.model.nv))
    if not np.linalg.cond(dynamics.M) < 1e15:
        raise SceneError("the mass matrix at q0 is singular: a moving body needs mass and inertia (or armature)")
    if table.n:
        _check_gaps(table.names, system.gaps(table.subset(np.arange(table.n))), table.length)
    return _frozen(consistent_state(system, t0, q, v))


def consistent_state(system: System, t: float, q: np.ndarray, v: np.ndarray) -> State:
    """Accelerations and forces of the contacts that are closed and do not open at (q, v), as they are just after t."""
    table = system.contacts
    dynamics = system.dynamics(t, q, v, np.zeros(system.model.nv))
    a = np.linalg.solve(dynamics.M, -dynamics.residual)
    sub = closed_contacts(system)
    if sub.k == 0:
        return State(t, q, v, a, a)
    dynamics = system.dynamics(t, q, v, a)
    rows = system.contact_rows(sub, v, a)
    speed = CLOSED * max(float(np.abs(rows.c_dot).max()), float(np.sqrt(table.length * 9.81)))
    resting = rows.rate[: sub.k] <= speed
    if not resting.all():
        sub = table.subset(sub.index[resting])
        if sub.k == 0:
            return State(t, q, v, a, a)
        rows = system.contact_rows(sub, v, a)
    la_N, la_F = _contact_forces(sub, rows, dynamics.M, speed)
    a = a + np.linalg.solve(dynamics.M, la_N @ rows.W[: sub.k] + la_F @ rows.W[sub.k :])
    zero_N, zero_F = np.zeros(sub.k), np.zeros(sub.m)
    return State(t, q, v, a, a, sub.index, zero_N, zero_N, la_N, la_N, zero_N, zero_F, la_F, la_F, zero_F)


def closed_contacts(system: System) -> Subset:
    """The contacts that touch where the last call of `dynamics` or `place` has put the bodies."""
    table = system.contacts
    every = table.subset(np.arange(table.n))
    return table.subset(np.flatnonzero(system.gaps(every) <= CLOSED * table.length)) if table.n else every


def _contact_forces(sub: Subset, rows: Rows, M: np.ndarray, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """la_N and la_F of closed contacts, from their accelerations without contact forces."""
    k, o = sub.k, sub.of_F
    gamma_F = rows.rate[k:]
    slips = np.sqrt(np.bincount(o, gamma_F**2, k)) > speed
    G = rows.W @ np.linalg.solve(M, rows.W.T)
    slip = np.where(slips[o], gamma_F, 0.0)
    la = forces_of_closed_contacts(G, rows.acceleration, sub.mu, o, np.ones(k, dtype=bool), slip)
    return la[:k], la[k:]


def _checked(model: pin.Model, q0: np.ndarray, v0: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    q = np.array(q0, dtype=float)
    v = np.zeros(model.nv) if v0 is None else np.array(v0, dtype=float)
    if q.shape != (model.nq,):
        raise SceneError(f"q0 has shape {q.shape}, the model needs ({model.nq},)")
    if v.shape != (model.nv,):
        raise SceneError(f"v0 has shape {v.shape}, the model needs ({model.nv},)")
    for name, x in (("q0", q), ("v0", v)):
        if not np.isfinite(x).all():
            raise SceneError(f"{name}[{int(np.flatnonzero(~np.isfinite(x))[0])}] is not finite")
    for name, i, n in zip(model.names, model.idx_qs, model.nqs, strict=True):
        alone = pin.neutral(model)
        alone[i : i + n] = q[i : i + n]
        if pin.isNormalized(model, alone, 1e-9):
            continue
        raise SceneError(
            f"q0: the quaternion (x, y, z, w) or the pair (cos, sin) of joint {name!r} does not have norm 1; "
            "normalise it, e.g. with pin.normalize(model, q)"
        )
    return q, v


def _check_gaps(names: tuple[str, ...], gaps: np.ndarray, length: float) -> None:
    deep = np.flatnonzero(gaps < -PENETRATION * length)
    if len(deep):
        worst = deep[np.argsort(gaps[deep])]
        listed = ", ".join(f"{names[i]} by {-gaps[i]:.3g} m" for i in worst[:5])
        more = f" and {len(deep) - 5} more" if len(deep) > 5 else ""
        raise Penetration(f"q0 penetrates: {listed}{more}; move the bodies apart or leave the pair out")


def _frozen(state: State) -> State:
    for name in State.__slots__:
        value = getattr(state, name)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return state
