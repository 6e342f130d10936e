"""Fixed-point iterations (146) on the linearised step, for where Newton's index sets run in circles.

The paper sweeps over all contacts with one prox parameter and evaluates the system in every sweep. To leading order in
dt the three levels of the laws are three contact problems with the same Delassus matrix G = W^T M^-1 W: the gaps with
kappa_hat_N, the velocities with P, the accelerations with la. Here each is solved by Gauss-Seidel prox sweeps; an outer
loop evaluates the system again, and a short Newton run from there accepts the solution. Among many bodies the index
sets are those of the contact problems while Newton's method runs: the gaps of closed contacts are so much smaller than
what a step leaves of second order that the prox functions would open them at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .contact_laws import IndexSets
from .contact_problem import FreeProblem, forces_of_closed_contacts, solve_contact_problem
from .evaluation import Choice
from .newton import semi_smooth_newton

if TYPE_CHECKING:
    from .contact_table import Subset
    from .evaluation import Evaluation
    from .step_equations import StepEquations

# rounds of any step, of one that is captured, and of one that is so on held index sets with accelerations, which need
# not have a solution
MAX_ROUNDS, CAPTURED_ROUNDS, WITH_ACCELERATIONS = 12, 8, 3
NEWTON_CHECK = 8
# of many contacts a correction costs as much as a round: where the round was right two or three of them are enough;
# and a residual that has grown so many times has not been seen to come back
CROWD_CHECK, RUNS_AWAY = 4, 10.0
# on index sets that are held Newton's method is quadratic; where they are wrong its residual does not fall
HELD_CHECK, FALLS = 12, 0.5
# Newton polishes what the sweeps leave
SWEEP_TOL, MAX_SWEEPS = 1e-11, 320
# joint friction is left to the sweeps alone
JOINT_SWEEPS = 5000
SWEEPS_PER_ROW, FEW = 1, 16  # more sweeps for more contacts than a few: what one feels reaches the others in sweeps
# friction that is held back at first, how often more contacts may turn out to slip with that, and the slip velocity
# that is none, in parts of the largest velocity: where the sweeps have converged, and where they have not
HELD_BACK, HELD_ROUNDS, STILL, STILL_ROUGHLY = 0.98, 4, 1e-8, 1e-4
DEPENDENT = 1e-10  # eigenvalue of the scaled Delassus matrix that is none
RANKED = 150  # rows up to which eigenvalues are looked at; with more, directions are taken as dependent


def captured(equations: StepEquations, start: np.ndarray | None = None) -> tuple[Evaluation, bool, int]:
    """Solve the step with laws that have a solution also where many contacts meet an impact.

    All percussions follow Coulomb's law with the velocity at the end of the step (112), and frictional impulses do not
    move the bodies before. Then, to leading order in dt, gaps, velocities and accelerations are three contact problems,
    one after the other, which `prox_round` solves. Of first order, as every impact that is put at the end of a step.
    Where the one of the accelerations is not solved, or was not with contacts less, percussions do all of the work in
    this step.

    Args:
        equations: of the step.
        start: first iterate; by default that of a step without impulses.

    Returns:
        See `fixed_point`.
    """
    n_iter, start = 0, equations.start() if start is None else start
    for accelerates in (True, False) if equations.accelerates else (False,):
        equations.choose(Choice(None, paper=True, displaces=False, accelerates=accelerates))
        rounds = WITH_ACCELERATIONS if accelerates and _holds_sets(equations) else CAPTURED_ROUNDS
        evaluation, converged, n = fixed_point(equations, equations.evaluate(start), rounds)
        n_iter += n
        if converged:
            break
    return evaluation, converged, n_iter


def fixed_point(
    equations: StepEquations, evaluation: Evaluation, rounds: int = MAX_ROUNDS
) -> tuple[Evaluation, bool, int]:
    """Solve R(x) = 0 from an evaluated iterate.

    Returns:
        The last evaluation, whether it meets the tolerance, the number of rounds and Newton corrections.
    """
    n_iter, many = 0, equations.sub.k > FEW
    holds = _holds_sets(equations)
    equations.smallest_forces = False  # what the sweeps have found is to be polished, not replaced
    for done in range(rounds):
        if evaluation.error <= 1.0 or not np.isfinite(evaluation.error):
            break
        before = evaluation.error
        x, sets = prox_round(equations, evaluation, patient=many and done > 0)
        if holds:
            evaluation, solved, n = _on_sets(equations, x, sets)
            n_iter += n + 1
            if solved:
                continue
        else:
            check = (CROWD_CHECK, RUNS_AWAY) if many else (NEWTON_CHECK, None)
            evaluation = equations.evaluate(x)
            checked, converged, n, _ = semi_smooth_newton(equations, evaluation, *check)
            n_iter += n + 1
            if converged:
                return checked, True, n_iter
            evaluation = equations.evaluate(x)  # Pinocchio's data are those of Newton's last iterate
        if many and done > 1 and evaluation.error > 0.5 * before:
            break
    return evaluation, evaluation.error <= 1.0, n_iter


def _holds_sets(equations: StepEquations) -> bool:
    """Newton's method runs on the index sets of the contact problems."""
    return equations.sub.k > FEW and equations.prescribes and equations.system.trees is not None


def _on_sets(equations: StepEquations, x: np.ndarray, sets: IndexSets) -> tuple[Evaluation, bool, int]:
    """Newton's method on given index sets.

    Returns:
        R at the solution, or at x where there is none, on the index sets of the prox functions; whether there is one,
        and the number of corrections.
    """
    equations.sets, n, last = sets, 0, np.inf
    evaluation = equations.evaluate(x)
    while 1.0 < evaluation.error < np.inf and n < HELD_CHECK and (n < 3 or evaluation.error < FALLS * last):
        last = evaluation.error
        evaluation, n = equations.corrected(evaluation)[0], n + 1
    equations.sets, solved = None, evaluation.error <= 1.0
    return equations.evaluate(evaluation.x if solved else x), solved, n


def prox_round(equations: StepEquations, evaluation: Evaluation, patient: bool = False) -> tuple[np.ndarray, IndexSets]:
    """Multipliers from the three contact problems, then a, U and Q that go with them.

    Args:
        equations: of the step.
        evaluation: of the last iterate.
        patient: as in `proximal_newton`.

    Returns:
        The next iterate, and the index sets of the three problems.
    """
    sub, layout = equations.sub, equations.layout
    k, m, o, j, c = sub.k, sub.m, sub.of_F, sub.k + sub.m, layout.constraints.start
    lower, upper = equations.system.joint_friction.bounds
    # what the residuals of a, U and Q do to gaps, velocities and accelerations
    y = evaluation.y + equations.response(evaluation)
    G, held = equations.delassus(evaluation)
    kappa, P, la = equations.row_forces(evaluation)
    slipped, slipped_a = (_holds_sets(equations) & (x[:k] > 0.0) & _at_bound(sub, x) for x in (P, la))
    velocities = FreeProblem(held, y[layout.at_v] - held @ P, c)
    accelerations = FreeProblem(held, y[layout.at_a] - held @ la, c)
    # on position level friction has no equation of its own, but it shifts the gaps
    rows = np.concatenate((np.arange(j), np.arange(c, c + layout.kb)))
    positions = np.zeros(len(rows))
    positions[np.concatenate((np.arange(k), np.arange(j, len(rows))))] = y[layout.at_g]
    gaps = FreeProblem(G[np.ix_(rows, rows)], positions - G[np.ix_(rows, rows)] @ kappa, j)

    kappa_hat, bounds = kappa[:k], equations.friction_bounds
    share = np.zeros(m)
    # friction shifts the gaps, and only contacts that close have friction
    for _ in range(2 if equations.displaces else 1):
        if equations.displaces:
            touches = (kappa_hat > 0.0) if kappa_hat.any() else gaps.b[:k] <= 0.0
            P_c = _forces(velocities, sub, touches, np.zeros(m), bounds, P, slipped, patient)  # (131), (137)
            share = np.where(P_c[:k] > 0.0, 1.0 / np.where(P_c[:k] > 0.0, P_c[:k], 1.0), 0.0)[o] * P_c[k:j]
        G_gap = gaps.G[:k, :k]
        if equations.displaces and not equations.paper:
            G_gap = G_gap + gaps.G[:k, k:] @ (sub.to_contact * share[:, None])
        kappa_hat, _, _ = solve_contact_problem(
            G_gap, gaps.b[:k], np.zeros(k), o[:0], np.maximum(kappa_hat, 0.0), SWEEP_TOL, MAX_SWEEPS
        )  # (128)
    if not equations.displaces:
        P_c = _forces(velocities, sub, kappa_hat > 0.0, np.zeros(m), bounds, P, slipped, patient)

    closed = P_c[:k] > 0.0
    on_cone = closed & _at_bound(sub, P_c)
    slip = np.where(on_cone[o], (velocities.b + velocities.G @ P_c)[k:j], 0.0)
    # a joint that slips has the torque at its bound, whichever way it accelerates
    of_torques = np.where(P_c[j:] >= bounds[1], upper, lower), np.where(P_c[j:] <= bounds[0], lower, upper)
    la_c = _forces(
        accelerations, sub, closed & equations.accelerates, slip, of_torques, la, slipped_a, patient
    )  # (134), (140)
    pulls = la_c[:k] > 0.0
    stick = closed & ~(on_cone & _moves(velocities, sub, P_c))
    stick_a = stick & pulls & ~(_at_bound(sub, la_c) & _moves(accelerations, sub, la_c))
    sets = IndexSets((kappa_hat > 0.0) | closed, closed, pulls, stick, stick_a)
    kappa_c = np.concatenate((kappa_hat, share * kappa_hat[o]))
    forces = (
        np.concatenate((kappa_c, gaps.constraint_forces(kappa_c))),
        np.concatenate((P_c, velocities.constraint_forces(P_c))),
        np.concatenate((la_c, accelerations.constraint_forces(la_c))),
    )
    return equations.with_forces(evaluation, *forces), sets


def _at_bound(sub: Subset, P: np.ndarray) -> np.ndarray:
    """Contacts whose friction is on the edge of its cone, shape (k,)."""
    k, o = sub.k, sub.of_F
    return np.asarray(np.sqrt(np.bincount(o, P[k : k + sub.m] ** 2, k)) >= sub.mu * P[:k] * (1 - 1e-9))


def _moves(problem: FreeProblem, sub: Subset, P: np.ndarray, still: float = STILL) -> np.ndarray:
    """Contacts that slip, or start to, by more than a part of the largest velocity, shape (k,)."""
    k, largest = sub.k, max(float(np.abs(problem.b).max(initial=0.0)), 1e-300)
    y = (problem.b + problem.G @ P)[k : k + sub.m]
    return np.asarray(np.sqrt(np.bincount(sub.of_F, y * y, k)) > still * largest)


def _forces(
    problem: FreeProblem,
    sub: Subset,
    touches: np.ndarray,
    slip: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    guess: np.ndarray,
    slipped: np.ndarray,
    patient: bool,
) -> np.ndarray:
    """Percussions from velocities, or forces from accelerations.

    Where directions are dependent, sweeps end at the edge of the friction cones although forces inside of them do as
    well, and rounding would decide between stick and slip. With a little less friction such contacts end inside; those
    that slip with that, or are known to have slipped, get all of it.
    """
    G, b, k, o = problem.G, problem.b, sub.k, sub.of_F
    # forces of many contacts change little from step to step
    P = guess[: len(b)] if k > FEW else np.zeros(len(b))
    sweeps = JOINT_SWEEPS if len(bounds[0]) else MAX_SWEEPS + (SWEEPS_PER_ROW * len(b) if k > FEW else 0)
    slips = slipped | (np.bincount(o, slip * slip, k) > 0.0)
    rows = np.flatnonzero(np.concatenate((touches, touches[o])))
    root = np.sqrt(np.maximum(G[rows, rows], 1e-300))
    few = len(rows) <= RANKED
    if few and np.linalg.matrix_rank(G[np.ix_(rows, rows)] / np.outer(root, root), DEPENDENT, hermitian=True) == len(
        rows
    ):
        slips = np.ones(k, dtype=bool)
    for _ in range(HELD_ROUNDS):
        mu = np.where(slips, sub.mu, HELD_BACK * sub.mu)
        P, converged = forces_of_closed_contacts(G, b, mu, o, touches, slip, SWEEP_TOL, sweeps, bounds, P, patient)
        moves = touches & (P[:k] > 0.0) & _moves(problem, sub, P, STILL if converged else STILL_ROUGHLY)
        if not (moves & ~slips & (sub.mu > 0.0)).any():
            break
        slips = slips | moves
    return P
