"""Fixed-point iterations (146) on the linearised step, for where Newton's index sets run in circles.

The paper sweeps over all contacts with one prox parameter and evaluates the system in every sweep. Here a round solves
the contact problems of the linearised step (`linearised_round`); an outer loop evaluates the system again, and a short
Newton run from there accepts the solution. Among many bodies the index sets are those of the contact problems while
Newton's method runs: the gaps of closed contacts are so much smaller than what a step leaves of second order that the
prox functions would open them at once. Where percussions do all of the work there, no index sets are needed: rounds
follow each other until the laws hold.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.contact.laws import IndexSets
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.linearised_round import prox_round
from ngalpha_pin.step.newton import semi_smooth_newton
from ngalpha_pin.step.options import LawOptions

# rounds of any step, of one that is captured, and of one that is so on held index sets with accelerations, which need
# not have a solution
MAX_ROUNDS, CAPTURED_ROUNDS, WITH_ACCELERATIONS = 12, 8, 3
# Newton corrections from where a round has ended: from the right index sets it takes fewer
NEWTON_CHECK = 8
# of many contacts a correction costs as much as a round: where the round was right two or three of them are enough;
# and a residual that has grown so many times has not been seen to come back
CROWD_CHECK, RUNS_AWAY = 4, 10.0
# on index sets that are held Newton's method is quadratic; where they are wrong its residual does not fall, nor do
# the changes of rounds that lead nowhere
HELD_CHECK, FALLS = 12, 0.5
# tolerances of a gap by which a contact may be open or closed that is not so in the problem of the gaps
SLACK = 4.0


def captured(equations: StepEquations, evaluation: Evaluation, from_there: bool) -> tuple[Evaluation, bool, int]:
    """Solve the step with laws that have a solution also where many contacts meet an impact.

    All percussions follow Coulomb's law with the velocity at the end of the step (112), and frictional impulses do not
    move the bodies before. Then, to leading order in dt, gaps, velocities and accelerations are three contact problems,
    one after the other, which `prox_round` solves. Of first order, as every impact that is put at the end of a step.
    Where the one of the accelerations is not solved, was not with contacts less, or with many contacts was not in the
    step before, percussions do all of the work in this step.

    Args:
        equations: of the step.
        evaluation: of the first iterate, with the laws of the step.
        from_there: start at that iterate instead of that of a step without impulses.

    Returns:
        See `fixed_point`.
    """
    crowd, n_iter, start = equations.regime.among_many_bodies, 0, evaluation.x if from_there else None
    forces = evaluation.options.accelerates and not percussions_alone(equations)
    for accelerates in (True, False) if forces else (False,):
        laws = LawOptions(paper=True, displaces=False, accelerates=accelerates)
        if crowd and not accelerates:
            evaluation, converged, n = by_percussions(equations, start)
        else:
            rounds = WITH_ACCELERATIONS if crowd else CAPTURED_ROUNDS
            x = equations.start() if start is None else start
            evaluation, converged, n = fixed_point(equations, equations.evaluate(x, laws), rounds)
        n_iter += n
        if converged:
            break
    return evaluation, converged, n_iter


def percussions_alone(equations: StepEquations) -> bool:
    """Percussions did all of the work of the step before, of so many contacts that trying for forces again is dear."""
    regime, state = equations.regime, equations.state
    many = regime.among_many_bodies and not regime.ranked
    return many and bool(state.P_N.any()) and not bool(state.la_N.any())


def by_percussions(equations: StepEquations, start: np.ndarray | None) -> tuple[Evaluation, bool, int]:
    """Solve a step without contact forces by rounds alone.

    Its velocities and gaps are two contact problems. What counts is how well prox functions hold that are continuous
    (see `slack` of `ContactResidual`), not that index sets are found: among hundreds of contacts some always stick,
    slip or carry by less than can be told from nothing.

    Args:
        equations: of the step.
        start: first iterate; by default the percussions of the step before.

    Returns:
        See `fixed_point`.
    """
    laws = LawOptions(paper=True, displaces=False, accelerates=False, slack=np.zeros(equations.sub.k))
    evaluation, n_iter = equations.evaluate(equations.start_from_percussions() if start is None else start, laws), 0
    while 1.0 < evaluation.error < np.inf and n_iter < MAX_ROUNDS:
        x, sets = prox_round(equations, evaluation, patient=True)
        slack = np.where(sets.A, 1.0, -1.0) * SLACK * equations.r[: equations.sub.k] * equations.gap_tolerance
        evaluation, n_iter = equations.evaluate(x, replace(laws, slack=slack)), n_iter + 1
    return evaluation, evaluation.error <= 1.0, n_iter


def fixed_point(
    equations: StepEquations, evaluation: Evaluation, rounds: int = MAX_ROUNDS
) -> tuple[Evaluation, bool, int]:
    """Solve R(x) = 0 from an evaluated iterate, with its laws.

    Returns:
        The last evaluation, whether it meets the tolerance, the number of rounds and Newton corrections.
    """
    n_iter, many, laws, moved = 0, not equations.regime.few, evaluation.options, np.inf
    holds = equations.regime.among_many_bodies
    for done in range(rounds):
        if evaluation.error <= 1.0 or not np.isfinite(evaluation.error):
            break
        before = evaluation.error
        x, sets = prox_round(equations, evaluation, patient=many and done > 0)
        last, moved = moved, float(np.abs(x - evaluation.x).max())
        # of a few contacts rounds go to a solution at once, or to none
        if not many and done > 1 and moved > FALLS * last:
            break
        if holds:
            evaluation, solved, n = _on_sets(equations, x, laws, sets)
            n_iter += n + 1
            if solved:
                continue
        else:
            check = (CROWD_CHECK, RUNS_AWAY) if many else (NEWTON_CHECK, None)
            evaluation = equations.evaluate(x, laws)
            checked, converged, n, _ = semi_smooth_newton(equations, evaluation, *check)
            n_iter += n + 1
            if converged:
                return checked, True, n_iter
            evaluation = equations.evaluate(x, laws)  # Pinocchio's data are those of Newton's last iterate
        if many and done > 1 and evaluation.error > 0.5 * before:
            break
    return evaluation, evaluation.error <= 1.0, n_iter


def _on_sets(
    equations: StepEquations, x: np.ndarray, laws: LawOptions, sets: IndexSets
) -> tuple[Evaluation, bool, int]:
    """Newton's method on given index sets.

    Returns:
        R at the solution, or at x where there is none, on the index sets of the prox functions; whether there is one,
        and the number of corrections.
    """
    n, last = 0, np.inf
    evaluation = equations.evaluate(x, replace(laws, sets=sets))
    while 1.0 < evaluation.error < np.inf and n < HELD_CHECK and (n < 3 or evaluation.error < FALLS * last):
        last = evaluation.error
        evaluation, n = equations.corrected(evaluation)[0], n + 1
    solved = evaluation.error <= 1.0
    return equations.evaluate(evaluation.x if solved else x, laws), solved, n
