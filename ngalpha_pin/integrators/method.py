"""What a time-stepping method is, and its step as everything above takes it: whatever fails in it, it has an answer."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ngalpha_pin.errors import NgalphaError, NotConverged
from ngalpha_pin.system.state import SolvedBy, State, StepResult
from ngalpha_pin.system.system import System


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


def failure(method: Method, system: System, state: State, dt: float, result: StepResult) -> NotConverged:
    """The error of a step that has not converged, with its time, its contacts and what to try."""
    if result.error is None:
        return method.not_converged(system, state, dt, result)
    names = tuple(system.contacts.names[i] for i in state.contacts)
    involved = f" with {', '.join(names[:6])}{' ...' if len(names) > 6 else ''} in contact" if names else ""
    error = NotConverged(
        f"the step from t = {state.t:.6g} s of dt = {dt:.3g} s cannot be computed{involved}: {result.error!r}; try a "
        "smaller dt, and look for velocities or forces that grow without bound",
        state.t,
        names,
    )
    error.__cause__ = result.error
    return error
