"""The judge of located impacts: balance of momentum and the impact laws (43)-(49), from arrays alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ngalpha_pin.contact_solvers.prox import prox_ball
from ngalpha_pin.linalg.block_matrix import solve_positive
from ngalpha_pin.tolerances import CLOSED

if TYPE_CHECKING:
    from ngalpha_pin.contact.table import Subset
    from ngalpha_pin.results.trajectory import Trajectory


# part of the velocity below which a jump is rounding
SMALL = 1e-9


def judge_impacts(trajectory: Trajectory, gap: np.ndarray) -> tuple[float, np.ndarray]:
    """Residuals of all located impacts, and where a contact may have carried a percussion because it touched.

    Args:
        trajectory: the run.
        gap: a contact touches from this gap on, shape (n_contacts,) [m].

    Returns:
        The largest residual, in parts of the velocity jump in kinetic scaling [-], and which contacts touched in the
        steps that have a located impact, shape (n + 1, n_contacts).
    """
    system, impacts = trajectory.system, trajectory.impacts
    sub = system.contacts.subset(trajectory.contact_columns)
    touched = np.zeros(trajectory.P_N.shape, dtype=bool)
    worst = 0.0
    for j, i in enumerate(impacts.step):
        q, v, jump = impacts.q[j], impacts.v_before[j], impacts.v_after[j] - impacts.v_before[j]
        t, still = float(impacts.t[j]), np.zeros_like(v)
        M = system.dynamics(t, q, v, still).M.copy()
        system.slots.restore_one(impacts.slots, impacts.slot_ends, j)
        rows = system.contact_rows(sub, q, v, still)
        W = system.coordinate_rows(rows.W)
        closed = rows.g_N <= gap
        touched[i] |= closed | (trajectory.g_N[i - 1] <= gap)
        P = np.concatenate((impacts.P_N[j], impacts.P_F[j]))
        # another contact may be about to close: it takes part in its own impact
        closed &= (impacts.P_N[j] != 0.0) | (rows.g_N <= CLOSED * system.contacts.yardstick[sub.index])
        if not (P.any() or jump.any()):
            continue  # two parts of a step meet without an impact
        # a jump that is itself rounding is judged by the motion
        unit = max(float(np.sqrt(jump @ M @ jump)), SMALL * float(np.sqrt(v @ M @ v)), 1e-300)
        root = _roots(sub, np.einsum("ij,ji->i", W, solve_positive(M, W.T)))
        xi = rows.rate * (1.0 + sub.e) + W @ jump  # (44), (48)
        worst = max(worst, _residual(sub, closed, xi / root, P * root, root) / unit)
        lost, P_b = M @ jump - W.T @ P, impacts.P_b[j]
        if len(P_b):
            if len(P_b) != len(system.constraints.names):
                continue  # a loaded run does not have its constraints
            constraints = system.constraint_rows(t, q, v, still)
            W_b = system.coordinate_rows(constraints.W)
            G = np.einsum("ij,ji->i", W_b, solve_positive(M, W_b.T))
            after = (constraints.rate + W_b @ jump) / np.sqrt(G)
            lost, worst = lost - W_b.T @ P_b, max(worst, float(np.abs(after).max()) / unit)
        worst = max(worst, float(np.sqrt(lost @ solve_positive(M, lost))) / unit)
    return worst, touched


def _roots(sub: Subset, G: np.ndarray) -> np.ndarray:
    """Square roots of the inverse masses of the rows, one for all friction rows of a contact, shape (k + m,).

    Rows that nothing moves, of bodies in line, count with one: their percussions and velocities are zero.
    """
    G_F = np.zeros(sub.k)
    np.maximum.at(G_F, sub.of_F, G[sub.k :])
    G = np.concatenate((G[: sub.k], G_F[sub.of_F]))
    return np.sqrt(np.where(G > 0.0, G, 1.0))


def _residual(sub: Subset, closed: np.ndarray, y: np.ndarray, P: np.ndarray, root: np.ndarray) -> float:
    """Largest distance of P from the projection of P - y onto what the laws allow (43), (47), all of one unit."""
    k, worst = sub.k, 0.0
    for j in range(k):
        f = k + np.flatnonzero(sub.of_F == j)
        if not closed[j]:
            worst = max(worst, abs(P[j]), float(np.abs(P[f]).max(initial=0.0)))
            continue
        worst = max(worst, abs(P[j] - max(0.0, P[j] - y[j])))
        if len(f):
            bound = sub.mu[j] * max(0.0, P[j]) * root[f[0]] / root[j]
            worst = max(worst, float(np.abs(P[f] - prox_ball(P[f] - y[f], bound)).max()))
    return worst
