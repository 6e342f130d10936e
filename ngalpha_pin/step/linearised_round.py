"""One round of the fixed-point iterations: the step linearised, its three contact problems solved one after the other.

To leading order in dt the three levels of the laws are three contact problems with the same Delassus matrix
G = W^T M^-1 W: the gaps with kappa_hat_N, the velocities with P, the accelerations with la.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.common.tolerances import CONE, STILL, TINY
from ngalpha_pin.contact.laws import IndexSets
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.engine import held_forces
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.numerics.even_forces import even_forces
from ngalpha_pin.numerics.gauss_seidel import FreeProblem, forces_of_closed_contacts, solve_contact_problem
from ngalpha_pin.numerics.proximal_newton import DENSE, ROUGHLY, Rows
from ngalpha_pin.step.crowd import CrowdEquations
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.system.regime import FEW, RANKED

# part of the tolerance of the step that a problem may leave where the result counts as it is
LEFT = 0.1
# friction that is held back at first, how often more contacts may turn out to slip with that, and the slip velocity
# that is none, in parts of the largest velocity, where the problem is not solved (`STILL` where it is)
HELD_BACK, HELD_ROUNDS, STILL_ROUGHLY = 0.98, 4, 1e-4
# Newton polishes what the sweeps leave
SWEEP_TOL, MAX_SWEEPS = 1e-11, 320
# joint friction is left to the sweeps alone
JOINT_SWEEPS = 5000
SWEEPS_PER_ROW = 1  # more sweeps for more contacts than a few: what one feels reaches the others in sweeps
DEPENDENT = 1e-10  # eigenvalue of the scaled Delassus matrix that is none


def prox_round(equations: StepEquations, evaluation: Evaluation, patient: bool = False) -> tuple[np.ndarray, IndexSets]:
    """Multipliers from the three contact problems, then a, U and Q that go with them.

    Args:
        equations: of the step.
        evaluation: of the last iterate.
        patient: as in `proximal_newton`.

    Returns:
        The next iterate, and the index sets of the three problems.
    """
    if isinstance(equations, CrowdEquations):
        return equations.round(evaluation)
    sub, laws = equations.sub, evaluation.options
    k, m, o, j, of = sub.k, sub.m, sub.of_F, sub.k + sub.m, sub.cones.contact
    lower, upper = equations.system.joint_friction.bounds
    velocities, accelerations, gaps, (kappa, P, la) = _problems(equations, evaluation)
    held_back = laws.slack is None
    tol = SWEEP_TOL if held_back else LEFT * equations.parameters.tol / ROUGHLY
    crowd = equations.regime.among_many_bodies
    slipped, slipped_a = (crowd & (x[:k] > 0.0)[of] & at_bound(sub, x) | (not held_back) for x in (P, la))

    kappa_hat, bounds = kappa[:k], equations.friction_bounds(laws)
    share = np.zeros(m)
    # friction shifts the gaps, and only contacts that close have friction
    for _ in range(2 if laws.displaces else 1):
        if laws.displaces:
            touches = (kappa_hat > 0.0) if kappa_hat.any() else gaps.b[:k] <= 0.0
            P_c = _forces(velocities, sub, touches, np.zeros(m), bounds, P, slipped, tol, patient)  # (131), (137)
            share = np.where(P_c[:k] > 0.0, 1.0 / np.where(P_c[:k] > 0.0, P_c[:k], 1.0), 0.0)[o] * P_c[k:j]
            share[equations.carried[o]] = 0.0
        G_gap = gaps.G[:k, :k]
        if laws.displaces and not laws.paper:
            G_gap = G_gap + gaps.G[:k, k:] @ (sub.to_contact * share[:, None])
        # of forces that are not unique, those that act for the same time, so that friction among them moves nothing
        guess = equations.dt / 2 * P_c[:k] if laws.displaces else kappa_hat
        kappa_hat, _, _ = solve_contact_problem(
            G_gap, gaps.b[:k], np.zeros(k), o[:0], np.maximum(guess, 0.0), SWEEP_TOL, MAX_SWEEPS, in_engine=True
        )  # (128)
    touches = kappa_hat > 0.0
    if not held_back:  # of the corners of a face some carry it, and the others touch as well
        touches |= gaps.b[:k] + G_gap @ kappa_hat <= equations.gap_tolerance
    if not laws.displaces:
        P_c = _forces(velocities, sub, touches, np.zeros(m), bounds, P, slipped, tol, patient)

    closed = P_c[:k] > 0.0
    on_cone = closed[of] & at_bound(sub, P_c)
    slip = np.where(on_cone[sub.cones.of_row], (velocities.b + velocities.G @ P_c)[k:j], 0.0)
    # a joint that slips has the torque at its bound, whichever way it accelerates
    of_torques = np.where(P_c[j:] >= bounds[1], upper, lower), np.where(P_c[j:] <= bounds[0], lower, upper)
    la_c = _forces(
        accelerations, sub, closed & laws.accelerates, slip, of_torques, la, slipped_a, tol, patient
    )  # (134), (140)
    pulls = la_c[:k] > 0.0
    stick = closed[of] & ~(on_cone & _moves(velocities, sub, P_c))
    stick_a = stick & pulls[of] & ~(at_bound(sub, la_c) & _moves(accelerations, sub, la_c))
    sets = IndexSets(touches | closed, closed, pulls, stick, stick_a)
    kappa_c = np.concatenate((kappa_hat, share * kappa_hat[o]))
    forces = (
        np.concatenate((kappa_c, gaps.constraint_forces(kappa_c))),
        np.concatenate((P_c, velocities.constraint_forces(P_c))),
        np.concatenate((la_c, accelerations.constraint_forces(la_c))),
    )
    return equations.with_forces(evaluation, *forces), sets


def at_bound(sub: Subset, P: np.ndarray) -> np.ndarray:
    """Cones on whose edge friction is, shape (c,)."""
    cones = sub.cones
    return np.asarray(cones.sizes(P[sub.k : sub.k + sub.m]) >= cones.mu * P[: sub.k][cones.contact] * (1 - CONE))


def _problems(
    equations: StepEquations, evaluation: Evaluation
) -> tuple[FreeProblem, FreeProblem, FreeProblem, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Velocities, accelerations and gaps as contact problems, and the forces on the three levels so far."""
    sub, layout = equations.sub, equations.layout
    k, j, c = sub.k, sub.k + sub.m, layout.constraints.start
    # what the residuals of a, U and Q do to gaps, velocities and accelerations
    y = evaluation.y + equations.response(evaluation)
    G, held = equations.delassus(evaluation)
    kappa, P, la = equations.row_forces(evaluation)
    velocities = FreeProblem(held, y[layout.at_v] - held @ P, c)
    accelerations = FreeProblem(held, y[layout.at_a] - held @ la, c)
    # on position level friction has no equation of its own, but it shifts the gaps
    rows = np.concatenate((np.arange(j), np.arange(c, c + layout.kb)))
    positions = np.zeros(len(rows))
    positions[np.concatenate((np.arange(k), np.arange(j, len(rows))))] = y[layout.at_g]
    gaps = FreeProblem(G[np.ix_(rows, rows)], positions - G[np.ix_(rows, rows)] @ kappa, j)
    return velocities, accelerations, gaps, (kappa, P, la)


def _moves(problem: FreeProblem, sub: Subset, P: np.ndarray, still: float = STILL) -> np.ndarray:
    """Cones that slip, or start to, by more than a part of the largest velocity, shape (c,)."""
    k, largest = sub.k, max(float(np.abs(problem.b).max(initial=0.0)), TINY)
    y = (problem.b + problem.G @ P)[k : k + sub.m]
    return np.asarray(sub.cones.sizes(y) > still * largest)


def _forces(
    problem: FreeProblem,
    sub: Subset,
    touches: np.ndarray,
    slip: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    guess: np.ndarray,
    slipped: np.ndarray,
    tol: float,
    patient: bool,
) -> np.ndarray:
    """Percussions from velocities, or forces from accelerations.

    Where directions are dependent, sweeps end at the edge of the friction cones although forces inside of them do as
    well, and rounding would decide between stick and slip. With a little less friction such contacts end inside; those
    that slip with that, or are known to have slipped, get all of it. All do where index sets are not asked for.
    """
    G, b, k, cones = problem.G, problem.b, sub.k, sub.cones
    rows = Rows(cones.mu, cones.of_row, bounds, cones.contact)
    # forces of many contacts change little from step to step
    P = guess[: len(b)] if k > FEW else np.zeros(len(b))
    sweeps = JOINT_SWEEPS if len(bounds[0]) else MAX_SWEEPS + (SWEEPS_PER_ROW * len(b) if k > FEW else 0)
    if kernel.library is not None and len(b) <= DENSE and not cones.rolls:
        laws = np.ascontiguousarray(G), np.ascontiguousarray(b), cones.mu, cones.of_row
        found, solved = held_forces(*laws, *bounds, touches, slip, P, slipped, tol, sweeps, patient)
        if solved is not None:
            return even_forces(G, b, rows, found, touches, slip) if solved and not slipped.all() else found
    slips = slipped | (cones.products(slip, slip) > 0.0)
    at = np.flatnonzero(np.concatenate((touches, touches[sub.of_F])))
    root = np.sqrt(np.maximum(G[at, at], TINY))
    few = len(at) <= RANKED and not slips.all()
    if few and np.linalg.matrix_rank(G[np.ix_(at, at)] / np.outer(root, root), DEPENDENT, hermitian=True) == len(at):
        slips = np.ones(cones.c, dtype=bool)
    for _ in range(HELD_ROUNDS):
        mu = np.where(slips, cones.mu, HELD_BACK * cones.mu)
        given = G, b, mu, cones.of_row, touches, slip, tol, sweeps, bounds, P, patient, cones.contact
        P, converged = forces_of_closed_contacts(*given)
        moves = (touches & (P[:k] > 0.0))[cones.contact] & _moves(
            problem, sub, P, STILL if converged else STILL_ROUGHLY
        )
        if not (moves & ~slips & (cones.mu > 0.0)).any():
            break
        slips = slips | moves
    return even_forces(G, b, rows, P, touches, slip) if converged and not slipped.all() else P
