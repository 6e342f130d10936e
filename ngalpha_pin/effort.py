"""Newton's method where motors run into their effort limits.

A stiff servo on a light joint is a steep slope between two flat ends, and from one end Newton's method jumps to the
other. With every motor held either on its slope or at one of its limits the equations are smooth in it; from the slope
the solution shows which limits are passed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .newton import semi_smooth_newton

if TYPE_CHECKING:
    from .evaluation import Evaluation
    from .step_equations import StepEquations

ROUNDS = 6


def newton_within_efforts(
    equations: StepEquations, evaluation: Evaluation, max_iter: int, growth: float | None = None
) -> tuple[Evaluation, bool, int, bool]:
    """See `semi_smooth_newton`; where that fails, motors are held on their slopes or at their limits."""
    found, system = semi_smooth_newton(equations, evaluation, max_iter, growth), equations.system
    if found[1] or system.effort is None:
        return found
    n_iter, dependent, sides = found[2], found[3], np.zeros(len(system.effort[0]), dtype=int)
    try:
        for _ in range(ROUNDS):
            system.held = sides
            held, converged, n, minimum_norm = semi_smooth_newton(
                equations, equations.evaluate(equations.start()), max_iter
            )
            n_iter, dependent = n_iter + n, dependent | minimum_norm
            passed = system.passed_limits(equations.state.t + equations.dt, held.q, held.v)
            if not converged or np.array_equal(passed, sides):
                break
            sides = passed
    finally:
        system.held = None
    evaluation, converged, n, _ = semi_smooth_newton(equations, equations.evaluate(held.x), max_iter)
    return evaluation, converged, n_iter + n, dependent
