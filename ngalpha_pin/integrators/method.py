"""What a time-stepping method is."""

from __future__ import annotations

from typing import Protocol

from ngalpha_pin.errors import NotConverged
from ngalpha_pin.system.state import State, StepResult
from ngalpha_pin.system.system import System


class Method(Protocol):
    """A time-stepping method: `GeneralizedAlpha` or `MoreauJean`."""

    def step(self, system: System, state: State, dt: float) -> StepResult:
        """One step."""

    def not_converged(self, system: System, state: State, dt: float, result: StepResult) -> NotConverged:
        """The error of a step that failed."""
