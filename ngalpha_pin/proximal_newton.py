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
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

# Newton's steps on a problem that is held, and on one that is not: from what sweeps have found it is there in three to
# eight, or its sets wander
HELD_STEPS, FREE_STEPS = 20, 10
# keeps the Newton matrix regular where directions are dependent, relative to its diagonal
REGULAR = 1e-10
EDGE = 1 + 1e-9
# a dense solve of this size takes as long as building and factorising the sparse matrix of a packing; a matrix with
# more entries than this part of all is dense
DENSE, FULL = 100, 0.25
# of the proximal point method: rho at first, least and most, relative to the diagonal of G; its change; and rounds
FIRST, LEAST, MOST, FALLS, ROUNDS = 0.1, 1e-9, 1e2, 10.0, 40
FEW_STEPS = 2  # of Newton on a problem that hardly differs from the one before: rho falls faster and faster
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
    """Solve the problem by Newton, or by Newton on problems that are held near the solution of the one before.

    Args:
        G: Delassus matrix, shape (n, n) [1/kg].
        b: velocity without percussions, shape (n,) [m/s]; or the same one level up.
        rows: their laws.
        P: first guess, shape (n,) [N s].
        tol: of the residual, relative to the largest percussion.

    Returns:
        P, or None where it is not found.
    """
    problem = _Problem(G, b, rows)
    found, steps = problem.newton(P, P, 0.0, tol)
    if steps is not None:
        return found
    best, nearest = found, problem.laws(found, found, 0.0).error
    rho, falls = FIRST, FALLS
    for _ in range(ROUNDS):
        found, steps = problem.newton(P, P, rho, tol)
        error = problem.laws(found, found, 0.0).error
        if error < nearest:
            best, nearest = found, error
        if steps is None:
            # the sets of a few contacts change without end, by less than rounding makes of dependent directions
            if nearest <= ROUGHLY * tol:
                return best
            rho, falls = min(rho * FALLS, MOST), FALLS
            continue
        P = found
        if error <= tol:
            return P
        rho, falls = max(rho / falls, LEAST), falls * falls if steps <= FEW_STEPS else FALLS
    return best if nearest <= ROUGHLY * tol else None


class _Problem:
    """A contact problem with what does not change from one Newton step to the next.

    Args:
        G, b, rows: as in `proximal_newton`.
    """

    def __init__(self, G: np.ndarray, b: np.ndarray, rows: Rows):
        self.G, self.b, self.rows, self.scale = G, b, rows, rows.scale(G)
        self.k, self.n = len(rows.mu), len(b)
        self.root = np.sqrt(self.scale)
        Gs = G / self.scale[:, None]
        self.sparse = self.n > DENSE and np.count_nonzero(G) < FULL * G.size
        self.Gs = csr_array(Gs) if self.sparse else Gs
        # pairs of friction rows of one contact, by rows; rows of one contact are neighbours
        m, of_F = len(rows.of_F), rows.of_F
        first, end = np.searchsorted(of_F, of_F), np.searchsorted(of_F, of_F, "right")
        self.f = np.repeat(np.arange(m), end - first)
        among = np.arange(len(self.f)) - np.searchsorted(self.f, self.f)
        self.g = first[self.f] + among
        self.same = self.f == self.g
        # one entry in every row but those of friction, which have one for each friction row of their contact
        ones, j = np.ones(self.n, dtype=int), self.k + m
        ones[self.k : j] = end - first
        self._starts = np.concatenate(([0], np.cumsum(ones)))
        self._columns = np.concatenate((np.arange(self.k), self.k + self.g, np.arange(j, self.n)))

    def newton(self, P: np.ndarray, centre: np.ndarray, rho: float, tol: float) -> tuple[np.ndarray, int | None]:
        """Semi-smooth Newton on the laws (128)-(142) of the problem that is held near `centre`.

        Returns:
            P and the number of steps, None where it has not converged; then P is what had the smallest residual.
        """
        best, nearest, found = P, np.inf, None
        seen: dict[bytes, tuple[int, float]] = {}
        for step in range(HELD_STEPS if rho else FREE_STEPS):
            laws = self.laws(P, centre, rho)
            if laws.error < nearest:
                best, nearest = P, laws.error
            if laws.error <= tol:
                if found is not None:
                    return P, step
                found = P  # one more step: what a small residual leaves open where masses are very different
            elif found is not None:
                return found, step
            last, error = seen.get(laws.sets, (step - 1, np.inf))
            if last < step - 1 and laws.error > 0.5 * error:
                break  # sets that come back without a better residual come back again
            seen[laws.sets] = step, laws.error
            P = P - laws.step()
            if not np.isfinite(P).all():
                break
        return (best, None) if found is None else (found, step)

    def laws(self, P: np.ndarray, centre: np.ndarray, rho: float) -> _Laws:
        """The laws at P."""
        return _Laws(self, P, centre, rho)

    def of_contacts(self, normal: np.ndarray, friction: np.ndarray, joints: np.ndarray) -> csr_array:
        """A matrix that couples the friction rows of each contact, those entries being given by `f` and `g`."""
        data = np.concatenate((normal, friction, joints))
        return csr_array((data, self._columns, self._starts), shape=(self.n, self.n))


class _Laws:
    """Residual of the laws at P and its Newton step.

    Args:
        problem: the contact problem.
        P: percussions, shape (n,) [N s].
        centre: percussions near which those of the problem are held, shape (n,) [N s].
        rho: how much, relative to the diagonal of G.

    Attributes:
        error: largest residual, relative to the largest percussion.
        sets: something that is equal where the index sets are.
    """

    def __init__(self, problem: _Problem, P: np.ndarray, centre: np.ndarray, rho: float):
        mu, of_F, (lower, upper) = problem.rows
        k, j, scale = len(mu), len(mu) + len(of_F), (1.0 + rho) * problem.scale
        y = problem.b + problem.G @ P + rho * problem.scale * (P - centre)
        trial = P - y / scale
        closed = trial[:k] > 0.0
        radius, d = (mu * np.maximum(P[:k], 0.0))[of_F], trial[k:j]
        norm = np.maximum(np.sqrt(np.bincount(of_F, d * d, k)), 1e-300)[of_F]
        self._slips = slips = closed[of_F] & (norm > EDGE * radius)
        inside = (trial[j:] >= lower) & (trial[j:] <= upper)
        self._kinematic = np.concatenate((closed, closed[of_F] & ~slips, inside))
        self._unit, self._part = d / norm, radius / norm
        self._problem, self._rho = problem, rho
        bound = np.where(trial[j:] < lower, lower, upper)
        self._R = np.where(self._kinematic, y / scale, P - np.concatenate((np.zeros(j), bound)))
        self._R[k:j][slips] = (P[k:j] - radius * self._unit)[slips]
        size = max(float(np.abs(P * problem.root).max(initial=0.0)), 1e-300)
        self.error = float(np.abs(self._R * problem.root).max(initial=0.0)) / size
        self.sets = self._kinematic.tobytes() + slips.tobytes()

    def step(self) -> np.ndarray:
        """J^-1 R with J = A (G / scale + rho) / (1 + rho) + B; not finite where J is singular.

        A and B couple the rows of one contact: A is the identity where kinematics decide and zero where the percussion
        is given; friction that slips has in A how far and along which directions the edge of its cone turns with y.
        """
        problem, unit, slips, rho = self._problem, self._unit, self._slips, self._rho
        k, f, g, same = problem.k, problem.f, problem.g, problem.same
        j = k + len(problem.rows.of_F)
        turning = self._part[f] * (same - unit[f] * unit[g])
        kinematic, given = self._kinematic * 1.0, np.where(self._kinematic, REGULAR, 1.0)
        in_A = np.where(slips[f], turning, same * kinematic[k:j][f])
        in_B = np.where(slips[f], same - turning, same * given[k:j][f])
        A = problem.of_contacts(kinematic[:k], in_A, kinematic[j:])
        B = problem.of_contacts(given[:k], in_B, given[j:])
        i = np.flatnonzero(slips)
        of_F, mu = problem.rows.of_F[i], problem.rows.mu
        B = B - csr_array((mu[of_F] * unit[i], (k + i, of_F)), shape=B.shape)
        if not problem.sparse:
            try:
                return np.linalg.solve((A @ problem.Gs + (rho * A + (1.0 + rho) * B).toarray()) / (1.0 + rho), self._R)
            except np.linalg.LinAlgError:
                return np.full(len(self._R), np.nan)
        J = (A @ problem.Gs + rho * A) / (1.0 + rho) + B
        try:
            return splu(J.T).solve(self._R, trans="T")  # the rows of J are the columns of its transpose
        except RuntimeError:
            return np.full(len(self._R), np.nan)
