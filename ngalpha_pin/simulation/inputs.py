"""What a run is asked for, checked before anything is computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.event_driven.user_events import UserEvent
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.integrators.method import Method
from ngalpha_pin.scene.actuator import JointActuator
from ngalpha_pin.scene.forces import Control
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.scene.user_function import check_pure
from ngalpha_pin.system.names import Names, differences, names_of
from ngalpha_pin.system.sampling import sampled_shape
from ngalpha_pin.system.state import Auxiliary, State
from ngalpha_pin.system.system import System

# shorter steps, in parts of the time at the end of the run, are lost in its rounding
SHORTEST = 1e-13
# part of a step that is none: what sums of many steps leave of a time
LATE = 1e-9
# the arrays of a state: number of axes and kinds of numbers; the others are checked one by one
ARRAYS = {
    field.name: (
        2 if field.name in ("slots", "sampled") else 1,
        "iu" if field.name in ("contacts", "near", "holding") else "iuf",
    )
    for field in fields(State)
    if field.name not in ("t", "dt", "whole", "clearance", "memory", "names")
}


def checked_scene(scene: Any) -> Scene:
    """The scene, if it is one and its controls are functions of what they are called with.

    Raises:
        SceneError: it is none, or the function of a control remembers its calls.
    """
    checks.instance("scene", scene, Scene, "a Scene")
    for force in scene.forces:
        law = force.law if isinstance(force, Control) else force.ctrl if isinstance(force, JointActuator) else None
        if isinstance(force, (Control, JointActuator)) and callable(law):
            q, v = pin.neutral(scene.model), np.linspace(0.1, 0.2, scene.model.nv)  # moving: memories see rates
            check_pure(force.name, law, 0.0, q, v)
    return scene


def checked_method(method: Any) -> Method:
    """The method; None is the default one."""
    if method is None:
        return GeneralizedAlpha()
    if isinstance(method, type) or not all(callable(getattr(method, name, None)) for name in ("step", "not_converged")):
        raise checks.fail("method", method, "a method such as GeneralizedAlpha(...) or MoreauJean(...)")
    return method


def checked_dt(dt: Any) -> float:
    """A length of a step [s]."""
    return checks.number("dt", dt, 0.0, above=True, unit="seconds")


def checked_torque(tau: Any, nv: int) -> np.ndarray:
    """A generalized force that is held during a step, shape (nv,); None is none, of shape (0,)."""
    return np.zeros(0) if tau is None else checks.vector("tau", tau, nv)


def number_of_steps(start: float, t_end: float, dt: float) -> int:
    """Steps of a run with fixed steps; the last one ends at the multiple of dt nearest to t_end."""
    span = t_end - start
    if dt > span * (1.0 + LATE):
        raise SceneError(f"dt = {dt:g} is longer than the run, which goes from t = {start:g} to t_end = {t_end:g} s")
    if dt < SHORTEST * max(abs(start), abs(t_end)):
        raise SceneError(f"dt = {dt:g} is lost in the rounding of times up to t_end = {t_end:g} s; take a longer step")
    return max(1, round(span / dt))


def checked_t_end(t_end: Any, start: float, dt: float | None) -> float:
    """The end of a run [s]."""
    t_end = checks.number("t_end", t_end, unit="seconds")
    if not t_end > start + LATE * (dt or 0.0):
        raise SceneError(f"t_end = {t_end} must be later than the start at t = {start:g} s")
    return t_end


def checked_events(events: Any) -> list[UserEvent]:
    """The events of the user: one function of (t, q, v), or some."""
    if callable(events):
        return [UserEvent(events)]
    if not isinstance(events, Sequence) or isinstance(events, (str, bytes)):
        raise checks.fail("events", events, "a function of (t, q, v) or a list of some")
    return [UserEvent(event) for event in events]


def _check_fields(state: State) -> None:
    """Each field of a state is of its type, whatever its size."""
    for name in ("t", "dt", "whole"):
        checks.number(f"state.{name}", getattr(state, name), -np.inf if name == "t" else 0.0)
    checks.array("state.clearance", state.clearance, (), finite=False)
    checks.instance("state.memory", state.memory, (Auxiliary, type(None)), "that of a step")
    names, length = checks.instances("state.names", state.names, tuple, "a tuple of names"), len(Names._fields)
    if len(names) not in (0, length):
        raise checks.fail("state.names", state.names, f"{length} tuples of names, as a step gives them, or ()")
    for name, (axes, kinds) in ARRAYS.items():
        value = getattr(state, name)
        if not isinstance(value, np.ndarray) or value.ndim != axes or (value.size and value.dtype.kind not in kinds):
            raise checks.fail(f"state.{name}", value, f"an array of numbers with {axes} axes, as a step gives it")


def checked_state(system: System, state: Any) -> State:
    """A state that is continued; its arrays have the sizes of the system.

    Raises:
        SceneError: it is none, it belongs to another scene, or it is not finite.
    """
    checks.instance("state", state, State, "a State such as trajectory.final_state")
    _check_fields(state)
    contacts, constraints = state.contacts, system.constraints
    said = differences(Names(*state.names), names_of(system)) if state.names else ""
    if said:
        raise SceneError(
            f"the state belongs to another scene: {said}; ngalpha_pin.transfer(state, scene_a, scene_b) carries over "
            "what both have"
        )
    if state.q.shape != (system.nq,) or state.v.shape != (system.nv,):
        found, needed = (state.q.shape, state.v.shape), ((system.nq,), (system.nv,))
        raise SceneError(f"the state belongs to another scene: q and v have the shapes {found}, this needs {needed}")
    known = np.concatenate((contacts, state.near, state.holding)).astype(int)
    if len(known) and not (0 <= known.min() and known.max() < system.contacts.n):
        raise SceneError(f"the state belongs to another scene: this one has {system.contacts.n} contacts, not so many")
    sub, f, b = system.contacts.subset(contacts), system.joint_friction.f, constraints.kb + constraints.mb
    sizes = {"a": system.nv, "a_bar": system.nv, "_N": sub.k, "_F": sub.m, "_f": f, "_b": b}
    for what, value in state.to_arrays().items():
        end = what if what.startswith("a") else what.removesuffix("_bar")[-2:]
        if end in sizes and (len(value) or end not in ("_f", "_b")):
            checks.vector(f"state.{what}", value, sizes[end])
    held = checks.array("state.sampled", state.sampled, (None, None))
    if held.shape != sampled_shape(system):
        raise SceneError(
            f"the state belongs to another scene: it has {len(held)} sampled controls, this one {len(system.samplers)} "
            "with what their laws remember"
        )
    return state
