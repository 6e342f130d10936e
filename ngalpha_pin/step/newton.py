"""Semi-smooth Newton method (143) on the equations of a step."""

from __future__ import annotations

import numpy as np

from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation

# index sets that come back this often without a better residual are a cycle
MAX_RETURNS = 3


def semi_smooth_newton(
    equations: StepEquations,
    evaluation: Evaluation,
    max_iter: int,
    growth: float | None = None,
    smallest_forces: bool = False,
) -> tuple[Evaluation, bool, int, bool]:
    """Solve R(x) = 0 from an evaluated iterate.

    Args:
        equations: of the step.
        evaluation: of the first iterate.
        max_iter: corrections.
        growth: of the residual at which to give up, or None.
        smallest_forces: where directions are dependent, the smallest forces instead of the smallest change.

    Returns:
        The last evaluation, whether it meets the tolerance, the number of corrections, and whether any of them had
        dependent directions, so that the minimum norm was taken.
    """
    dependent = False
    seen: dict[bytes, int] = {}
    runs_away = np.inf if growth is None else growth * max(evaluation.error, 1.0)
    done = 0  # corrections of the engine
    if 1.0 < evaluation.error < np.inf:
        evaluation, done, dependent, seen = equations.in_engine(evaluation, max_iter, growth)
        if done and not dependent:
            return evaluation, evaluation.error <= 1.0, done, False
    for iteration in range(done, max_iter):
        if dependent and iteration == done:  # the engine has looked at this one
            evaluation, dependent = equations.corrected(evaluation, smallest_forces)
            continue
        if evaluation.error <= 1.0:
            return evaluation, True, iteration, dependent
        if not np.isfinite(evaluation.error) or evaluation.error > runs_away:
            return evaluation, False, iteration, dependent
        if equations.sub.k:
            sets = evaluation.index_sets()
            seen[sets] = seen.get(sets, 0) + 1
            if len(seen) > 1 and seen[sets] > MAX_RETURNS and iteration > 8:
                return evaluation, False, iteration, dependent
        evaluation, minimum_norm = equations.corrected(evaluation, smallest_forces)
        dependent |= minimum_norm
    return evaluation, evaluation.error <= 1.0, max_iter, dependent
