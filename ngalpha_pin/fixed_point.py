"""Fixed-point iterations (146) on the linearised step, for where Newton's index sets run in circles.

The paper sweeps over all contacts with one prox parameter and evaluates the system in every sweep. To leading order in dt
the three levels of the laws are three contact problems with the same Delassus matrix G = W^T M^-1 W: the gaps with
kappa_hat_N, the velocities with P, the accelerations with la. Here each is solved by Gauss-Seidel prox sweeps; an outer
loop evaluates the system again, and a short Newton run from there accepts the solution.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .contact_problem import forces_of_closed_contacts, solve_contact_problem
from .newton import semi_smooth_newton

if TYPE_CHECKING:
    from .step_equations import Evaluation, StepEquations

MAX_ROUNDS = 8
NEWTON_CHECK = 8
# Newton polishes what the sweeps leave
SWEEP_TOL, MAX_SWEEPS = 1e-8, 300


def fixed_point(equations: StepEquations, evaluation: Evaluation) -> tuple[Evaluation, bool, int]:
    """Solve R(x) = 0 from an evaluated iterate.

    Returns:
        The last evaluation, whether it meets the tolerance, the number of rounds and Newton corrections.
    """
    n_iter = 0
    for _ in range(MAX_ROUNDS):
        if evaluation.error <= 1.0 or not np.isfinite(evaluation.error):
            break
        evaluation = equations.evaluate(prox_round(equations, evaluation)[0])
        checked, converged, n, _ = semi_smooth_newton(equations, evaluation, NEWTON_CHECK)
        n_iter += n + 1
        if converged:
            return checked, True, n_iter
    return evaluation, evaluation.error <= 1.0, n_iter


def prox_round(equations: StepEquations, evaluation: Evaluation) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers from the three contact problems, then a, U and Q that go with them.

    Returns:
        The next iterate, and which contacts carry a percussion in it, shape (k,).
    """
    sub, k, m = equations.sub, equations.sub.k, equations.sub.m
    z, rows = evaluation.z, evaluation.rows
    change = equations.linearise(evaluation)[1][:, -1]  # what the residuals of a, U and Q do to gaps and velocities
    G = rows.W @ np.linalg.solve(evaluation.dynamics.M, rows.W.T)
    P, la = np.concatenate((z.P_N, z.P_F)), np.concatenate((z.la_N, z.la_F))
    gaps = rows.g_N + change[:k] - G[:k, :k] @ z.kappa_hat_N
    xi = evaluation.xi + np.concatenate((change[k : 2 * k], change[3 * k : 3 * k + m])) - G @ P
    free = rows.acceleration + np.concatenate((change[2 * k : 3 * k], change[3 * k + m :])) - G @ la
    if evaluation.ratio.any() and not equations.paper:
        gaps = gaps - G[:k, k:] @ (evaluation.ratio[sub.of_F] * z.P_F)

    kappa_hat = z.kappa_hat_N
    for _ in range(2):  # friction shifts the gaps, and only contacts that close have friction
        touches = (kappa_hat > 0.0) if kappa_hat.any() else gaps <= 0.0
        P = forces_of_closed_contacts(G, xi, sub.mu, sub.of_F, touches, np.zeros(m), SWEEP_TOL, MAX_SWEEPS)  # (131), (137)
        share = np.where(P[:k] > 0.0, 1.0 / np.where(P[:k] > 0.0, P[:k], 1.0), 0.0)[sub.of_F] * P[k:]
        G_gap = G[:k, :k] + G[:k, k:] @ (sub.to_contact * share[:, None])
        kappa_hat, _, _ = solve_contact_problem(
            G_gap, gaps, np.zeros(k), sub.of_F[:0], np.maximum(kappa_hat, 0.0), SWEEP_TOL, MAX_SWEEPS
        )  # (128)

    closed = P[:k] > 0.0
    on_cone = closed & (_norm(P[k:], sub.of_F, k) >= sub.mu * P[:k] * (1 - 1e-9))
    slip = np.where(on_cone[sub.of_F], (xi + G @ P)[k:], 0.0)
    la = forces_of_closed_contacts(G, free, sub.mu, sub.of_F, closed, slip, SWEEP_TOL, MAX_SWEEPS)  # (134), (140)
    carries = (kappa_hat > 0.0) | closed
    return equations.with_multipliers(evaluation, equations.impulses(kappa_hat, P, la)), carries


def _norm(x: np.ndarray, of_F: np.ndarray, k: int) -> np.ndarray:
    return np.sqrt(np.bincount(of_F, x * x, k))
