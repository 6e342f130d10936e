"""One-level frictional contact problem: Signorini and Coulomb laws on y = b + G P, by Gauss-Seidel prox sweeps."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.engine import solve_level
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.numerics.prox import prox_ball
from ngalpha_pin.numerics.proximal_newton import DENSE, NO_BOUNDS, Rows, proximal_newton

MAX_SWEEPS = 5000  # of a problem that Newton's method does not solve either
SWEPT = 1e-13  # change of the forces in a sweep, in parts of the largest, that is rounding of some hundred operations
# sweeps before Newton's method is tried on what they have found, and again after this many times as many
BEFORE_NEWTON, AGAIN = 20, 4
PER_ROW = 0.5  # and per row of the problem: Newton's method costs more with many of them
RCOND = 1e-12  # part of the largest singular value below which constraints are redundant
VANISHES = 1e-10  # inverse mass of a constraint, relative to the largest, below which its scale stays as it is
# growth of the changes from the first sweep on that no problem with a solution shows
DIVERGES = 1e6


class FreeProblem:
    """A problem y = b + G P without its constraints: their forces are eliminated, where dependent by the smallest ones.

    Args:
        G: Delassus matrix of all rows, constraints last, shape (n, n).
        b: y without forces, shape (n,).
        n_c: rows before the constraints.

    Attributes:
        G, b: of those rows alone, shapes (n_c, n_c) and (n_c,).
        met: largest of the rates that constraints meet and make vanish.
    """

    def __init__(self, G: np.ndarray, b: np.ndarray, n_c: int):
        self.G, self.b = G[:n_c, :n_c], b[:n_c]
        self._coupling, self._b_b = G[n_c:, :n_c], b[n_c:]
        self.met = float(np.abs(self._b_b).max(initial=0.0))
        if len(self._b_b):
            # rows have different units: scale them before deciding which directions are dependent; a row that vanishes
            # in a singular position is not blown up
            diagonal = G.diagonal()[n_c:]
            root = np.sqrt(np.maximum(diagonal, max(VANISHES * diagonal.max(), TINY)))
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
    tol: float = SWEPT,
    max_sweeps: int = MAX_SWEEPS,
    bounds: tuple[np.ndarray, np.ndarray] = NO_BOUNDS,
    patient: bool = False,
    of_cone: np.ndarray | None = None,
    in_engine: bool = False,
) -> tuple[np.ndarray, bool, int]:
    """Find P that fulfils Signorini's and Coulomb's laws, by sweeps and by Newton's method from where they have got.

    0 <= y_N, P_N >= 0, y_N P_N = 0 (41) and y_F in the normal cone of C_F(P_N) at -P_F (47).

    Args:
        G: Delassus matrix W^T M^-1 W, normal rows first, then friction, then joint friction, shape (n, n) [1/kg].
        b: velocity without percussions, shape (n,) [m/s]; or the same one level up.
        mu: friction coefficients of the cones, shape (c,).
        of_F: cone of each friction row, shape (m,).
        P: first guess, shape (n,) [N s].
        tol: change of the percussions in one sweep, relative to the largest one.
        max_sweeps: limit of their number.
        bounds: lower and upper bounds of joint friction, shape (f,) each.
        patient: as in `proximal_newton`.
        of_cone: contact of each cone, those of slip of the contacts first; None where they have one each.
        in_engine: where the problem is not large, the engine solves it; among dependent directions its rounding is
            another one, and forces that are reported should not depend on that.

    Returns:
        P, whether the sweeps have converged, and their number.
    """
    if in_engine and of_cone is None and kernel.library is not None and len(b) <= DENSE:
        given = (np.ascontiguousarray(x, dtype=float) for x in (G, b, mu))
        (found, solved), sweeps = solve_level(*given, of_F, *bounds, P, tol, max_sweeps, patient)
        if solved is not None:
            return found, solved, sweeps
    rows = Rows(mu, of_F, bounds, of_cone)
    problem = Sweeps(G, b, rows, P, (tol, DIVERGES))
    newton_at = max(BEFORE_NEWTON, int(PER_ROW * len(b)))
    while True:
        found = problem.run(min(newton_at, max_sweeps))
        if found:
            return problem.P, found > 0, problem.count
        if problem.count == newton_at:
            P, solved = proximal_newton(G, b, rows, problem.P, max(tol, SWEPT), patient)
            if solved:
                return P, True, problem.count
            problem.go_on_from(P)
        if problem.count >= max_sweeps:
            return problem.P, False, problem.count
        newton_at *= AGAIN if newton_at < max_sweeps // AGAIN else 2


def violation(
    G: np.ndarray,
    b: np.ndarray,
    mu: np.ndarray,
    of_F: np.ndarray,
    P: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray] = NO_BOUNDS,
    of_cone: np.ndarray | None = None,
) -> float:
    """Largest residual of the laws of `solve_contact_problem` as a velocity [m/s]."""
    rows = Rows(mu, of_F, bounds, of_cone)
    k = len(b) - len(of_F) - len(bounds[0])
    j, scale = k + len(of_F), rows.scale(G)
    trial = P - (b + G @ P) / scale
    norm = np.sqrt(np.bincount(of_F, trial[k:j] ** 2, len(mu)))
    part = np.minimum(1.0, mu * P[:k][rows.contact] / np.maximum(norm, TINY))[of_F]
    given = np.concatenate((np.maximum(trial[:k], 0.0), part * trial[k:j], np.clip(trial[j:], *bounds)))
    return float(np.abs((P - given) * scale).max(initial=0.0))


class Sweeps:
    """Gauss-Seidel prox sweeps over the contacts, one after the other. Compiled twin: engine/kernel/sweeps.c.

    Args:
        G, b, P: as in `solve_contact_problem`.
        rows: their laws.
        limits: change of the percussions at which the sweeps have converged, relative to the largest one, and growth of
            the changes from the first sweep on at which they diverge.

    Attributes:
        P: percussions so far, shape (n,) [N s].
        count: number of sweeps.
    """

    def __init__(
        self,
        G: np.ndarray,
        b: np.ndarray,
        rows: Rows,
        P: np.ndarray,
        limits: tuple[float, float],
    ):
        self.P, self._y = np.array(P, dtype=float), b + G @ P
        self._G, self._mu, self._limits, self._bounds = G, np.array(rows.mu, dtype=float), np.array(limits), rows.bounds
        self._diagonal = np.maximum(G.diagonal(), TINY)
        self._rows, self._cones = rows, len(b) - len(rows.bounds[0])
        self._k = self._cones - len(rows.of_F)
        self._rolls = len(rows.mu) > self._k
        self._first_F = self._k + np.searchsorted(rows.of_F, np.arange(self._k + 1))
        self._state = np.zeros(3)

    @property
    def count(self) -> int:
        """See above."""
        return int(self._state[0])

    def go_on_from(self, P: np.ndarray) -> None:
        """Go on from other percussions."""
        self._y += self._G @ (P - self.P)
        self.P = np.array(P)

    def _cones_by_contact(self) -> list[list[tuple[slice, float]]]:
        """Rows and coefficient of the cones of each contact."""
        found: list[list[tuple[slice, float]]] = [[] for _ in range(self._k)]
        of_F, of = self._rows.of_F, self._rows.contact
        ends = np.flatnonzero(np.diff(of_F, append=-1)) + 1
        for first, end in zip([0, *ends[:-1].tolist()], ends.tolist(), strict=False):
            cone = int(of_F[first])
            found[int(of[cone])].append((slice(self._k + first, self._k + end), float(self._mu[cone])))
        return found

    def run(self, last: int) -> int:
        """Go on up to sweep number `last`; 1 where they have converged, -1 where they diverge, else 0."""
        if kernel.library is None or self._rolls:
            return self._run(last)
        if not hasattr(self, "_columns"):
            columns = csc_array(self._G)
            self._columns = (columns.indptr.astype(np.int32), columns.indices.astype(np.int32), columns.data)
        sizes = np.array([self._k, self._cones, len(self.P), last], dtype=np.int32)
        bounds = (np.array(bound, dtype=float) for bound in self._bounds)
        arrays = (
            sizes, self._first_F.astype(np.int32), *self._columns, self._diagonal, self._mu, *bounds, self._limits,
            self._state, self.P, self._y,
        )  # fmt: skip
        return int(kernel.library.nga_sweep(*(array.ctypes.data for array in arrays)))

    def _run(self, last: int) -> int:
        G, P, y, diagonal = self._G, self.P, self._y, self._diagonal
        root = np.sqrt(diagonal)
        cones = self._cones_by_contact()
        while self.count < last:
            change = 0.0
            for j in range(self._k):
                new = max(0.0, P[j] - y[j] / diagonal[j])  # (131)
                step = new - P[j]
                if step != 0.0:
                    y += G[:, j] * step
                    P[j] = new
                    change = max(change, abs(step) * root[j])
                for f, mu in cones[j]:
                    r = 1.0 / diagonal[f].max()
                    moved = prox_ball(P[f] - r * y[f], mu * P[j]) - P[f]  # (137)
                    if moved.any():
                        y += G[:, f] @ moved
                        P[f] += moved
                        change = max(change, float(np.abs(moved * root[f]).max()))
            for i, (lower, upper) in enumerate(zip(*self._bounds, strict=True), self._cones):
                step = min(max(P[i] - y[i] / diagonal[i], lower), upper) - P[i]
                if step != 0.0:
                    y += G[:, i] * step
                    P[i] += step
                    change = max(change, abs(step) * root[i])
            self._state[0] += 1
            self._state[2] = change
            if self.count == 1:
                self._state[1] = change
            elif change > self._limits[1] * self._state[1]:  # slip with much friction may have no solution
                return -1
            if change <= self._limits[0] * max(float(np.abs(P * root).max(initial=0.0)), TINY):
                return 1
        return 0


def forces_of_closed_contacts(
    G: np.ndarray,
    b: np.ndarray,
    mu: np.ndarray,
    of_F: np.ndarray,
    closed: np.ndarray,
    slip: np.ndarray,
    tol: float = SWEPT,
    max_sweeps: int = MAX_SWEEPS,
    bounds: tuple[np.ndarray, np.ndarray] = NO_BOUNDS,
    guess: np.ndarray | None = None,
    patient: bool = False,
    of_cone: np.ndarray | None = None,
    enough: float = 0.0,
    in_engine: bool = False,
) -> tuple[np.ndarray, bool]:
    """Contact forces from accelerations: sticking or just starting to slip, or slipping in a known direction (140).

    Args:
        G: Delassus matrix, normal rows first, then friction, then joint friction, shape (n, n) [1/kg].
        b: accelerations without contact forces, shape (n,) [m/s^2].
        mu: friction coefficients of the cones, shape (c,).
        of_F: cone of each friction row, shape (m,).
        closed: contacts that may carry a force, shape (k,).
        slip: slip velocity, zero where the contact sticks, shape (m,) [m/s].
        tol: as in `solve_contact_problem`.
        max_sweeps: likewise.
        bounds: likewise.
        guess: forces to start from, shape (n,); None is zero.
        patient: as in `solve_contact_problem`.
        of_cone: as in `solve_contact_problem`.
        enough: residual of the laws, in parts of the largest b, at which they hold, whatever the sweeps find.
        in_engine: as in `solve_contact_problem`.

    Returns:
        la_N, la_F and the torques of joint friction, shape (n,) [N], and whether they are a solution; slip with much
        friction may have none.
    """
    k, c, of = len(closed), len(mu), np.arange(len(mu)) if of_cone is None else of_cone
    j, there = k + len(of_F), closed[of]
    speed = np.sqrt(np.bincount(of_F, slip * slip, c))
    slips = there & (speed > 0.0)
    # the friction of a slipping contact is tied to its normal force (120): fewer unknowns, along another direction
    i = np.flatnonzero(slips[of_F])
    tied = -mu[of_F[i]] * slip[i] / speed[of_F[i]]
    sticks = (there & ~slips)[of_F]
    free = np.concatenate((np.flatnonzero(closed), k + np.flatnonzero(sticks), np.arange(j, len(b))))
    place = np.cumsum(closed) - 1
    G_free = G[np.ix_(free, free)]
    np.add.at(G_free.T, place[of[of_F[i]]], (G[np.ix_(free, k + i)] * tied).T)
    cone_place = np.cumsum(there) - 1
    mu_free, of_free, of_cone = mu[there], cone_place[of_F[sticks]], None if of_cone is None else place[of[there]]
    start = np.zeros(len(free)) if guess is None else guess[free]
    patient = patient and len(i) == 0  # along given directions of slip there need not be a solution
    la, converged, _ = solve_contact_problem(
        G_free, b[free], mu_free, of_free, start, tol, max_sweeps, bounds, patient, of_cone, in_engine
    )
    if enough and not converged and np.isfinite(la).all():  # directions that are nearly dependent
        left = violation(G_free, b[free], mu_free, of_free, la, bounds, of_cone)
        converged = left <= enough * float(np.abs(b[free]).max(initial=0.0))
    forces = np.zeros(len(b))
    forces[free] = la
    forces[k + i] = tied * forces[of[of_F[i]]]
    return forces, converged and bool(np.isfinite(la).all())
