"""The unit of forces in a step, which scales of rows and tolerances are made of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ngalpha_pin.step_equations.equations import StepEquations
    from ngalpha_pin.step_equations.evaluation import Evaluation

ROUNDING = 64 * np.finfo(float).eps
SMALLEST = 1e-200  # force unit of a step in which nothing moves


def force_unit(equations: StepEquations, ev: Evaluation, root_M: np.ndarray) -> float:
    """What a typical force of the step is, in kinetic scaling [sqrt(kg) m/s^2].

    The largest of weight, h, dry friction, inertia, and what the rounding of the velocities amounts to.
    """
    a, friction = ev.x[: equations.nv], equations.system.joint_friction
    h = ev.dynamics.residual - ev.dynamics.M @ a
    rounding = ROUNDING / (equations.method.tol * equations.dt)
    f = max(
        equations.system.weight,
        float((np.abs(h) / root_M).max()),
        float((root_M * np.maximum(np.abs(a), rounding * np.abs(ev.v))).max()),
        SMALLEST,
    )
    if friction.f:
        f = max(f, float((np.maximum(friction.upper, -friction.lower) / root_M[friction.dofs]).max()))
    return f
