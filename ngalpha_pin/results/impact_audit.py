"""The judge of located impacts: balance of momentum and the impact laws (43)-(49), from arrays alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import CLOSED, TINY
from ngalpha_pin.numerics.block_matrix import solve_positive
from ngalpha_pin.numerics.prox import prox_ball
from ngalpha_pin.numerics.two_phases import coupled

if TYPE_CHECKING:
    from ngalpha_pin.contact.table import Subset
    from ngalpha_pin.results.recorded import Recorded
    from ngalpha_pin.results.records import Impacts
    from ngalpha_pin.system.system import System


GAP = 1e-9  # gap that is none, in parts of the yardstick of the contact
SMALL = 1e-9  # part of the velocity below which a jump is rounding


class ImpactLaws(NamedTuple):
    """The located impacts, j of them, of k contacts with m friction rows.

    Attributes:
        residual: of the balance of momentum and of the laws (43)-(49), in parts of the velocity jump in kinetic
            scaling, shape (j,) [-].
        step: number of the recorded time at the end of their step, shape (j,).
        P: percussions, normals first, shape (j, k + m) [N s].
        before, after: g_N_dot and gamma_F on the two sides, shape (j, k + m) [m/s].
        work: of the percussions, without what surfaces do that move along themselves, shape (j, k + m) [J].
        surface_rate: the part of both rates that these surfaces make, shape (j, k + m) [m/s].
        kinetic: energy before, shape (j,) [J].
        gain: of energy, without the work of moving surfaces and of constraints that are given as functions of time;
            nothing is said of an impact whose constraint forces are not known, shape (j,) [J].
        allowed: gain that the laws allow: P (gamma+ + gamma-) / 2 with (43) and (47) is at most
            (1 - e_N) P_N g_N_dot- / 2 + (1 - e_F) P_F gamma_F- / 2, without it where an impact has two phases,
            shape (j,) [J].
        touched: contacts that touched in the step that ends at a time, shape (n + 1, k).
    """

    residual: np.ndarray
    step: np.ndarray
    P: np.ndarray
    before: np.ndarray
    after: np.ndarray
    work: np.ndarray
    surface_rate: np.ndarray
    kinetic: np.ndarray
    gain: np.ndarray
    allowed: np.ndarray
    touched: np.ndarray


def judge_impacts(trajectory: Recorded, impacts: Impacts | None = None) -> ImpactLaws:
    """Residuals and energies of all located impacts, or of some others."""
    impacts = trajectory.impacts if impacts is None else impacts
    system, j = trajectory.system, len(impacts.t)
    sub = system.contacts.subset(trajectory.contact_columns)
    gap = GAP * system.contacts.yardstick[trajectory.contact_columns]
    rows, step = sub.k + sub.m, impacts.step
    P = np.hstack((impacts.P_N, impacts.P_F))
    before, after, work, surface_rate = np.zeros((4, j, rows))
    residual, kinetic, gain, allowed = np.zeros((4, j))
    touched = np.zeros(trajectory.P_N.shape, dtype=bool)
    found = ImpactLaws(residual, step, P, before, after, work, surface_rate, kinetic, gain, allowed, touched)
    for x, i in enumerate(step.tolist()):
        closed = _judge(system, impacts, sub, gap, x, found)
        found.touched[i] |= closed | (trajectory.g_N[i - 1] <= gap)
    return found


def _judge(system: System, impacts: Impacts, sub: Subset, gap: np.ndarray, x: int, found: ImpactLaws) -> np.ndarray:
    """Fill in one impact; the contacts that touch there."""
    q, v, jump = impacts.q[x], impacts.v_before[x], impacts.v_after[x] - impacts.v_before[x]
    t, still, P = float(impacts.t[x]), np.zeros_like(v), found.P[x]
    M = system.dynamics(t, q, v, still).M.copy()
    system.slots.restore_one(impacts.slots, impacts.slot_ends, x)
    rows = system.contact_rows(sub, q, v, still, t)
    W = system.coordinate_rows(rows.W)
    found.before[x], found.after[x] = rows.rate, rows.rate + W @ jump
    mean = v + jump / 2
    driven = found.surface_rate[x] = rows.surface_rate
    found.work[x], found.kinetic[x] = P * (W @ mean + driven), 0.5 * (M @ v) @ v
    found.gain[x] = (M @ jump) @ mean + P @ driven
    e = sub.restitution(rows.rate)
    closed = (rows.g_N <= gap) & ~system.contacts.soft[sub.index]
    touches = closed.copy()
    # another contact may be about to close: it takes part in its own impact
    closed &= (impacts.P_N[x] != 0.0) | (rows.g_N <= CLOSED * system.contacts.yardstick[sub.index])
    phases = sub.in_phases & closed
    if phases.any():
        W_all = np.vstack((W[closed[sub.of_row]], _constraint_directions(system, t, q, v)))
        phases[closed] = coupled(W_all @ solve_positive(M, W_all.T), _of_row(sub, closed), phases[closed])
    found.allowed[x] = 0.5 * ((1.0 - e) * np.where(phases[sub.of_row], 0.0, P)) @ rows.rate
    if not (P.any() or jump.any()):
        return touches  # two parts of a step meet without an impact
    # a jump that is itself rounding is judged by the motion
    unit = max(float(np.sqrt(jump @ (M @ jump))), SMALL * float(np.sqrt(2.0 * found.kinetic[x])), TINY)
    root = _roots(sub, np.einsum("ij,ji->i", W, solve_positive(M, W.T)))
    xi = rows.rate * (1.0 + e) + W @ jump  # (44), (48)
    mu = sub.cones.coefficients(found.after[x][sub.k :])[0]
    worst = max(
        _residual_of_phases(sub, phases, found.after[x] / root, P * root, root),
        _residual(sub, mu, closed, xi / root, P * root, root, phases),
    )
    lost, P_b = M @ jump - W.T @ P, impacts.P_b[x]
    if len(P_b) != len(system.constraints.names) or any(own.stands_in for own in system.scene.unilaterals):
        found.residual[x], found.gain[x] = worst / unit, 0.0  # a loaded run does not have its constraints
        return touches
    if len(P_b):
        constraints = system.constraint_rows(t, q, v, still)
        W_b = system.coordinate_rows(constraints.W)
        G = np.einsum("ij,ji->i", W_b, solve_positive(M, W_b.T))
        after = (constraints.rate + W_b @ jump) / np.sqrt(G)
        found.gain[x] -= P_b @ (W_b @ mean)
        lost, worst = lost - W_b.T @ P_b, max(worst, float(np.abs(after).max()))
    found.residual[x] = max(worst, float(np.sqrt(lost @ solve_positive(M, lost)))) / unit
    return touches


def _constraint_directions(system: System, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Generalized directions of the constraint forces, shape (rows, nv)."""
    if not system.constraints.names:
        return np.zeros((0, len(v)))
    return system.coordinate_rows(system.constraint_rows(t, q, v, np.zeros_like(v)).W)


def _of_row(sub: Subset, chosen: np.ndarray) -> np.ndarray:
    """Contact, among those chosen, of each of their rows."""
    return (np.cumsum(chosen) - 1)[sub.of_row[chosen[sub.of_row]]]


def _roots(sub: Subset, G: np.ndarray) -> np.ndarray:
    """Square roots of the inverse masses of the rows, one for all friction rows of a cone, shape (k + m,).

    Rows that nothing moves, of bodies in line, count with one: their percussions and velocities are zero.
    """
    G_F = np.zeros(sub.cones.c)
    np.maximum.at(G_F, sub.cones.of_row, G[sub.k :])
    G = np.concatenate((G[: sub.k], G_F[sub.cones.of_row]))
    return np.sqrt(np.where(G > 0.0, G, 1.0))


def _residual(
    sub: Subset,
    mu: np.ndarray,
    closed: np.ndarray,
    y: np.ndarray,
    P: np.ndarray,
    root: np.ndarray,
    but: np.ndarray,
) -> float:
    """Largest distance of P from the projection of P - y onto what the laws allow (43), (47), all of one unit."""
    k, worst = sub.k, 0.0
    for cone, j in enumerate(sub.cones.contact.tolist()):
        if but[j]:
            continue
        f = k + np.flatnonzero(sub.cones.of_row == cone)
        if not closed[j]:
            worst = max(worst, abs(P[j]), float(np.abs(P[f]).max(initial=0.0)))
            continue
        worst = max(worst, abs(P[j] - max(0.0, P[j] - y[j])))
        if len(f):
            bound = mu[cone] * max(0.0, P[j]) * root[f[0]] / root[j]
            worst = max(worst, float(np.abs(P[f] - prox_ball(P[f] - y[f], bound)).max()))
    return worst


def _residual_of_phases(sub: Subset, phases: np.ndarray, after: np.ndarray, P: np.ndarray, root: np.ndarray) -> float:
    """Largest approach after an impact of compression and expansion, percussion that pulls, and friction too large.

    Friction follows the slip through the impact: its sum lies in the cone of the static coefficient, that of rolling
    resistance within its own.
    """
    struck, worst = phases & (P[: sub.k] != 0.0), float(-P[: sub.k][phases].min(initial=0.0))
    worst = max(worst, float(-after[: sub.k][struck].min(initial=0.0)))
    for cone, j in enumerate(sub.cones.contact.tolist()):
        f = sub.k + np.flatnonzero(sub.cones.of_row == cone)
        if phases[j] and len(f):
            bound = sub.cones.mu[cone] * max(0.0, P[j]) * root[f[0]] / root[j]
            worst = max(worst, float(np.linalg.norm(P[f])) - bound)
    return worst
