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
from scipy.linalg import solve_triangular
from scipy.optimize import nnls
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from ngalpha_pin.common.tolerances import CONE, TINY

# Newton's steps on a problem that is held, and on one that is not: from what sweeps have found it is there in two to
# four, or its sets wander
HELD_STEPS, FREE_STEPS = 20, 6
# keeps the Newton matrix regular where directions are dependent, relative to its diagonal
REGULAR = 1e-10
# a dense solve of this size takes as long as building and factorising the sparse matrix of a packing; a matrix with
# more entries than this part of all is dense
DENSE, FULL = 100, 0.25
SYMMETRIC = 1e-12  # what sums of a tree leave between an entry of G and its twin, in parts of the diagonal
ORDERING = "MMD_AT_PLUS_A"  # of columns: where one contact feels another, the other feels the one
# of the proximal point method: rho at first, least and most, relative to the diagonal of G; its change; and rounds
FIRST, LEAST, MOST, FALLS, ROUNDS = 0.1, 1e-9, 1e2, 10.0, 40
SLOWLY = 2.0  # what rho falls by where it has fallen too fast
FEW_STEPS = 2  # of Newton on a problem that hardly differs from the one before: rho falls faster and faster
# among dependent directions no answer is better than the accuracy of the step before: one that becomes no better is
# taken within so many tolerances, since Newton's method on the whole step accepts what follows from it
ROUGHLY = 100.0
# rounds in which the residual has not become half as large: where there is no solution, more rounds find none
STALLS = 8
# rounds for a problem that has a solution: the residual may have to grow on the way there, but not where it is rounding
# in dependent directions already
PATIENT_ROUNDS, ROUNDED = 200, 1e-10


NO_BOUNDS = (np.zeros(0), np.zeros(0))


class Rows(NamedTuple):
    """What the rows of a problem are: normal ones first, then friction, then joint friction.

    Attributes:
        mu: friction coefficients of the cones, shape (c,).
        of_F: cone of each friction row, shape (m,); the rows of a cone follow each other.
        bounds: lower and upper bounds of joint friction, shape (f,) each.
        of_cone: contact of each cone, shape (c,); None where the contacts have one each.
    """

    mu: np.ndarray
    of_F: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray] = NO_BOUNDS
    of_cone: np.ndarray | None = None

    @property
    def contact(self) -> np.ndarray:
        """Contact of each cone, shape (c,)."""
        return np.arange(len(self.mu)) if self.of_cone is None else self.of_cone

    def scale(self, G: np.ndarray) -> np.ndarray:
        """Inverse mass of every row, one for all friction rows of a cone [1/kg]."""
        m, f = len(self.of_F), len(self.bounds[0])
        k, j = len(G) - m - f, len(G) - f
        diagonal = np.maximum(G.diagonal(), TINY)
        size_F = np.full(len(self.mu), TINY)
        np.maximum.at(size_F, self.of_F, diagonal[k:j])
        return np.concatenate((diagonal[:k], size_F[self.of_F], diagonal[j:]))


def proximal_newton(
    G: np.ndarray, b: np.ndarray, rows: Rows, P: np.ndarray, tol: float, patient: bool = False
) -> tuple[np.ndarray, bool]:
    """Solve the problem by Newton, or by Newton on problems that are held near the solution of the one before.

    Args:
        G: Delassus matrix, shape (n, n) [1/kg].
        b: velocity without percussions, shape (n,) [m/s]; or the same one level up.
        rows: their laws.
        P: first guess, shape (n,) [N s].
        tol: of the residual, relative to the largest percussion.
        patient: go on where the residual does not become smaller for a while, and while it does near the tolerance.

    Returns:
        P, or what had the smallest residual, and whether it was found.
    """
    problem = _Problem(G, b, rows)
    found, steps = problem.newton(P, P, 0.0, tol)
    if steps is not None:
        return found, True
    if problem.convex:
        return problem.without_friction(P, tol)
    best, nearest = found, problem.laws(found, found, 0.0).error
    rho, falls, last, halved, at = FIRST, FALLS, MOST, nearest, 0
    for i in range(PATIENT_ROUNDS if patient else ROUNDS):
        found, steps = problem.newton(P, P, rho, tol)
        error = problem.laws(found, found, 0.0).error
        # what is left is rounding in dependent directions, among which the sets of a few contacts change without end
        if not patient and min(error, nearest) <= ROUGHLY * tol and (steps is None or error > 0.5 * nearest):
            return (found if error < nearest else best), True
        if error < nearest:
            best, nearest = found, error
        if nearest < 0.5 * halved:
            halved, at = nearest, i
        elif i - at >= STALLS and (not patient or nearest <= max(ROUGHLY * tol, ROUNDED)):
            break
        if steps is None:
            # half the way back, in orders of magnitude, to where it was solved
            rho, falls = min(max(np.sqrt(rho * last), SLOWLY * rho), MOST), SLOWLY
            continue
        P, last = found, rho
        if error <= tol:
            return P, True
        rho, falls = max(rho / falls, LEAST), falls * falls if steps <= FEW_STEPS else min(SLOWLY * falls, FALLS)
    return best, nearest <= ROUGHLY * tol


class _Problem:
    """A contact problem with what does not change from one Newton step to the next.

    Args:
        G, b, rows: as in `proximal_newton`.
    """

    def __init__(self, G: np.ndarray, b: np.ndarray, rows: Rows):
        self.G, self.b, self.rows, self.scale = G, b, rows, rows.scale(G)
        self.k, self.n = len(b) - len(rows.of_F) - len(rows.bounds[0]), len(b)
        self.contact = rows.contact
        self.root = np.sqrt(self.scale)
        self._pairs()
        self._pattern()

    def _pairs(self) -> None:
        """Pairs of rows that the laws of a contact couple: all friction rows of a cone; any other row with itself."""
        k, n, of_F = self.k, self.n, self.rows.of_F
        ends = np.flatnonzero(np.diff(of_F, append=-1)) + 1
        place = np.searchsorted(ends, np.arange(len(of_F)), side="right")
        starts = np.concatenate(([0], ends))[place]
        first = np.concatenate((np.arange(k), k + starts, np.arange(k + len(of_F), n)))
        end = np.concatenate((first[:k] + 1, k + ends[place], first[k + len(of_F) :] + 1))
        self.starts = np.concatenate(([0], np.cumsum(end - first)))
        self.f = np.repeat(np.arange(n), end - first)
        self.g = first[self.f] + np.arange(len(self.f)) - self.starts[self.f]
        self.same = self.f == self.g

    def _pattern(self) -> None:
        """Entries of the Newton matrix A G / scale + B, by rows, where A and B have one entry for each of the pairs."""
        k, n, f, g = self.k, self.n, self.f, self.g
        friction, normal = k + np.arange(len(self.rows.of_F)), self.contact[self.rows.of_F]
        used = np.zeros((n, n), dtype=bool)
        np.logical_or.at(used, f, self.G[g] != 0.0)
        used[f, g] = used[friction, normal] = True
        rows, columns = np.nonzero(used)
        place = np.empty((n, n), dtype=int)
        place[rows, columns] = np.arange(len(rows))
        self.entries, self.own, self.by_normal = (rows, columns), place[f, g], place[friction, normal]
        # the terms of the product: the pair and the entry of G of each
        counts, self._terms = np.diff(self.starts)[rows], []
        for i in range(int(counts.max(initial=0))):
            here = np.flatnonzero(counts > i)
            pair = self.starts[rows[here]] + i
            self._terms.append((here, pair, self.G[g[pair], columns[here]] / self.scale[g[pair]]))
        self._matrix = None
        if n > DENSE and len(rows) < FULL * n * n:
            starts = np.searchsorted(rows, np.arange(n + 1))
            self._matrix = csc_array((np.zeros(len(rows)), columns, starts), shape=(n, n))  # transposed

    def solve(self, A: np.ndarray, B: np.ndarray, by_normal: np.ndarray, right: np.ndarray) -> np.ndarray:
        """The solution of (A G / scale + B) x = right; not finite where the matrix is singular.

        Args:
            A: entries of the pairs, shape (pairs,).
            B: entries of the pairs, shape (pairs,).
            by_normal: entry of each friction row in the column of its normal row, shape (m,).
            right: shape (n,).
        """
        values = np.zeros(len(self.entries[0]))
        for here, pair, in_G in self._terms:
            values[here] += A[pair] * in_G
        values[self.own] += B
        values[self.by_normal] += by_normal
        try:
            if self._matrix is not None:
                self._matrix.data = values
                return splu(self._matrix, ORDERING).solve(right, trans="T")
            J = np.zeros((self.n, self.n))
            J[self.entries] = values
            return np.linalg.solve(J, right)
        except (RuntimeError, np.linalg.LinAlgError):
            return np.full(self.n, np.nan)

    @property
    def convex(self) -> bool:
        """There are normal rows alone and no forces tied to them: the problem is a convex quadratic program."""
        return self.n == self.k and bool(np.abs(self.G - self.G.T).max() <= SYMMETRIC * self.scale.max())

    def without_friction(self, P: np.ndarray, tol: float) -> tuple[np.ndarray, bool]:
        """Proximal point method on a convex problem, with an active-set method that always comes to an end inside."""
        x, c = P * self.root, self.b / self.root
        L = np.linalg.cholesky(self.G / np.outer(self.root, self.root) + LEAST * np.eye(self.n))
        for _ in range(ROUNDS):
            try:
                x = nnls(L.T, solve_triangular(L, LEAST * x - c, lower=True))[0]
            except RuntimeError:  # too many steps
                return P, False
            P = x / self.root
            error = self.laws(P, P, 0.0).error
            if error <= tol:
                return P, True
        return P, error <= ROUGHLY * tol

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
        mu, of_F, (lower, upper), _ = problem.rows
        k, c, of, scale = problem.k, len(mu), problem.contact, (1.0 + rho) * problem.scale
        j = k + len(of_F)
        y = problem.b + problem.G @ P + rho * problem.scale * (P - centre)
        trial = P - y / scale
        closed = trial[:k] > 0.0
        radius, d = (mu * np.maximum(P[:k], 0.0)[of])[of_F], trial[k:j]
        norm = np.maximum(np.sqrt(np.bincount(of_F, d * d, c)), TINY)[of_F]
        slips = closed[of][of_F] & (norm > (1 + CONE) * radius)
        inside = (trial[j:] >= lower) & (trial[j:] <= upper)
        self._kinematic = np.concatenate((closed, closed[of][of_F] & ~slips, inside))
        self._slips = np.concatenate((np.zeros(k, dtype=bool), slips, np.zeros(len(lower), dtype=bool)))
        self._unit, self._part = np.zeros((2, problem.n))
        self._unit[k:j], self._part[k:j] = d / norm, radius / norm
        self._problem, self._rho = problem, rho
        bound = np.where(trial[j:] < lower, lower, upper)
        self._R = np.where(self._kinematic, y / scale, P - np.concatenate((np.zeros(j), bound)))
        self._R[k:j][slips] = (P[k:j] - radius * self._unit[k:j])[slips]
        size = max(float(np.abs(P * problem.root).max(initial=0.0)), TINY)
        self.error = float(np.abs(self._R * problem.root).max(initial=0.0)) / size
        self.sets = self._kinematic.tobytes() + slips.tobytes()

    def step(self) -> np.ndarray:
        """J^-1 R with J = A (G / scale + rho) / (1 + rho) + B; not finite where J is singular.

        A is the identity where kinematics decide and zero where the percussion is given; for friction that slips it
        says how far, and along which directions, the force on the edge of the cone turns with y.
        """
        problem, unit, slips, rho = self._problem, self._unit, self._slips, self._rho
        f, g, same, k = problem.f, problem.g, problem.same, problem.k
        turning = self._part[f] * (same - unit[f] * unit[g])
        A = np.where(slips[f], turning, same * self._kinematic[f])
        B = np.where(slips[f], same - turning, same * np.where(self._kinematic, REGULAR, 1.0)[f])
        mu, of_F = problem.rows.mu, problem.rows.of_F
        friction = slice(k, k + len(of_F))
        by_normal = -mu[of_F] * (unit * slips)[friction]
        return problem.solve(A / (1.0 + rho), B + A * (rho / (1.0 + rho)), by_normal, self._R)
