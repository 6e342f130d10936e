"""What can be differentiated, and along which directions the start of a run may move."""

from __future__ import annotations

from typing import Any

import numpy as np

from ngalpha_pin import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.initial import resting_contacts
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.scene.actuator import JointActuator
from ngalpha_pin.scene.forces import Control
from ngalpha_pin.sensitivities.configuration import row_parts
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
        (system.trees is not None, "a crowd of many bodies, whose steps capture impacts of any number of contacts"),
        (system.contacts.adheres, "contacts with adhesion, which let go all at once"),
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


def held_to(system: System, state: State, dq: np.ndarray, dv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions of the motion at the start along which constraints stay fulfilled and contacts that rest stay closed.

    Each direction is the nearest such one; a perturbation that opens or closes a contact would have another derivative
    on either side.

    Args:
        system: compiled scene.
        state: at the start.
        dq: directions of the configuration, shape (nv, r).
        dv: of the velocity, shape (nv, r).
    """
    sub, zero = resting_contacts_of(system, state), np.zeros(system.nv)
    system.dynamics(state.t, state.q, state.v, zero)
    parts = row_parts(system, sub, state.t, state.q, state.v, zero)
    if not parts:
        return dq, dv
    W, X = system.directions(parts).copy(), system.row_derivatives(parts, state.v, zero)[0]
    f, kb, mb = system.joint_friction.f, system.constraints.kb, system.constraints.mb
    first = sub.k + sub.m + f
    of_g = np.concatenate((np.arange(sub.k), np.arange(first, first + kb)))
    of_v = np.concatenate((of_g, np.arange(first + kb, first + kb + mb)))
    if len(of_g):
        dq = dq - np.linalg.pinv(W[of_g], NO_MOTION) @ (W[of_g] @ dq)
    if len(of_v):
        dv = dv - np.linalg.pinv(W[of_v], NO_MOTION) @ (W[of_v] @ dv + X[of_v] @ dq)
    return dq, dv


def resting_contacts_of(system: System, state: State) -> Any:
    """The contacts that rest at a state, as a subset."""
    if system.slots.n:
        system.slots.restore(state.slots)
    if not system.contacts.n:
        return system.contacts.subset(np.zeros(0, dtype=int))
    system.place(state.q)
    return resting_contacts(system, state.q, state.v)[0]
