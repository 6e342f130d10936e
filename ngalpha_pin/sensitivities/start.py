"""What can be differentiated, and along which directions the start of a run may move."""

from __future__ import annotations

from typing import Any

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.initial import joint_speed, resting_contacts
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.scene.actuator import JointActuator
from ngalpha_pin.scene.forces import Control
from ngalpha_pin.sensitivities.configuration import Geometry, full, row_parts
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

NO_MOTION = 1e-9  # singular values of the rows that hold the start, in parts of the largest, that hold nothing


def check_differentiable(system: System, method: Any) -> GeneralizedAlpha:
    """The method, where the steps of a scene can be differentiated.

    Raises:
        SceneError: they cannot, and why.
    """
    if type(method) is not GeneralizedAlpha:
        raise SceneError(f"derivatives are those of GeneralizedAlpha; {type(method).__name__} has none")
    reasons = (
        (system.many_trees, "a crowd of many bodies, whose steps capture impacts of any number of contacts"),
        (system.contacts.adheres, "contacts with adhesion, which let go all at once"),
        (
            system.contacts.has_restitution.any() or system.contacts.soft.any(),
            "contacts that are compliant or whose restitution is more than a number",
        ),
        (
            system.contacts.resists or system.contacts.axes.has.any(),
            "contacts with rolling resistance or a friction ellipse",
        ),
        (bool(system.samplers), "a SampledControl, whose law remembers what it likes; use a Control or a JointPD"),
        (system.states is not None, "states of the first order or own unilateral constraints"),
    )
    for there, what in reasons:
        if there:
            raise SceneError(f"this scene has no derivatives: it has {what}")
    for force in system.scene.forces:
        if isinstance(force, Control) and not force.derivatives:
            raise SceneError(
                f"{force.name}: its derivatives are not known, and those of the run would be wrong without a sign of "
                "it; give Control(law, derivatives=True)"
            )
        if isinstance(force, JointActuator) and callable(force.ctrl):
            raise SceneError(f"actuator {force.name!r}: how its ctrl depends on q and v is not known; give a number")
    return method


def directions(name: str, given: Any, nv: int) -> np.ndarray:
    """Directions of q0 or v0, shape (nv, r): those that are given, each coordinate where all are, or none.

    Raises:
        SceneError: they have another shape.
    """
    if given is None or given is False:
        return np.zeros((nv, 0))
    if given is True:
        return np.eye(nv)
    return checks.array(f"sensitivities: {name}", given, (nv, None))


def held_to(geometry: Geometry, state: State, dq: np.ndarray, dv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions of the motion at the start along which what holds it goes on to hold.

    Constraints stay fulfilled, contacts that rest stay closed, and those that stick go on to, as do joints with dry
    friction that do not move. Each direction is the nearest such one in the metric of the mass matrix: a slip that is
    next to none ends at once, by percussions that leave just that. A change that opens or closes a contact would have
    another derivative on either side.

    Args:
        geometry: of the scene.
        state: at the start.
        dq: directions of the configuration, shape (nv, r).
        dv: of the velocity, shape (nv, r).
    """
    system = geometry.system
    (sub, speed), still = resting_contacts_of(system, state), np.zeros(system.nv)
    M = full(system.dynamics(state.t, state.q, state.v, still).M)
    parts = row_parts(system, sub, state.t, state.q, state.v, still)
    if not parts:
        return dq, dv
    W, rate = system.directions(parts).copy(), np.concatenate([part.rate for part in parts])
    k, j, f, kb = sub.k, sub.k + sub.m, system.joint_friction.f, system.constraints.kb
    slips = np.sqrt(np.bincount(sub.of_F, rate[k:j] ** 2, k)) > speed
    of_g, of_v = np.zeros(len(W), dtype=bool), np.ones(len(W), dtype=bool)
    of_g[:k], of_g[j + f : j + f + kb] = True, True
    of_v[k:j], of_v[j : j + f] = ~slips[sub.of_F], np.abs(rate[j : j + f]) <= joint_speed(system)
    X = np.zeros_like(W)
    X[np.r_[:j, j + f : len(W)]] = geometry.rates(state.t, sub, state.q, state.v) if len(W) > f else 0.0
    dq = dq - _least(M, W[of_g], W[of_g] @ dq)
    return dq, dv - _least(M, W[of_v], W[of_v] @ dv + X[of_v] @ dq)


def _least(M: np.ndarray, W: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The smallest x with W x = y, in the metric of M, shape (nv, r)."""
    if not len(W):
        return np.zeros((len(M), y.shape[1]))
    by_M = np.linalg.solve(M, W.T)
    found: np.ndarray = by_M @ np.linalg.pinv(W @ by_M, NO_MOTION) @ y
    return found


def resting_contacts_of(system: System, state: State) -> tuple[Subset, float]:
    """The contacts that rest at a state, and the speed that counts as none [m/s]."""
    if system.slots.n:
        system.slots.restore(state.slots)
    if not system.contacts.n:
        return system.contacts.subset(np.zeros(0, dtype=int)), 0.0
    system.place(state.q)
    return resting_contacts(system, state.q, state.v)
