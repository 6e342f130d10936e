"""The ladder of solvers that a step climbs, from Newton's method to combinations of index sets."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ngalpha_pin.step_equations.evaluation import Choice, Evaluation, choices
from ngalpha_pin.step_solvers.active_set_enumeration import consistent_sets
from ngalpha_pin.step_solvers.effort_limits import at_limits, newton_within_efforts
from ngalpha_pin.step_solvers.fixed_point import RUNS_AWAY, captured, fixed_point
from ngalpha_pin.step_solvers.newton import semi_smooth_newton

if TYPE_CHECKING:
    from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
    from ngalpha_pin.step_equations.equations import StepEquations

# with more contacts in a step than this no combinations are tried: impacts are captured, or the step is halved
MANY, PATIENCE = 8, 6


def solve(
    method: GeneralizedAlpha,
    equations: StepEquations,
    evaluation: Evaluation,
    captures: bool = False,
) -> tuple[Evaluation, bool, int, str]:
    """The rungs of the solver ladder at one step size.

    Args:
        method: which rungs there are.
        equations: of the step.
        evaluation: of the first iterate.
        captures: among many contacts, without Newton's method before: it has failed in this step already, or would.

    Returns:
        The last evaluation, whether it meets the tolerance, the number of iterations, and the rung.
    """
    if method.solver == "fixed_point":
        return (*fixed_point(equations, evaluation), "fixed-point")
    n_iter = 0
    for law in ("newton", "laws of the paper"):
        if law != "newton":
            equations.choose(Choice(None, paper=True))
            evaluation = equations.evaluate(equations.start())
        # sticking joints make the directions of sticking feet dependent as further contacts do
        rows = equations.sub.k + equations.layout.f
        crowded = rows > MANY and method.solver == "auto" and law == "newton"
        patience = min(method.max_iter, PATIENCE) if crowded else method.max_iter
        growth = RUNS_AWAY if crowded else None
        converged, dependent = False, False
        if not (captures and crowded):
            evaluation, converged, n, dependent = newton_within_efforts(equations, evaluation, patience, growth)
            n_iter += n
        if not converged and crowded:
            evaluation, converged, n = captured(equations, evaluation.x if captures else None)
            n_iter += n
            if converged or equations.sub.k > MANY:
                return evaluation, converged, n_iter, "captured"
            equations.choose(Choice(None, method.paper))
        if not converged and not equations.smallest_forces:
            equations.smallest_forces = True
            if dependent:
                start = equations.evaluate(equations.start())
                evaluation, converged, n, _ = semi_smooth_newton(equations, start, method.max_iter)
                n_iter += n
        # without contacts and friction there are no index sets on which the other rungs could do better
        if converged or method.solver == "newton" or equations.layout.constraints.start == 0:
            return evaluation, converged, n_iter, "minimum-norm" if dependent else law
        if law == "newton" and not method.paper and at_limits(equations, evaluation):
            continue
        evaluation, converged, n = fixed_point(equations, equations.evaluate(equations.start()))
        n_iter += n
        if converged:
            return evaluation, True, n_iter, "fixed-point"
        for choice in choices(equations.sub, equations.layout.f > 0, equations.paper):
            equations.choose(choice)
            start = equations.evaluate(equations.start())
            evaluation, converged, n, _ = semi_smooth_newton(equations, start, method.max_iter)
            n_iter += n
            if converged:
                return evaluation, True, n_iter, "minimum-norm"
        found, n = consistent_sets(equations)
        n_iter += n
        if found is not None:
            equations.choose(Choice(None, equations.paper))
            return equations.evaluate(found), True, n_iter, "index sets"
        if method.paper or equations.sub.m + equations.layout.f == 0:
            break
    return evaluation, False, n_iter, law
