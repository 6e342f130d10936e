"""The Newton matrix of one step, reduced to the multipliers, and its correction.

Compiled twin: engine/kernel/newton.c.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dgesv

from ngalpha_pin.numerics.block_matrix import Matrix, solve, solve_positive
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.friction_times import normal_displacement_slope
from ngalpha_pin.step.options import PAPER, LawOptions
from ngalpha_pin.step.protocol import Equations

# smallest pivot of the scaled Newton matrix, relative to the largest, at which its singular values are looked at: a
# direction that depends on others and nearly agrees with a row leaves two pivots, of which the product is rounding
SINGULAR = 1.5e-8
RCOND = 1e-10  # singular values below this are left out by the minimum-norm correction
ROLLS = 1e-2  # of a moment of rolling in the norm, see `_kept_last`


def linearise(equations: Equations, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
    """Response of the step to the multipliers.

    With S = M + gamma_c D + beta_c K T the blocks of a, U and Q are eliminated:
    da = S^-1 (W dla - R_a - D dU - K T dQ), dU = M^-1 (W dLa - R_U), dQ = M^-1 (W dkappa - R_Q).
    Derivatives of M and W by q, which enter multiplied by dt^2, are left out (see `differenced`).

    Returns:
        Z: (da, dU, dQ) per unit of each multiplier, in the last column what the residuals ask for, (3 nv, n + 1).
        H: change of y (see `contact.laws`) with the columns of Z, (n, n + 1).
    """
    layout, nv, n = equations.layout, equations.nv, equations.n
    M = ev.dynamics.M
    S, D, KT, T = stiffness(equations, ev)
    if n == 0:
        Z = np.zeros((3 * nv, 1))
        Z[:nv, 0] = -solve(S, ev.R[0])
        return Z, np.zeros((0, 1))
    W, rows = ev.W, layout.rows
    right = np.empty((nv, rows + 2))
    right[:, :rows], right[:, rows:] = W.T, ev.R[1:].T
    by_M = solve_positive(M, right)
    Z = np.zeros((3 * nv, n + 1))
    dU, dQ = Z[nv : 2 * nv], Z[2 * nv :]
    dU[:, layout.at_v] = by_M[:, :rows]
    dQ[:, :n] = by_M[:, :rows] @ displacements(equations, ev)
    dU[:, n], dQ[:, n] = -by_M[:, rows], -by_M[:, rows + 1]
    right = -(D @ dU) - KT @ dQ
    right[:, layout.at_a] += W.T
    right[:, n] -= ev.R[0]
    Z[:nv] = da = solve(S, right)
    X, Y = equations.system.row_derivatives(ev.parts, ev.v, ev.x[:nv])
    dv, dq = equations.gamma_c * da + dU, equations.beta_c * da + dQ
    if T is not None:
        dq = T @ dq
    H = np.empty((n, n + 1))
    H[layout.at_g] = W[layout.position_rows] @ dq
    H[layout.at_v] = W @ dv + X @ dq
    H[layout.at_a] = W @ da + Y @ dv
    add_compliance(equations, H)
    return Z, H


def add_compliance(equations: Equations, H: np.ndarray) -> None:
    """Add to H what the forces along tangents along which nothing moves change of y."""
    if equations.immovable is not None:
        Dz = force_derivative(equations, PAPER)  # its friction rows are the same with all laws
        for places in np.split(equations.sub.friction_places, 2):
            H[places] += equations.immovable.compliance @ Dz[places]


def displacements(equations: Equations, ev: Evaluation) -> np.ndarray:
    """Derivative of kappa, the forces on position level, by the multipliers, shape (rows, n)."""
    E = np.zeros((equations.layout.rows, equations.n))
    rows, columns, values = displacement_entries(equations, ev)
    E[rows, columns] = values
    return E


def displacement_entries(equations: Equations, ev: Evaluation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and values of its entries."""
    sub, k, m, layout = equations.sub, equations.sub.k, equations.sub.m, equations.layout
    row, at = np.arange(layout.rows), np.arange(equations.n)
    rows, columns = [row[layout.position_rows], row[layout.half_rows]], [at[layout.at_g], at[layout.half_v]]
    values = [np.ones(len(rows[0])), np.full(len(rows[1]), equations.dt / 2)]  # (80)
    if m:
        i, ratio, N = np.arange(m), ev.ratio[sub.of_F], sub.of_F
        rows.append(k + i)
        columns.append(2 * k + i)
        values.append(ratio)
        if ev.options.displaces and not ev.options.paper:
            # the time since impact moves with the normal multipliers, that of contacts that have carried does not
            i = np.flatnonzero(~equations.carried[sub.of_F])
            ratio, share, N = ratio[i], ev.share[i], N[i]
            rows += 4 * [k + i]
            columns += [3 * k + m + i, N, k + N, 2 * k + m + N]
            values += [
                ratio * equations.gamma_c - equations.beta_c,
                share,
                -ratio * share,
                (equations.beta_c - equations.gamma_c * ratio) * share,
            ]
    return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)


def stiffness(equations: Equations, ev: Evaluation) -> tuple[Matrix, Matrix, Matrix, Matrix | None]:
    """S = M + gamma_c D + beta_c K T, D, K T and T = d q1 / d dq; None stands for the identity."""
    T = equations.tangent(ev)
    M, K, D = ev.dynamics.M, ev.dynamics.K, ev.dynamics.D
    KT = K if T is None else K @ T
    return M + equations.gamma_c * D + equations.beta_c * KT, D, KT, T


def force_derivative(equations: Equations, options: LawOptions) -> np.ndarray:
    """Derivative of z by the multipliers, shape (n_c, n + 1)."""
    k, j, n = equations.sub.k, equations.sub.k + equations.sub.m, equations.n
    Dz = np.eye(equations.layout.n_c, n + 1)
    i = np.arange(j)
    Dz[k + i, k + j + i] = equations.gamma_c
    Dz[i[:k], k + j + i[:k]] = normal_displacement_slope(equations, options)
    return Dz


def jacobian(equations: Equations, ev: Evaluation, H: np.ndarray) -> np.ndarray:
    """Derivative of the residual of the laws by the multipliers, shape (n, n + 1); see `linearise`."""
    if ev.kinematic.all():
        return H
    n_c, layout = equations.layout.n_c, equations.layout
    J = H.copy()
    if n_c:
        J[:n_c] = ev.contact.jacobian(H[:n_c], force_derivative(equations, ev.options))
    if layout.f:
        both = slice(layout.friction_v.start, layout.friction_a.stop)
        J[both] = ev.friction.jacobian(H[both], both.start)
    return J


def correction(equations: Equations, ev: Evaluation, smallest_forces: bool) -> tuple[np.ndarray, bool]:
    """Newton correction dx (143), and whether directions were dependent so that the minimum norm was taken.

    The smallest change, so that forces that are not unique stay as they are from step to step; or the smallest forces.
    """
    Z, H = equations.linearise(ev)
    if equations.n == 0:
        return Z[:, 0], False
    n, J, row_scale = equations.n, jacobian(equations, ev, H), equations.scales.row
    if not ev.kinematic.all():
        row_scale = np.where(ev.kinematic, row_scale, 1.0 / equations.scales.column)
    A = J[:, :n] * row_scale[:, None] * equations.scales.column
    b = -(ev.law + J[:, n]) * row_scale
    lu, _, y, info = dgesv(A, b)
    pivots = np.abs(lu.diagonal())
    dependent = info != 0 or not pivots.min() > SINGULAR * pivots.max()
    if dependent:
        if not np.isfinite(A).all():
            return np.full(3 * equations.nv + n, np.nan), False
        z = smallest_forces * ev.x[3 * equations.nv :] / equations.scales.column
        last = _kept_last(equations)
        y, dependent = least_change(A * last, b, z / last)
        y *= last
    dz = y * equations.scales.column
    return np.concatenate((Z[:, :n] @ dz + Z[:, n], dz)), dependent


def _kept_last(equations: Equations) -> np.ndarray:
    """Weights of the multipliers, shape (n,): a change of another force is preferred to one of a moment of rolling.

    What rests on a face does not roll, and moments that shift its weight leave their cones.
    """
    k, j, weights = equations.sub.k, equations.sub.k + equations.sub.m, np.ones(equations.n)
    cones = equations.sub.cones
    if cones.rolls:
        rows = k + np.flatnonzero(cones.of_row >= k)
        weights[k + rows] = weights[k + j + rows] = ROLLS
    return weights


def least_change(A: np.ndarray, b: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, bool]:
    """The y of A y = b for which y + z is smallest, and whether singular values vanish, so that there are others."""
    y, _, rank, _ = np.linalg.lstsq(A, b + A @ z, rcond=RCOND)
    return y - z, bool(rank < len(b))
