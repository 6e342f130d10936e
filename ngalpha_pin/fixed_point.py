"""Fixed-point iterations (146) on the linearised step, contact by contact, for where the Newton matrix is of no use.

The paper sweeps over all contacts with one prox parameter and evaluates the system in every sweep. Here the sweeps run on
the small linear model y = y0 + H dz of the gaps, velocities and accelerations, Gauss-Seidel fashion with r = 1 / H_kk;
an outer loop evaluates the system again, and a short Newton run from there accepts the solution.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .newton import semi_smooth_newton
from .prox import prox_ball

if TYPE_CHECKING:
    from .step_equations import Evaluation, StepEquations

MAX_ROUNDS = 25
MAX_SWEEPS = 2000
NEWTON_CHECK = 8


def fixed_point(equations: StepEquations, evaluation: Evaluation) -> tuple[Evaluation, bool, int]:
    """Solve R(x) = 0 from an evaluated iterate.

    Returns:
        The last evaluation, whether it meets the tolerance, the number of rounds and Newton corrections.
    """
    n_iter = 0
    for _ in range(MAX_ROUNDS):
        if evaluation.error <= 1.0 or not np.isfinite(evaluation.error):
            break
        Z, H = equations.linearise(evaluation)
        dz = prox_sweeps(equations, evaluation, H)
        proposal = evaluation.x + np.concatenate((Z[:, :-1] @ dz + Z[:, -1], dz))
        evaluation = equations.evaluate(proposal)
        checked, converged, n, _ = semi_smooth_newton(equations, evaluation, NEWTON_CHECK)
        n_iter += n + 1
        if converged:
            return checked, True, n_iter
    return evaluation, evaluation.error <= 1.0, n_iter


def prox_sweeps(equations: StepEquations, evaluation: Evaluation, H: np.ndarray) -> np.ndarray:
    """Gauss-Seidel prox iterations on y = y0 + H dz with the laws (128), (131), (134), (137), (140).

    Args:
        equations: the step, for its subset and quadrature weights.
        evaluation: where the linear model was made.
        H: model, shape (n, n + 1); the last column is the change of y that the residuals ask for.

    Returns:
        The change of the multipliers, shape (n,).
    """
    sub, k, m, o = equations.sub, equations.sub.k, equations.sub.m, equations.sub.of_F
    z0 = evaluation.z
    y = np.concatenate((evaluation.rows.g_N, evaluation.xi[:k], evaluation.rows.acceleration[:k],
                        evaluation.xi[k:], evaluation.rows.acceleration[k:])) + H[:, -1]  # fmt: skip
    dz = np.zeros(3 * k + 2 * m)
    kappa, P_N, la_N = z0.kappa_hat_N.copy(), z0.P_N.copy(), z0.la_N.copy()
    P_F, la_F = z0.P_F.copy(), z0.la_F.copy()
    gamma_c, beta_c = equations.gamma_c, equations.beta_c
    diagonal = np.maximum(H.diagonal(), 1e-300)
    rows_of = [np.flatnonzero(o == j) for j in range(k)]
    scale = 1.0 / equations.column_scale

    def shift(j: int | np.ndarray, change: float | np.ndarray) -> None:
        nonlocal y
        dz[j] += change
        y += H[:, j] * change if np.isscalar(change) else H[:, j] @ change

    for _ in range(MAX_SWEEPS):
        before = dz.copy()
        for j in range(k):
            # normal laws on the three levels; a change of la_N moves P_N and kappa_hat_N with it
            new = max(0.0, kappa[j] - y[j] / diagonal[j])
            shift(j, new - kappa[j])
            kappa[j] = new
            A = new > 0.0
            new = max(0.0, P_N[j] - y[k + j] / diagonal[k + j]) if A else 0.0
            shift(k + j, new - P_N[j])
            P_N[j] = new
            new = max(0.0, la_N[j] - y[2 * k + j] / diagonal[2 * k + j]) if A and P_N[j] > 0.0 else 0.0
            change = new - la_N[j]
            shift(2 * k + j, change)
            shift(k + j, -gamma_c * change)
            shift(j, -beta_c * change)
            la_N[j] = new
            f = rows_of[j]
            if len(f):
                _friction(sub, j, f, 3 * k, m, y, diagonal, A, P_N, la_N, P_F, la_F, gamma_c, shift)
        if np.abs((dz - before) * scale).max() <= 1e-12 * max(np.abs(dz * scale).max(), 1e-300):
            break
    return dz


def _friction(sub, j, f, first, m, y, diagonal, A, P_N, la_N, P_F, la_F, gamma_c, shift) -> None:  # noqa: ANN001
    """Friction laws (137), (140) of contact j with the rows f."""
    La, la, mu = first + f, first + m + f, sub.mu[j]
    r, r_a = 1.0 / diagonal[La].max(), 1.0 / diagonal[la].max()
    trial = P_F[f] - r * y[La]
    new = prox_ball(trial, mu * P_N[j]) if A else np.zeros(len(f))
    slips = A and float(np.sqrt(trial @ trial)) > mu * P_N[j]
    shift(La, new - P_F[f])
    P_F[f] = new
    if not A:
        new = np.zeros(len(f))
    elif slips:
        new = mu * la_N[j] * trial / max(float(np.sqrt(trial @ trial)), 1e-300)
    else:
        new = prox_ball(la_F[f] - r_a * y[la], mu * la_N[j])
    change = new - la_F[f]
    shift(la, change)
    shift(La, -gamma_c * change)
    la_F[f] = new
