"""One-level frictional contact problem: Signorini and Coulomb laws on y = b + G P, by Gauss-Seidel prox sweeps."""

from __future__ import annotations

import numpy as np

from .prox import prox_ball

MAX_SWEEPS = 5000
# sweeps before Newton's method is tried on what they have found, and again after this many times as many
BEFORE_NEWTON, AGAIN = 20, 4
NEWTON_STEPS = 12
# keeps the Newton matrix regular where directions are dependent, relative to its diagonal
REGULAR = 1e-10
EDGE = 1 + 1e-9
RCOND = 1e-12
VANISHES = 1e-10  # inverse mass of a constraint, relative to the largest, below which its scale stays as it is
# growth of the changes from the first sweep on that no problem with a solution shows
DIVERGES = 1e6
NO_BOUNDS = (np.zeros(0), np.zeros(0))


class FreeProblem:
    """A problem y = b + G P without its constraints: their forces are eliminated, where dependent by the smallest ones.

    Args:
        G: Delassus matrix of all rows, constraints last, shape (n, n).
        b: y without forces, shape (n,).
        n_c: rows before the constraints.

    Attributes:
        G, b: of those rows alone, shapes (n_c, n_c) and (n_c,).
    """

    def __init__(self, G: np.ndarray, b: np.ndarray, n_c: int):
        self.G, self.b = G[:n_c, :n_c], b[:n_c]
        self._coupling, self._b_b = G[n_c:, :n_c], b[n_c:]
        if len(self._b_b):
            # rows have different units: scale them before deciding which directions are dependent; a row that vanishes
            # in a singular position is not blown up
            diagonal = G.diagonal()[n_c:]
            root = np.sqrt(np.maximum(diagonal, max(VANISHES * diagonal.max(), 1e-300)))
            self._inverse = np.linalg.pinv(G[n_c:, n_c:] / np.outer(root, root), RCOND, hermitian=True)
            self._inverse /= np.outer(root, root)
            back = G[:n_c, n_c:] @ self._inverse
            self.G, self.b = self.G - back @ self._coupling, self.b - back @ self._b_b

    def constraint_forces(self, P: np.ndarray) -> np.ndarray:
        """Forces of the constraints for given forces of the other rows."""
        if not len(self._b_b):
            return np.zeros(0)
        return -self._inverse @ (self._b_b + self._coupling @ P)


def solve_contact_problem(
    G: np.ndarray,
    b: np.ndarray,
    mu: np.ndarray,
    of_F: np.ndarray,
    P: np.ndarray,
    tol: float = 1e-13,
    max_sweeps: int = MAX_SWEEPS,
    bounds: tuple[np.ndarray, np.ndarray] = NO_BOUNDS,
) -> tuple[np.ndarray, bool, int]:
    """Find P that fulfils Signorini's and Coulomb's laws, by sweeps and by Newton's method from where they have got.

    0 <= y_N, P_N >= 0, y_N P_N = 0 (41) and y_F in the normal cone of C_F(P_N) at -P_F (47).

    Args:
        G: Delassus matrix W^T M^-1 W, normal rows first, then friction, then joint friction, shape (n, n) [1/kg].
        b: velocity without percussions, shape (n,) [m/s]; or the same one level up.
        mu: friction coefficients, shape (k,).
        of_F: contact of each friction row, shape (m,).
        P: first guess, shape (n,) [N s].
        tol: change of the percussions in one sweep, relative to the largest one.
        max_sweeps: limit of their number.
        bounds: lower and upper bounds of joint friction, shape (f,) each.

    Returns:
        P, whether the sweeps have converged, and their number.
    """
    k = len(mu)
    P = P.copy()
    y = b + G @ P
    diagonal = np.maximum(G.diagonal(), 1e-300)
    rows = [k + np.flatnonzero(of_F == j) for j in range(k)]
    root = np.sqrt(diagonal)
    newton_at = BEFORE_NEWTON
    for sweep in range(1, max_sweeps + 1):
        change = 0.0
        for j in range(k):
            new = max(0.0, P[j] - y[j] / diagonal[j])  # (131)
            step = new - P[j]
            if step != 0.0:
                y += G[:, j] * step
                P[j] = new
                change = max(change, abs(step) * root[j])
            f = rows[j]
            if len(f):
                r = 1.0 / diagonal[f].max()
                moved = prox_ball(P[f] - r * y[f], mu[j] * P[j]) - P[f]  # (137)
                if moved.any():
                    y += G[:, f] @ moved
                    P[f] += moved
                    change = max(change, float(np.abs(moved * root[f]).max()))
        for i, (lower, upper) in enumerate(zip(*bounds, strict=True), k + len(of_F)):
            step = min(max(P[i] - y[i] / diagonal[i], lower), upper) - P[i]
            if step != 0.0:
                y += G[:, i] * step
                P[i] += step
                change = max(change, abs(step) * root[i])
        if sweep == 1:
            first = change
        elif change > DIVERGES * first:  # slip with much friction may have no solution
            return P, False, sweep
        if change <= tol * max(float(np.abs(P * root).max(initial=0.0)), 1e-300):
            return P, True, sweep
        if sweep == newton_at and not len(bounds[0]):
            newton_at *= AGAIN
            found = _newton(G, b, mu, of_F, P, max(tol, 1e-13))
            if found is not None:
                return found, True, sweep
    return P, False, max_sweeps


def _newton(
    G: np.ndarray, b: np.ndarray, mu: np.ndarray, of_F: np.ndarray, P: np.ndarray, tol: float
) -> np.ndarray | None:
    """Semi-smooth Newton on the laws (128)-(142) of one level from a good guess, or None where it does not converge."""
    k, m = len(mu), len(of_F)
    every = np.arange(m)
    diagonal = np.maximum(G.diagonal(), 1e-300)
    size_F = np.full(k, 1e-300)
    np.maximum.at(size_F, of_F, diagonal[k:])
    scale = np.concatenate((diagonal[:k], size_F[of_F]))
    for _ in range(NEWTON_STEPS):
        y = b + G @ P
        trial = P - y / scale
        closed = trial[:k] > 0.0
        radius = (mu * np.maximum(P[:k], 0.0))[of_F]
        d = trial[k:]
        norm = np.maximum(np.sqrt(np.bincount(of_F, d * d, k)), 1e-300)[of_F]
        slips = closed[of_F] & (norm > EDGE * radius)
        kinematic = np.concatenate((closed, closed[of_F] & ~slips))
        unit = d / norm
        R = np.where(kinematic, y / scale, P)
        R[k:][slips] = (P[k:] - radius * unit)[slips]
        if np.abs(R * np.sqrt(scale)).max(initial=0.0) <= tol * max(
            np.abs(P * np.sqrt(scale)).max(initial=0.0), 1e-300
        ):
            return P
        Gs = G / scale[:, None]
        J = np.where(kinematic[:, None], Gs, np.eye(k + m))
        J[np.arange(k + m), np.arange(k + m)] += REGULAR * kinematic
        if slips.any():
            turning = (every[:, None] == every) - unit[:, None] * unit * (of_F[:, None] == of_F)
            moved = np.eye(k + m)[k:] - Gs[k:]
            rows = np.eye(k + m)[k:] - (radius / norm)[:, None] * (turning @ moved)
            rows[every, of_F] -= mu[of_F] * unit
            J[k:][slips] = rows[slips]
        try:
            P = P - np.linalg.solve(J, R)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(P).all():
            return None
    return None


def forces_of_closed_contacts(
    G: np.ndarray,
    b: np.ndarray,
    mu: np.ndarray,
    of_F: np.ndarray,
    closed: np.ndarray,
    slip: np.ndarray,
    tol: float = 1e-13,
    max_sweeps: int = MAX_SWEEPS,
    bounds: tuple[np.ndarray, np.ndarray] = NO_BOUNDS,
) -> tuple[np.ndarray, bool]:
    """Contact forces from accelerations: sticking or just starting to slip, or slipping in a known direction (140).

    Args:
        G: Delassus matrix, normal rows first, then friction, then joint friction, shape (n, n) [1/kg].
        b: accelerations without contact forces, shape (n,) [m/s^2].
        mu: friction coefficients, shape (k,).
        of_F: contact of each friction row, shape (m,).
        closed: contacts that may carry a force, shape (k,).
        slip: slip velocity, zero where the contact sticks, shape (m,) [m/s].
        tol: as in `solve_contact_problem`.
        max_sweeps: likewise.
        bounds: likewise.

    Returns:
        la_N, la_F and the torques of joint friction, shape (n,) [N], and whether the sweeps have converged; slip with
        much friction may have no solution.
    """
    k, j = len(mu), len(mu) + len(of_F)
    speed = np.sqrt(np.bincount(of_F, slip * slip, k))
    slips = closed & (speed > 0.0)
    # the friction of a slipping contact is tied to its normal force (120): fewer unknowns, along another direction
    C = np.eye(len(b))
    i = np.flatnonzero(slips[of_F])
    C[k + i, of_F[i]] = -mu[of_F[i]] * slip[i] / speed[of_F[i]]
    sticks = closed[of_F] & ~slips[of_F]
    free = np.concatenate((np.flatnonzero(closed), k + np.flatnonzero(sticks), np.arange(j, len(b))))
    place = np.cumsum(closed) - 1
    G_free = G[free] @ C[:, free]
    mu_free, of_free = mu[closed], place[of_F[sticks]]
    start = np.zeros(len(free))
    la, converged, _ = solve_contact_problem(G_free, b[free], mu_free, of_free, start, tol, max_sweeps, bounds)
    return C[:, free] @ la, converged and bool(np.isfinite(la).all())
