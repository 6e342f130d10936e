"""Which equations a step has."""

from __future__ import annotations

import numpy as np

from ngalpha_pin.contact.table import Subset
from ngalpha_pin.step.compiled import CompiledEquations, is_compiled
from ngalpha_pin.step.crowd import CrowdEquations, is_crowd
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System


def step_equations(
    system: System,
    parameters: Parameters,
    state: State,
    dt: float,
    sub: Subset,
    memory: tuple[np.ndarray, np.ndarray],
) -> StepEquations:
    """The equations of one step (see `StepEquations`), on the trees or compiled where that is possible."""
    kind = StepEquations
    if is_crowd(system, sub):
        kind = CrowdEquations
    elif is_compiled(system, sub):
        kind = CompiledEquations
    return kind(system, parameters, state, dt, sub, memory)
