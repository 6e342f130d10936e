"""Semi-smooth Newton methods on the contact problem of one level: from a good guess, and from any.

Close to the solution Newton's method is exact in a few steps. Far from it, or where directions are nearly dependent,
its index sets change without end. The proximal point method holds the percussions near those of the round before, with
a mass rho at every contact: such a problem is regular, Newton solves it, and with rho falling from round to round the
solutions tend to one of the problem itself. Sweeps feel a chain of contacts, or nearly dependent directions, only
after a number of rounds that grows with the ratio of the eigenvalues of G.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array, eye_array, vstack
from scipy.sparse.linalg import splu

NEWTON_STEPS = 20
# keeps the Newton matrix regular where directions are dependent, relative to its diagonal
REGULAR = 1e-10
EDGE = 1 + 1e-9
DENSE = 300  # rows up to which dense matrices are faster
# of the proximal point method: rho at first, least and most, relative to the diagonal of G; its change; and rounds
FIRST, LEAST, MOST, FALLS, ROUNDS = 0.1, 1e-9, 1e2, 10.0, 40
ROUGHLY = 100.0  # times the tolerance: where rounding in nearly dependent directions is all that is left


NO_BOUNDS = (np.zeros(0), np.zeros(0))


class Rows(NamedTuple):
    """What the rows of a problem are: normal ones first, then friction, then joint friction.

    Attributes:
        mu: friction coefficients, shape (k,).
        of_F: contact of each friction row, shape (m,).
        bounds: lower and upper bounds of joint friction, shape (f,) each.
    """

    mu: np.ndarray
    of_F: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray] = NO_BOUNDS

    def scale(self, G: np.ndarray) -> np.ndarray:
        """Inverse mass of every row, one for all friction rows of a contact [1/kg]."""
        k, j = len(self.mu), len(self.mu) + len(self.of_F)
        diagonal = np.maximum(G.diagonal(), 1e-300)
        size_F = np.full(k, 1e-300)
        np.maximum.at(size_F, self.of_F, diagonal[k:j])
        return np.concatenate((diagonal[:k], size_F[self.of_F], diagonal[j:]))


def proximal_newton(G: np.ndarray, b: np.ndarray, rows: Rows, P: np.ndarray, tol: float) -> np.ndarray | None:
    """Solve the problem by `newton` on problems that are held near the solution of the one before, ever less.

    Args:
        G: Delassus matrix, shape (n, n) [1/kg].
        b: velocity without percussions, shape (n,) [m/s]; or the same one level up.
        rows: their laws.
        P: first guess, shape (n,) [N s].
        tol: of the residual, relative to the largest percussion.

    Returns:
        P, or None where it is not found.
    """
    scale, rho, best, nearest = rows.scale(G), FIRST, P, np.inf
    for _ in range(ROUNDS):
        held = rho * scale
        found = newton(G + np.diag(held), b - held * P, rows, P, tol)
        if found is None:
            rho = min(rho * FALLS, MOST)
            continue
        P = found
        error = _Laws(G, b, rows, scale, P).error
        if error < nearest:
            best, nearest = P, error
        if error <= tol:
            return P
        rho = max(rho / FALLS, LEAST)
    return best if nearest <= ROUGHLY * tol else None


def newton(G: np.ndarray, b: np.ndarray, rows: Rows, P: np.ndarray, tol: float) -> np.ndarray | None:
    """Semi-smooth Newton on the laws (128)-(142) of one level from a good guess, or None where it does not converge.

    Args are those of `proximal_newton`.
    """
    scale = rows.scale(G)
    found: np.ndarray | None = None
    for _ in range(NEWTON_STEPS):
        laws = _Laws(G, b, rows, scale, P)
        if laws.error <= tol:
            if found is not None:
                return P
            found = P  # one more step: what a small residual leaves open where masses are very different
        elif found is not None:
            return found
        P = P - (laws.dense_step() if len(b) <= DENSE else laws.sparse_step())
        if not np.isfinite(P).all():
            return found
    return found


class _Laws:
    """Residual of the laws at P and its Newton step.

    Args:
        G, b, rows, P: as in `proximal_newton`.
        scale: of the rows, see `Rows.scale`.

    Attributes:
        error: largest residual, relative to the largest percussion.
    """

    def __init__(self, G: np.ndarray, b: np.ndarray, rows: Rows, scale: np.ndarray, P: np.ndarray):
        mu, of_F, (lower, upper) = rows
        k, j = len(mu), len(mu) + len(of_F)
        y, root = b + G @ P, np.sqrt(scale)
        trial = P - y / scale
        closed = trial[:k] > 0.0
        radius, d = (mu * np.maximum(P[:k], 0.0))[of_F], trial[k:j]
        norm = np.maximum(np.sqrt(np.bincount(of_F, d * d, k)), 1e-300)[of_F]
        self._slips = slips = closed[of_F] & (norm > EDGE * radius)
        inside = (trial[j:] >= lower) & (trial[j:] <= upper)
        self._kinematic = np.concatenate((closed, closed[of_F] & ~slips, inside))
        self._unit, self._part, self._mu_F = d / norm, radius / norm, mu[of_F]
        self._G, self._scale, self._of_F, self._k = G, scale, of_F, k
        bound = np.where(trial[j:] < lower, lower, upper)
        self._R = np.where(self._kinematic, y / scale, P - np.concatenate((np.zeros(j), bound)))
        self._R[k:j][slips] = (P[k:j] - radius * self._unit)[slips]
        size = max(float(np.abs(P * root).max(initial=0.0)), 1e-300)
        self.error = float(np.abs(self._R * root).max(initial=0.0)) / size

    def dense_step(self) -> np.ndarray:
        """J^-1 R; not finite where J is singular."""
        of_F, unit, slips = self._of_F, self._unit, self._slips
        n, m, k = len(self._R), len(of_F), self._k
        j, every, own = k + m, np.arange(m), np.eye(n)
        Gs = self._G / self._scale[:, None]
        J = np.where(self._kinematic[:, None], Gs, own)
        J[np.arange(n), np.arange(n)] += REGULAR * self._kinematic
        if slips.any():
            turning = (every[:, None] == every) - unit[:, None] * unit * (of_F[:, None] == of_F)
            rows = own[k:j] - self._part[:, None] * (turning @ (own[k:j] - Gs[k:j]))
            rows[every, of_F] -= self._mu_F * unit
            J[k:j][slips] = rows[slips]
        try:
            return np.linalg.solve(J, self._R)
        except np.linalg.LinAlgError:
            return np.full(n, np.nan)

    def sparse_step(self) -> np.ndarray:
        """The same for many contacts, a few of which feel each other."""
        of_F, unit = self._of_F, self._unit
        n, m, k = len(self._R), len(of_F), self._k
        j = k + m
        Gs = diags_array(1.0 / self._scale) @ csr_array(self._G)
        own = eye_array(n, format="csr")
        f, g = np.nonzero(of_F[:, None] == of_F)
        turning = csr_array((((f == g) - unit[f] * unit[g]) * self._part[f], (f, g)), shape=(m, m))
        rows = own[k:j] - turning @ (own[k:j] - Gs[k:j])
        rows = rows - csr_array((self._mu_F * unit, (np.arange(m), of_F)), shape=(m, n))
        direct = ~self._kinematic & ~np.concatenate((np.zeros(k, dtype=bool), self._slips, np.zeros(n - j, dtype=bool)))
        J = diags_array(self._kinematic * 1.0) @ Gs + diags_array(self._kinematic * REGULAR + direct)
        J = J + vstack((csr_array((k, n)), diags_array(self._slips * 1.0) @ rows, csr_array((n - j, n))))
        try:
            return splu(csc_array(J)).solve(self._R)
        except RuntimeError:
            return np.full(n, np.nan)
