"""Contact kinematics of two features that may move, roll and turn: the provider beside `point_rows.Rows`.

The normal n from A to B makes the separation F(n) = n.(p_B - p_A) stationary, where p_A(n) and p_B(-n) are the points
of the features with that normal (see `features`). With R_A and R_B, the derivatives of these points by their normals
(radii of curvature, on the tangent plane), and a displacement (delta, phi) of B relative to A, seen from A:

    K dn + E_A alpha + E_B beta = P m + R_B (phi x n)        K = R_A + R_B + g_N        m = delta + phi x p_B
    E_A.dn = 0        E_B.(dn - phi x n) = 0

gives the turning dn of the normal and dp_B = m - R_B (dn - phi x n) - E_B beta, the way of the contact point. The same
matrix is the Newton matrix for n. Every row of W^T is a wrench F = (d, p_B x d + q) times the Jacobian, so that with
the 6 x 6 matrices dF = D (delta, phi) and the relative twist V, as seen from A,

    rate = F.V      acceleration = F.A + V.(D V)      derivatives: D^T V of the rate, (D + D^T) V of the acceleration.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.collision.features import NORMAL, SIDE, VANISHED
from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.contact.moving_surfaces import Slip, surface_accelerations, surface_rates
from ngalpha_pin.contact.point_rows import Motion, Moves, Rows
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.numerics.spatial import cross, dot, force_cross, motion_cross, skew

# turning of the normal in one Newton iteration after which its error is below rounding
CONVERGED = 1e-8
MAX_NEWTON = 25  # iterations: each turns by `TURN` at most, so that the first seven come from anywhere
SMALLEST = 1e-150  # length whose square is a number yet
# radius that corners have where nothing else turns the normal, in parts of their distance, and part of a radius of
# curvature that a gap below it adds at least
SHARP, ROUND = 1e-5, 1e-9
TURN = 0.5  # largest turning of the normal in one iteration [rad]


class FeatureRows:
    """Kinematic rows of contacts of features; attributes and methods as of `point_rows.Rows`.

    Args:
        sub: the contacts.
        packed: their features, shape (k, WIDTH).
        rotation, translation: pose of every body of the subset, shape (n_bodies, 3, 3) and (n_bodies, 3).
    """

    driven: Slip | None = None

    def __init__(self, sub: Subset, packed: np.ndarray, rotation: np.ndarray, translation: np.ndarray):
        self.sub = sub
        if sub.surfaces is not None:
            self._surfaces = sub.surfaces.placed(rotation, translation, sub.body_a, sub.body_b)
        R_a, p_a = rotation[sub.body_a], translation[sub.body_a]
        self._a = _Side(packed[:, :SIDE], R_a, p_a, 1.0)
        self._b = _Side(packed[:, SIDE : 2 * SIDE], rotation[sub.body_b], translation[sub.body_b], -1.0)
        self._faces = self._a.is_face | self._b.is_face
        n = np.einsum("kij,kj->ki", R_a, packed[:, NORMAL])
        n = np.where(self._a.is_face[:, None], _along(self._a.face_normal, n), n)
        n = np.where((self._b.is_face & ~self._a.is_face)[:, None], _along(self._b.face_normal, n), n)
        self.normals = n
        self._live = np.flatnonzero(~self._faces)
        if len(self._live):
            self._find_normals(self._live)
        p_A, p_B, g = self._points(slice(None))
        self._g, vanished = g, packed[:, VANISHED]
        self.g_N = np.where(vanished > 0.0, vanished, g)
        self.c = np.where(self._b.is_face[:, None], p_A + g[:, None] * self.normals, p_B)
        if len(self._live):
            self.c[self._live] -= self._b.straight(self._live, self._beta)
        reference = np.einsum("kij,kj->ki", R_a, sub.tangent[:, 0])
        t1 = cross(reference, self.normals)
        t1 /= np.maximum(np.sqrt(dot(t1, t1)), TINY)[:, None]
        frame = np.stack((t1, cross(self.normals, t1)), axis=1)
        if sub.axes is not None:
            frame, self._turns = sub.axes.tangents(frame, self.normals, R_a, rotation[sub.body_b])
        # the point p_B itself carries the force: no arm beyond it
        d_F, self._rolls = sub.along_tangents(frame)
        self.directions = np.concatenate((self.normals, d_F))
        self._q = np.concatenate((np.zeros_like(n), sub.drill_F[:, None] * self.normals[sub.of_F] + self._rolls))

    def _points(self, i: np.ndarray | slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points of the features at the present normals, without the ways along straight directions, and the gaps."""
        n = self.normals[i]
        p_A, p_B = self._a.point(i, n), self._b.point(i, n)
        return p_A, p_B, dot(n, p_B - p_A)

    def _find_normals(self, i: np.ndarray) -> None:
        """Newton iterations for the normals of contacts without a face."""
        for _ in range(MAX_NEWTON):
            n, (p_A, p_B, g) = self.normals[i], self._points(i)
            T = _frames(n)
            right = np.zeros((len(i), 6, 1))
            right[:, :2, 0] = np.einsum("kij,kj->ki", T, p_B - p_A)
            for side, place in ((self._a, 2), (self._b, 4)):
                right[:, place : place + 2, 0] = -np.einsum("kij,ki->kj", side.E[i], n)
            solution = _solved(self._matrix(i, n, g, T), right)[:, :, 0]
            turn = np.einsum("kij,ki->kj", T, solution[:, :2])
            size = np.sqrt(dot(turn, turn))
            turn *= np.minimum(1.0, TURN / np.maximum(size, TINY))[:, None]
            n = n + turn
            self.normals[i] = n / np.sqrt(dot(n, n))[:, None]
            self._beta = solution[:, 4:]
            if not size.max() > CONVERGED:
                return

    def _matrix(self, i: np.ndarray, n: np.ndarray, g: np.ndarray, T: np.ndarray) -> np.ndarray:
        """Newton matrix of (dn, alpha, beta) in the tangents T, shape (k, 6, 6)."""
        radii = self._a.radii(i, n) + self._b.radii(i, n)
        A = np.zeros((len(i), 6, 6))
        A[:, :2, :2] = T @ radii @ T.transpose(0, 2, 1)
        # where two corners touch there is no curvature left; a small one keeps the matrix regular
        apart = self._b.c[i] - self._a.c[i]
        floor = np.sqrt(SHARP**2 * dot(apart, apart) + ROUND**2 * np.einsum("kij,kij->k", radii, radii) + TINY)
        g = np.where(np.abs(g) > floor, g, floor)
        A[:, 0, 0] += g
        A[:, 1, 1] += g
        for side, place in ((self._a, 2), (self._b, 4)):
            A[:, :2, place : place + 2] = T @ side.E[i]
            A[:, place : place + 2, :2] = A[:, :2, place : place + 2].transpose(0, 2, 1)
            for column in (0, 1):
                A[:, place + column, place + column] = ~side.E[i, :, column].any(axis=1)
        return A

    def move(self, motion: Moves) -> FeatureRows:
        """Add the rows and their rates at a velocity and an acceleration."""
        sub, of, d, p = self.sub, self.sub.of_row, self.directions, self.c
        self.F = F = np.concatenate((d, cross(p[of], d) + self._q), axis=1)
        self.W, bias, (self._V_b, self._V_a) = motion.project(F, sub)
        self.rate = motion.rates(self.W, sub)
        V = self._V_b - self._V_a
        self.c_dot = V[:, :3] + cross(V[:, 3:], p)
        self._D = self._derivative_of_wrenches()
        relative, V = V, V[of]
        self._DV = np.einsum("kij,kj->ki", self._D, V)
        self._VD = np.einsum("kji,kj->ki", self._D, V)
        bias = bias + dot(self._DV, V) - dot(F, motion_cross(self._V_a[of], V))
        self.acceleration = motion.accelerations(self.W, sub) + bias
        if sub.surfaces is not None:
            given = motion.times(sub), self._surfaces, F[sub.k :], sub.of_F, relative
            self.driven = sub.surfaces.slip(*given, self._turned)
            self.rate[sub.k :] += self.driven.rate
            self.acceleration[sub.k :] += self.driven.acceleration
        return self

    def _turned(self, X: np.ndarray) -> np.ndarray:
        """D^T X of the friction rows (see `moving_surfaces`), shape (m, 6)."""
        return np.einsum("kji,kj->ki", self._D[self.sub.k :], X[self.sub.of_F])

    @property
    def surface_rate(self) -> np.ndarray:
        """See `point_rows.Rows`."""
        return surface_rates(self.driven, self.sub.k, self.sub.m)

    @property
    def surface_acceleration(self) -> np.ndarray:
        """Its derivative by time, shape (k + m,) [m/s^2]."""
        return surface_accelerations(self.driven, self.sub.k, self.sub.m)

    @property
    def sizes(self) -> tuple[float, float]:
        """Largest position and velocity that the rows subtract."""
        return float(np.abs(self.c).max()), float(np.abs(self.c_dot).max())

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each shape (k + m, nv)."""
        of, F = self.sub.of_row, self.F
        G_X = force_cross(self._V_b[of], F) + self._VD
        if self.driven is not None:
            G_X[self.sub.k :] += self.driven.gradient
        G_Y = G_X + force_cross(self._V_a[of], F) + self._DV
        X = (G_X @ motion.J + F @ (motion.dAdv - motion.dJ)) * self.sub.mask
        Y = (G_Y @ motion.J + F @ motion.dAdv) * self.sub.mask
        return X, Y

    def _derivative_of_wrenches(self) -> np.ndarray:
        """D: derivative of F by a displacement of B relative to A, as seen from A, shape (k + m, 6, 6)."""
        sub, of, n, d = self.sub, self.sub.of_row, self.normals, self.directions
        N, P = self._turning()
        m, k = sub.m, sub.k
        dd = np.empty((k + m, 3, 6))
        dd[:k] = N
        o = sub.of_F
        dd[k:] = -n[o][:, :, None] * np.einsum("ki,kij->kj", d[k:], N[o])[:, None, :]
        dq = np.zeros((k + m, 3, 6))
        turning = np.einsum("ki,kij->kj", self._rolls, N[o])
        dq[k:] = sub.drill_F[:, None, None] * N[o] - n[o][:, :, None] * turning[:, None, :]
        D = np.empty((k + m, 6, 6))
        D[:, :3] = dd
        D[:, 3:] = skew(self.c[of]) @ dd - skew(d) @ P[of] + dq
        if sub.turns is not None:  # tangents along ellipses turn about the normals by K.(delta, phi)
            K = np.einsum("ki,kij->kj", self._turns.by_n, N)
            K[:, 3:] += self._turns.by_phi
            D[k:] += sub.turns.turned(self.F[k:])[:, :, None] * K[o][:, None, :]
        return D

    def _turning(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the normal and of the contact point by the displacement, each shape (k, 3, 6)."""
        n, k, every = self.normals, self.sub.k, slice(None)
        M, S, N = np.zeros((k, 3, 6)), np.zeros((k, 3, 6)), np.zeros((k, 3, 6))
        M[:, :, :3] = np.eye(3)
        M[:, :, 3:] = -skew(self.c)
        S[:, :, 3:] = -skew(n)  # phi x n
        follows = self._b.is_face & ~self._a.is_face  # the normal is that of a face of B
        N[follows] = S[follows]
        R_A, R_B = self._a.radii(every, n), self._b.radii(every, n)
        P = M + R_B @ (S - N)
        i = self._live
        if len(i):
            T = _frames(n[i])
            right = np.zeros((len(i), 6, 6))
            right[:, :2] = T @ (M[i] + R_B[i] @ S[i])
            right[:, 4:] = self._b.E[i].transpose(0, 2, 1) @ S[i]
            solution = _solved(self._matrix(i, n[i], self._g[i], T), right)
            N[i] = T.transpose(0, 2, 1) @ solution[:, :2]
            P[i] = M[i] + R_B[i] @ (S[i] - N[i]) - self._b.E[i] @ solution[:, 4:]
        if follows.any():
            g = self._g[:, None, None]
            foot = R_A @ N + n[:, :, None] * np.einsum("ki,kij->kj", n, M)[:, None, :] + g * N
            P[follows] = foot[follows]
        return N, P


def _solved(A: np.ndarray, right: np.ndarray) -> np.ndarray:
    """A^-1 right of every contact; of edges that have turned until they are parallel, the smallest solution."""
    try:
        return np.asarray(np.linalg.solve(A, right))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(A) @ right)


class StackedRows:
    """Rows of points fixed in a body and of features in one; attributes and methods as of `point_rows.Rows`."""

    def __init__(self, sub: Subset, fixed: Rows, moving: FeatureRows):
        self.sub = sub
        self._parts = (fixed, moving)
        self.g_N = np.concatenate((fixed.g_N, moving.g_N))
        self.normals = np.concatenate((fixed.normals, moving.normals))
        self.c = np.concatenate((fixed.c, moving.c))
        self.directions = self._stack(fixed.directions, moving.directions)

    def move(self, motion: Motion) -> StackedRows:
        """Add the rows and their rates at a velocity and an acceleration."""
        fixed, moving = (part.move(motion) for part in self._parts)
        self.F = self._stack(fixed.F, moving.F)
        self.W = self._stack(fixed.W, moving.W)
        self.rate = self._stack(fixed.rate, moving.rate)
        self.acceleration = self._stack(fixed.acceleration, moving.acceleration)
        self.c_dot = np.concatenate((fixed.c_dot, moving.c_dot))
        return self

    @property
    def surface_rate(self) -> np.ndarray:
        """See `point_rows.Rows`."""
        return self._stack(*(part.surface_rate for part in self._parts))

    @property
    def sizes(self) -> tuple[float, float]:
        """Largest position and velocity that the rows subtract."""
        return float(np.abs(self.c).max()), float(np.abs(self.c_dot).max())

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each shape (k + m, nv)."""
        (X, Y), (X_f, Y_f) = (part.derivatives(motion) for part in self._parts)
        return self._stack(X, X_f), self._stack(Y, Y_f)

    def _stack(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Normal rows of both, then friction rows of both."""
        j, k = self._parts[0].sub.k, self._parts[1].sub.k
        return np.concatenate((a[:j], b[:k], a[j:], b[k:]))


class _Side:
    """The features of one side of all contacts, in the world."""

    def __init__(self, packed: np.ndarray, R: np.ndarray, p: np.ndarray, sign: float):
        k = len(packed)
        self.sign = sign
        self.c = np.einsum("kij,kj->ki", R, packed[:, :3]) + p
        self.E = R @ packed[:, 3:9].reshape(k, 3, 2)
        self.Q = R @ packed[:, 9:18].reshape(k, 3, 3) @ R.transpose(0, 2, 1)
        self.r = packed[:, 18]
        self.is_face: np.ndarray = np.logical_and(*packed[:, 3:9].reshape(k, 3, 2).any(axis=1).T)
        self.face_normal = cross(self.E[:, :, 0], self.E[:, :, 1])

    def point(self, i: np.ndarray | slice, n: np.ndarray) -> np.ndarray:
        """Points with the normal n (of A; the outward one of B is -n), shape (k, 3)."""
        Qn = np.einsum("kij,kj->ki", self.Q[i], n)
        size = np.sqrt(np.maximum(dot(n, Qn), 0.0))
        return self.c[i] + self.sign * (self.r[i][:, None] * n + Qn / np.maximum(size, TINY)[:, None])

    def radii(self, i: np.ndarray | slice, n: np.ndarray) -> np.ndarray:
        """Derivative of the point by the outward normal, shape (k, 3, 3)."""
        Q = self.Q[i]
        Qn = np.einsum("kij,kj->ki", Q, n)
        size = np.maximum(np.sqrt(np.maximum(dot(n, Qn), 0.0)), SMALLEST)[:, None, None]
        projector = np.eye(3) - n[:, :, None] * n[:, None, :]
        Qn = Qn / size[:, :, 0]
        return (Q - Qn[:, :, None] * Qn[:, None, :]) / size + self.r[i][:, None, None] * projector

    def straight(self, i: np.ndarray, beta: np.ndarray) -> np.ndarray:
        """Ways along the straight directions, shape (k, 3)."""
        return np.einsum("kij,kj->ki", self.E[i], beta)


def _along(normal: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """Normals of faces, with the sign of a guess."""
    return normal * np.where(dot(normal, guess) < 0.0, -1.0, 1.0)[:, None]


def _frames(n: np.ndarray) -> np.ndarray:
    """Two tangents of every normal, shape (k, 2, 3)."""
    e = np.zeros_like(n)
    e[np.arange(len(n)), np.argmin(np.abs(n), axis=1)] = 1.0
    t = cross(n, e)
    t /= np.sqrt(dot(t, t))[:, None]
    return np.stack((t, cross(n, t)), axis=1)
