"""The cascade of solvers of a step, from Newton's method to combinations of index sets."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ngalpha_pin.step.active_set_enumeration import consistent_sets
from ngalpha_pin.step.differenced import DifferencedEquations
from ngalpha_pin.step.effort_limits import at_limits, newton_within_efforts
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.fixed_point import RUNS_AWAY, captured, fixed_point, percussions_alone
from ngalpha_pin.step.newton import semi_smooth_newton
from ngalpha_pin.step.options import PAPER, LawOptions, other_prox_parameters
from ngalpha_pin.system.state import SolvedBy

# Newton corrections among many contacts: what has not converged by then cycles, and is captured
PATIENCE = 6
# growth of the residual at which it is left where the step before had no forces to start from: a correction that does
# not help is as dear as a round
WITHOUT_FORCES = 1.0

Found = tuple[Evaluation | None, bool, int]
"""The last evaluation, if there was any, whether it meets the tolerance, and the number of iterations."""


class Solution(NamedTuple):
    """What the cascade has found.

    Attributes:
        evaluation: the last one.
        converged: it meets the tolerance.
        n_iter: iterations of all rungs.
        solved_by: the rung.
    """

    evaluation: Evaluation
    converged: bool
    n_iter: int
    solved_by: SolvedBy


def solve(equations: StepEquations, evaluation: Evaluation, captures: bool = False) -> Solution:
    """The rungs of the cascade at one step size.

    Args:
        equations: of the step.
        evaluation: of the first iterate.
        captures: among many contacts, without Newton's method before: it has failed in this step already, or would.
    """
    parameters = equations.parameters
    if parameters.solver == "fixed_point":
        return Solution(*fixed_point(equations, evaluation), SolvedBy.FIXED_POINT)
    first = _newton(equations, evaluation, captures)
    last = parameters.solver == "newton" or equations.n == 0
    if first.converged or last or first.solved_by is SolvedBy.CAPTURED:
        return first
    found = first
    # where it has not gone in circles not index sets are wrong, but corrections
    runs_away = first.n_iter >= parameters.max_iter or not np.isfinite(first.evaluation.error)
    if runs_away:
        found = _all_derivatives(equations, first)
    if found.converged or equations.layout.constraints.start == 0:  # no contacts and friction: no index sets to try
        return found
    # past its limit a motor is no reason for other index sets, but the laws of the paper may have a solution
    if parameters.paper or not at_limits(equations, first.evaluation):
        found = _other_rungs(equations, parameters.laws, found)
        if not (found.converged or runs_away):
            found = _all_derivatives(equations, found)
    if found.converged or parameters.paper or equations.sub.m + equations.layout.f == 0:
        return found
    again = _newton_on(equations, equations.evaluate(equations.start(), PAPER), SolvedBy.PAPER_LAWS, found)
    return again if again.converged else _other_rungs(equations, PAPER, again)


def _newton(equations: StepEquations, evaluation: Evaluation, captures: bool) -> Solution:
    """Newton's method with the laws of the step; where many contacts do not let it converge, the step is captured."""
    nothing = Solution(evaluation, False, 0, SolvedBy.NEWTON)
    if not (equations.regime.crowded and equations.parameters.auto):
        return _newton_on(equations, evaluation, SolvedBy.NEWTON, nothing)
    found, dependent = nothing, False
    if not captures:
        patience = min(equations.parameters.max_iter, PATIENCE)
        growth = WITHOUT_FORCES if percussions_alone(equations) else RUNS_AWAY
        evaluation, converged, n, dependent = newton_within_efforts(equations, evaluation, patience, growth)
        found = Solution(evaluation, converged, n, SolvedBy.MINIMUM_NORM if dependent else SolvedBy.NEWTON)
        if converged:
            return found
    evaluation, converged, n = captured(equations, evaluation, captures)
    found = Solution(evaluation, converged, found.n_iter + n, SolvedBy.CAPTURED)
    if converged or equations.regime.captured_only:
        return found
    return _smallest_forces(equations, equations.parameters.laws, found, SolvedBy.NEWTON, dependent)


def _newton_on(equations: StepEquations, evaluation: Evaluation, solved_by: SolvedBy, before: Solution) -> Solution:
    """Newton's method from an evaluation, and once more for the smallest forces where directions are dependent."""
    evaluation, converged, n, dependent = newton_within_efforts(equations, evaluation, equations.parameters.max_iter)
    found = Solution(evaluation, converged, before.n_iter + n, SolvedBy.MINIMUM_NORM if dependent else solved_by)
    return found if converged else _smallest_forces(equations, evaluation.options, found, solved_by, dependent)


def _smallest_forces(
    equations: StepEquations, laws: LawOptions, before: Solution, solved_by: SolvedBy, dependent: bool
) -> Solution:
    """Where directions are dependent, Newton's method with the smallest forces instead of the smallest changes."""
    if not dependent:
        return before._replace(solved_by=solved_by)
    start = equations.evaluate(equations.start(), laws)
    max_iter = equations.parameters.max_iter
    evaluation, converged, n, _ = semi_smooth_newton(equations, start, max_iter, smallest_forces=True)
    return Solution(evaluation, converged, before.n_iter + n, SolvedBy.MINIMUM_NORM)


def _fixed_point(equations: StepEquations, laws: LawOptions) -> Found:
    return fixed_point(equations, equations.evaluate(equations.start(), laws))


def _other_prox_parameters(equations: StepEquations, laws: LawOptions) -> Found:
    n_iter, found = 0, None
    for options in other_prox_parameters(equations.sub, equations.layout.f > 0, laws.paper):
        start = equations.evaluate(equations.start(), options)
        found, converged, n, _ = semi_smooth_newton(equations, start, equations.parameters.max_iter)
        n_iter += n
        if converged:
            return found, True, n_iter
    return found, False, n_iter


def _all_derivatives(equations: StepEquations, before: Solution) -> Solution:
    """Newton's method with the laws of the step and the derivatives of M and W by q."""
    if equations.regime.crowded or not equations.parameters.auto:  # an evaluation per coordinate
        return before
    laws, given = (
        equations.parameters.laws,
        (equations.system, equations.parameters, equations.state, equations.dt, equations.sub, equations.memory),
    )
    start = equations.evaluate(equations.start(), laws)
    if 1.0 < start.error < np.inf:
        evaluation, n, dependent, _ = equations.in_engine(start, equations.parameters.max_iter, None, True)
        if n and not dependent:
            solved = Solution(evaluation, evaluation.error <= 1.0, before.n_iter + n, SolvedBy.ALL_DERIVATIVES)
            return solved if solved.converged else before._replace(n_iter=solved.n_iter)
    twin = DifferencedEquations(*given)
    found, converged, n, _ = semi_smooth_newton(twin, twin.evaluate(twin.start(), laws), twin.parameters.max_iter)
    if not converged:
        return before._replace(n_iter=before.n_iter + n)
    evaluation = equations.evaluate(found.x, laws)
    return Solution(evaluation, evaluation.error <= 1.0, before.n_iter + n, SolvedBy.ALL_DERIVATIVES)


def _index_sets(equations: StepEquations, laws: LawOptions) -> Found:
    x, n = consistent_sets(equations, laws)
    return None if x is None else equations.evaluate(x, laws), x is not None, n


RUNGS: tuple[tuple[SolvedBy, Callable[[StepEquations, LawOptions], Found]], ...] = (
    (SolvedBy.FIXED_POINT, _fixed_point),
    (SolvedBy.MINIMUM_NORM, _other_prox_parameters),
    (SolvedBy.INDEX_SETS, _index_sets),
)
"""What is tried, one after the other, where Newton's method finds nothing."""


def _other_rungs(equations: StepEquations, laws: LawOptions, before: Solution) -> Solution:
    found = before
    for solved_by, rung in RUNGS:
        evaluation, converged, n = rung(equations, laws)
        found = Solution(evaluation or found.evaluation, converged, found.n_iter + n, found.solved_by)
        if converged:
            return found._replace(solved_by=solved_by)
    return found
