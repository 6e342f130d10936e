"""What a time-stepping method is, and its step as everything above takes it: whatever fails in it, it has an answer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from ngalpha_pin.errors import NgalphaError, NotConverged
from ngalpha_pin.integrators.jumping_force import jumping_force
from ngalpha_pin.scene.joints import linear_coordinates
from ngalpha_pin.system.state import SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

# turning of a joint in one step that the method resolves [rad]
RESOLVED = 0.5
# turning of the normal of a contact in one step that the method resolves: force and chord differ by 0.5 % [rad]
AROUND = 0.1
# part of a step over which a rate is taken
MOMENT = 1e-4
# distance from the origin in parts of the size of the scene from which on the rounding of positions is felt
FAR = 1e5


class Method(Protocol):
    """A time-stepping method: `GeneralizedAlpha` or `MoreauJean`."""

    def step(self, system: System, state: State, dt: float) -> StepResult:
        """One step."""

    def not_converged(self, system: System, state: State, dt: float, result: StepResult) -> NotConverged:
        """The error of a step that failed."""


def attempted(method: Method, system: System, state: State, dt: float) -> StepResult:
    """One step; where its arithmetic fails, e.g. in a singular matrix, it is one that has not converged.

    Raises:
        SceneError: a function of the user's own gives something that cannot be used.
    """
    try:
        return method.step(system, state, dt)
    except (NgalphaError, MemoryError):
        raise
    except Exception as error:
        return StepResult(state, False, 0, SolvedBy.NEWTON, np.inf, error=error)


def attempted_ahead(method: Method, system: System, state: State, dt: float, n: int) -> Sequence[StepResult]:
    """Up to n steps in which nothing happens, where the method has a way to make them at once; otherwise none.

    Raises:
        SceneError: a function of the user's own gives something that cannot be used.
    """
    ahead = getattr(method, "steps_ahead", None)
    if ahead is None or n < 2:
        return []
    try:
        found: Sequence[StepResult] = ahead(system, state, dt, n)
        return found
    except (NgalphaError, MemoryError):
        raise
    except Exception:  # the step of which this is one says so
        return []


def failure(method: Method, system: System, state: State, dt: float, result: StepResult) -> NotConverged:
    """The error of a step that has not converged: its time, its contacts, the reason where it is known, what to try."""
    if result.error is None:
        error = method.not_converged(system, state, dt, result)
        hints = (
            turns_far(system, state, dt),
            turns_around(system, state, dt),
            lies_far(system, state),
            jumping_force(system, state, dt, result.state),
        )
        error.args = (str(error) + "".join(hints),)
        return error
    names = tuple(system.contacts.names[i] for i in state.contacts)
    involved = f" with {', '.join(names[:6])}{' ...' if len(names) > 6 else ''} in contact" if names else ""
    error = NotConverged(
        f"the step from t = {state.t:.6g} s of dt = {dt:.3g} s cannot be computed{involved}: {result.error!r}; try a "
        f"smaller dt, and look for velocities or forces that grow without bound{turns_far(system, state, dt)}",
        state.t,
        names,
    )
    error.__cause__ = result.error
    return error


def turns_far(system: System, state: State, dt: float) -> str:
    """The joint that turns too far in a step to be resolved, and the step that resolves it; "" where there is none."""
    model = system.tree
    turn = np.where(linear_coordinates(model)[0], 0.0, np.abs(state.v[: model.nv])) if model.nv else np.zeros(1)
    fastest = int(np.argmax(turn))
    if not dt * turn[fastest] > RESOLVED:
        return ""
    joint = next(n for n, i, k in zip(model.names, model.idx_vs, model.nvs, strict=True) if i <= fastest < i + k)
    resolves = RESOLVED / turn[fastest]
    return f"; joint {joint!r} turns by {dt * turn[fastest]:.2g} rad in a step, dt = {resolves:.1e} s would resolve it"


def turns_around(system: System, state: State, dt: float) -> str:
    """The contact with a round surface around which a body turns too far in a step, and the step that resolves it."""
    sub = system.contacts.subset(state.contacts[state.contacts < system.contacts.n_fixed])
    if not sub.k or not sub.any_curved or not np.isfinite([*state.q, *state.v]).all():
        return ""
    normals = []
    for h in (0.0, MOMENT * dt):
        system.place(system.integrate(state.q, h * state.v))
        normals.append(np.array(system.point_rows(sub).normals))
    rate = np.linalg.norm(normals[1] - normals[0], axis=1) * sub.curved / (MOMENT * dt)
    fastest = int(np.argmax(rate))
    if not dt * rate[fastest] > AROUND:
        return ""
    return (
        f"; the normal of {sub.names[fastest]} turns by {dt * rate[fastest]:.2g} rad in a step: a body runs around its "
        f"round surface, dt = {AROUND / rate[fastest]:.1e} s would resolve it"
    )


def lies_far(system: System, state: State) -> str:
    """How far from the origin the bodies are, where that rounds off what contacts are computed with; or ""."""
    if not system.contacts.n or not np.isfinite(state.q).all():
        return ""
    system.place(state.q)
    distance = float(np.abs(system.poses[1]).max(initial=0.0))
    if not distance > FAR * system.contacts.length:
        return ""
    rounding = distance * float(np.finfo(float).eps)
    return (
        f"; bodies of {system.contacts.length:.2g} m are {distance:.2g} m away from the origin of the world, where "
        f"positions are rounded to {rounding:.1g} m: move the scene towards the origin"
    )
