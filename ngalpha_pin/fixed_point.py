"""Fixed-point iterations (146) on the linearised step, for where Newton's index sets run in circles.

The paper sweeps over all contacts with one prox parameter and evaluates the system in every sweep. To leading order in
dt the three levels of the laws are three contact problems with the same Delassus matrix G = W^T M^-1 W: the gaps with
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
SWEEP_TOL, MAX_SWEEPS = 1e-10, 320
# slip velocity that is none, in parts of the largest velocity, and how far inside of its cone such a force is put
STILL, INSIDE = 1e-8, 1 - 1e-5


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
    sub, k, m, o = equations.sub, equations.sub.k, equations.sub.m, equations.sub.of_F
    # what the residuals of a, U and Q do to gaps, velocities and accelerations
    y = evaluation.contact.y + equations.linearise(evaluation)[1][:, -1]
    kappa_hat, P, la = np.split(evaluation.z, (k, 2 * k + m))
    W = evaluation.rows.W
    G = W @ np.linalg.solve(evaluation.dynamics.M, W.T)
    gaps, xi, free = np.split(y, (k, 2 * k + m))
    gaps, xi, free = gaps - G[:k, :k] @ kappa_hat, xi - G @ P, free - G @ la
    if m and not equations.paper:
        gaps = gaps - G[:k, k:] @ (evaluation.ratio[o] * P[k:])

    for _ in range(2):  # friction shifts the gaps, and only contacts that close have friction
        touches = (kappa_hat > 0.0) if kappa_hat.any() else gaps <= 0.0
        P = forces_of_closed_contacts(G, xi, sub.mu, o, touches, np.zeros(m), SWEEP_TOL, MAX_SWEEPS)  # (131), (137)
        share = np.where(P[:k] > 0.0, 1.0 / np.where(P[:k] > 0.0, P[:k], 1.0), 0.0)[o] * P[k:]
        G_gap = G[:k, :k] if equations.paper else G[:k, :k] + G[:k, k:] @ (sub.to_contact * share[:, None])
        kappa_hat, _, _ = solve_contact_problem(
            G_gap, gaps, np.zeros(k), o[:0], np.maximum(kappa_hat, 0.0), SWEEP_TOL, MAX_SWEEPS
        )  # (128)

    closed = P[:k] > 0.0
    on_cone = closed & (np.sqrt(np.bincount(o, P[k:] ** 2, k)) >= sub.mu * P[:k] * (1 - 1e-9))
    xi_F = (xi + G @ P)[k:]
    # a force on the edge of its cone that goes with no slip is one of many: the edge would be taken for slip
    speed = np.sqrt(np.bincount(o, xi_F**2, k))
    still = on_cone & (speed <= STILL * max(float(np.abs(xi).max(initial=0.0)), 1e-300))
    P = np.concatenate((P[:k], P[k:] * np.where(still, INSIDE, 1.0)[o]))
    on_cone &= ~still
    slip = np.where(on_cone[o], xi_F, 0.0)
    la = forces_of_closed_contacts(G, free, sub.mu, o, closed, slip, SWEEP_TOL, MAX_SWEEPS)  # (134), (140)
    return equations.with_forces(evaluation, np.concatenate((kappa_hat, P, la))), (kappa_hat > 0.0) | closed
