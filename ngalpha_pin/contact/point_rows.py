"""Contact kinematics to second order: g_N, W_N, W_F, their rates and the derivatives that the Newton matrix needs.

Everything is a world wrench F = (d, c x d + q) against the motion of body B relative to the surface of body A, so
that W^T = F J with Pinocchio's world Jacobian columns J, for all contacts in a few matrix products. With the sphere
centre c, its velocity c_dot and the angular velocity omega relative to A (axes of the world, derivatives as seen from
A), the gap function G(c) of the surface, its normal n = dG/dc and curvature H = d^2G/dc^2:

    g_N = G(c) - r      g_N_dot = n.c_dot      g_N_ddot = n.c_ddot + c_dot.H c_dot
    gamma_F = t.w       w = c_dot - r omega x n                                         (148), (151), (157)
    gamma_F_dot = t.w_dot - (t.H c_dot)(n.w)         with tangents t carried along in parallel
    drilling: gamma_F = 3 pi R / 16 n.omega                                             (157)
    rolling with a lever l: gamma_F = l t.omega

Friction of a compliant contact acts where the surface of A was before it gave way: with r + g_N in place of r, so that
the corners of a flat body slip in one plane however it tilts. That adds -g_N_dot t.(omega x n) to gamma_F_dot.

so that q = -r n x t on a tangent row, 3 pi R / 16 n (with d = 0) on a drilling row, l t (with d = 0) on a row of
rolling, and 0 on a normal row.

Compiled twin: engine/kernel/rows.c.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.contact.moving_surfaces import Slip, surface_accelerations, surface_rates
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.numerics.spatial import cross, dot, force_cross, motion_cross, wrench

# distance from the axis of a curved surface, in parts of its radius, below which there is no normal
ON_AXIS = 1e-12


class Motion(NamedTuple):
    """A motion as Pinocchio left it in its data: world Jacobian columns, their rates, and what they act on.

    Attributes:
        J, dJ: `data.J`, `data.dJ`, shape (6, nv).
        dAdv: `data.dAdv`, the derivative of spatial accelerations by v, shape (6, nv).
        v, a: velocity and acceleration, shape (nv,).
        t: time [s]; without it nothing is known of surfaces that move along themselves.
    """

    J: np.ndarray
    dJ: np.ndarray
    dAdv: np.ndarray
    v: np.ndarray
    a: np.ndarray
    t: float = np.nan

    def project(self, F: np.ndarray, sub: Subset) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """Wrenches and the motion of the tree.

        Args:
            F: wrench at the world origin of every row, (linear, angular), shape (k + m, 6).
            sub: their contacts.

        Returns:
            W, shape (k + m, nv); W_dot v without what the change of F adds, shape (k + m,); twists of the bodies B and
            A of every contact, (linear at the world origin, angular), shape (k, 6) each.
        """
        wide = (F @ np.concatenate((self.J, self.dJ), axis=1)).reshape(-1, 2, len(self.v))
        wide *= sub.mask[:, None]
        V = ((self.J * self.v) @ sub.support_T).T
        return wide[:, 0], wide[:, 1] @ self.v, (V[sub.body_b], V[sub.body_a])

    def rates(self, W: np.ndarray, sub: Subset) -> np.ndarray:
        """W v, shape (rows,)."""
        return W @ self.v

    def accelerations(self, W: np.ndarray, sub: Subset) -> np.ndarray:
        """W a, shape (rows,)."""
        return W @ self.a

    def times(self, sub: Subset) -> np.ndarray:
        """Time of every contact, shape (k,) [s]."""
        return np.full(sub.k, self.t)


class Moves(Protocol):
    """A motion, or several at once, that rows are taken along with; see `Motion`."""

    def project(self, F: np.ndarray, sub: Subset) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """See `Motion`."""

    def rates(self, W: np.ndarray, sub: Subset) -> np.ndarray:
        """See `Motion`."""

    def accelerations(self, W: np.ndarray, sub: Subset) -> np.ndarray:
        """See `Motion`."""

    def times(self, sub: Subset) -> np.ndarray:
        """See `Motion`."""


class KinematicRows(Protocol):
    """Rows of one kind: of contacts, joint friction or constraints.

    Attributes:
        W: generalized force directions, transposed, shape (rows, nv).
        rate, acceleration: rates of position-level rows or velocity-level quantities, and their derivatives by time.
        sizes: of the positions and of the velocities that the rows subtract, whose rounding is felt [m], [m/s].
    """

    W: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray

    @property
    def sizes(self) -> tuple[float, float]:
        """See above."""

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each of the shape of W."""


class Rows:
    """Kinematic rows of a subset: the gaps at once, the rest by `move`, the derivatives by `derivatives`.

    Args:
        sub: the contacts.
        rotation, translation: pose of every body of the subset, arrays of shape (3, 3) and (3,).

    Attributes:
        g_N: gaps, shape (k,) [m].
        normals: world vectors, shape (k, 3).
        W: W_N^T and below it W_F^T, shape (k + m, nv).
        c, c_dot: centres of the contact spheres and their velocities, shape (k, 3).
        directions: world vectors d of all rows, shape (k + m, 3); zero for drilling.
        rate: g_N_dot (42) and gamma_F, shape (k + m,) [m/s].
        acceleration: g_N_ddot (58) and gamma_F_dot (119), shape (k + m,) [m/s^2].
        driven: what moving surfaces add to the friction rows, None where none moves.
    """

    driven: Slip | None = None

    def __init__(
        self, sub: Subset, rotation: Sequence[np.ndarray] | np.ndarray, translation: Sequence[np.ndarray] | np.ndarray
    ):
        self.sub = sub
        R, p = np.array(rotation).reshape(-1, 3, 3), np.array(translation).reshape(-1, 3)
        if sub.surfaces is not None:
            self._surfaces = sub.surfaces.placed(R, p, sub.body_a, sub.body_b)
        self.c = c = np.matmul(R[sub.body_b], sub.point[:, :, None])[:, :, 0] + p[sub.body_b]
        if sub.fixed_planes:
            self.normals, self.directions, self._q = sub.normal, sub.fixed_d, sub.fixed_q
            self.g_N = dot(sub.normal, c) - sub.offset - sub.radius
        else:
            self._surface(R[sub.body_a], p[sub.body_a], R[sub.body_b])

    def _surface(self, R_a: np.ndarray, p_a: np.ndarray, R_b: np.ndarray) -> None:
        """Gap, frame and curvature of surfaces that move or are round."""
        sub = self.sub
        x = np.einsum("kji,kj->ki", R_a, self.c - p_a)  # centre in the frame of A
        arm = np.einsum("kij,kj->ki", sub.projector, x - sub.centre)
        rho = np.sqrt(dot(arm, arm))
        # on the axis of a hollow shape there is no normal; the contact is far from closing there
        safe = np.maximum(rho, ON_AXIS * sub.surface_radius) + ~sub.curved
        n = np.where(sub.curved[:, None], (sub.side / safe)[:, None] * arm, sub.normal)
        G = np.where(sub.curved, sub.side * (rho - sub.surface_radius), dot(sub.normal, x) - sub.offset)
        # past the end of a cylinder its lateral surface ends, and the contact is open
        beyond = np.abs(dot(sub.axis, x - sub.centre)) - sub.half_length
        G = np.where(beyond > 0, np.maximum(G, sub.radius + beyond), G)
        self.g_N = G - sub.radius
        H = (sub.curved * sub.side / safe)[:, None, None] * (sub.projector - n[:, :, None] * n[:, None, :])
        self._H = R_a @ H @ R_a.transpose(0, 2, 1)
        self.normals = np.einsum("kij,kj->ki", R_a, n)
        t = sub.tangent
        if sub.any_curved:
            t1 = cross(sub.tangent[:, 0], n)
            t1 /= np.maximum(np.sqrt(dot(t1, t1)), TINY)[:, None]
            t = np.where(sub.curved[:, None, None], np.stack((t1, cross(n, t1)), axis=1), t)
        t = np.einsum("kij,klj->kli", R_a, t)
        if sub.axes is not None:
            t, turning = sub.axes.tangents(t, self.normals, R_a, R_b)
            # theta' = K.V: dn = H dc, dc = delta + phi x c
            by_c = np.einsum("kij,kj->ki", self._H, turning.by_n)
            self._K = wrench(by_c, self.c) + np.concatenate((np.zeros_like(by_c), turning.by_phi), axis=1)
        self._arm = sub.radius.copy()
        self._arm[sub.soft] += self.g_N[sub.soft]
        self.directions, self._q = sub.row_vectors(self.normals, t, self._arm)
        self._rolls = sub.along_tangents(t)[1]

    def move(self, motion: Moves) -> Rows:
        """Add the rows and their rates at a velocity and an acceleration."""
        sub, d, of = self.sub, self.directions, self.sub.of_row
        self.F = F = np.empty((len(d), 6))
        F[:, :3] = d
        F[:, 3:] = cross(self.c[of], d) + self._q
        self.W, bias, (self._V_b, self._V_a) = motion.project(F, sub)
        self.rate = motion.rates(self.W, sub)
        self._V = self._V_b - self._V_a if sub.moving_surface else self._V_b
        self._omega = omega = self._V[:, 3:]
        self.c_dot = self._V[:, :3] + cross(omega, self.c)
        self._turn = cross(self.c_dot[of], d)
        bias += dot(self._turn, omega[of])
        if sub.moving_surface:
            bias -= dot(F, motion_cross(self._V_a, self._V)[of])
        if sub.any_curved:
            bias += self._curvature()
        if len(sub.soft):
            self._tilts = self._tilting()
            bias[sub.k :] -= self._tilts * self.rate[: sub.k][sub.of_F]
        self.acceleration = motion.accelerations(self.W, sub) + bias
        if sub.surfaces is not None:
            given = motion.times(sub), self._surfaces, F[sub.k :], sub.of_F, self._V
            self.driven = sub.surfaces.slip(*given, self._turned)
            self.rate[sub.k :] += self.driven.rate
            self.acceleration[sub.k :] += self.driven.acceleration
        if sub.turns is not None:
            self.acceleration[sub.k :] += self._theta_dot[sub.of_F] * sub.turns.turned(self.rate[sub.k :])
        return self

    @property
    def _theta_dot(self) -> np.ndarray:
        """With which tangents along ellipses turn about the normals (see `friction_axes`), shape (k,) [rad/s]."""
        return dot(self._K, self._V)

    def _turned(self, X: np.ndarray) -> np.ndarray:
        """D^T X of the friction rows (see `moving_surfaces`), shape (m, 6)."""
        sub, o, d = self.sub, self.sub.of_F, self.directions[self.sub.k :]
        e, omega = cross(d, X[o, 3:]), X[o, 3:]
        if sub.any_curved:
            n, c = self.normals[o], self.c[o]
            by_n = sub.drill_F[:, None] * omega - self._arm[o, None] * e
            by_n -= dot(n, X[o, :3] + cross(omega, c))[:, None] * d + dot(n, omega)[:, None] * self._rolls
            e = e + np.einsum("kij,kj->ki", self._H[o], by_n)
        return wrench(e, self.c[o])

    def _tilting(self) -> np.ndarray:
        """t.(omega x n) of the friction rows of compliant contacts, zero for others and for drilling, shape (m,)."""
        sub, o = self.sub, self.sub.of_F
        along = dot(self.directions[sub.k :], cross(self._omega[o], self.normals[o]))
        return np.asarray(np.where(np.isin(o, sub.soft), along, 0.0))

    def _curvature(self) -> np.ndarray:
        """What the turning of the normal adds to the accelerations of all rows, shape (k + m,)."""
        sub, k, o = self.sub, self.sub.k, self.sub.of_F
        omega, d_F = self._omega, self.directions[self.sub.k :]
        self._h = h = np.einsum("kij,kj->ki", self._H, self.c_dot)  # rate of the normal
        tangent = -self._arm[o] * dot(d_F, cross(omega, h)[o]) - dot(d_F, h[o]) * self.rate[:k][o]
        tangent += sub.drill_F * dot(h, omega)[o] - dot(self._rolls, h[o]) * dot(self.normals, omega)[o]
        return np.concatenate((dot(self.c_dot, h), tangent))

    @property
    def surface_rate(self) -> np.ndarray:
        """The part of `rate` that moving surfaces make, shape (k + m,) [m/s]."""
        return surface_rates(self.driven, self.sub.k, self.sub.m)

    @property
    def surface_acceleration(self) -> np.ndarray:
        """Its derivative by time, shape (k + m,) [m/s^2]."""
        return surface_accelerations(self.driven, self.sub.k, self.sub.m)

    @property
    def sizes(self) -> tuple[float, float]:
        """Largest coordinate of the centres and of their velocities [m], [m/s]."""
        return float(np.abs(self.c).max()), float(np.abs(self.c_dot).max())

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each shape (k + m, nv)."""
        sub, of, d, F = self.sub, self.sub.of_row, self.directions, self.F
        omega = self._omega[of]
        G_X, G_Y = np.zeros((len(d), 6)), np.zeros((len(d), 6))
        if sub.fixed_planes:
            G_X[:, 3:] = self._turn + cross(omega, self._q)
            G_Y[:, 3:] = G_X[:, 3:] + self._turn
        else:
            by_b = force_cross(self._V_b[of], F)
            e_X, e_Y, spin_Y = self._gradients(omega)
            G_X = by_b + wrench(e_X, self.c[of])
            G_Y = by_b + force_cross(self._V_a[of], F) + wrench(e_Y, self.c[of])
            G_Y[:, 3:] += spin_Y
        if self.driven is not None:
            G_X[sub.k :] += self.driven.gradient
            G_Y[sub.k :] += self.driven.gradient
        if sub.turns is not None:
            by_theta = sub.turns.turned(self.rate[sub.k :])[:, None] * self._K[sub.of_F]
            G_X[sub.k :] += by_theta
            G_Y[sub.k :] += by_theta + self._theta_dot[sub.of_F, None] * sub.turns.turned(F[sub.k :])
        if len(sub.soft):
            o, soft = sub.of_F, np.isin(sub.of_F, sub.soft)
            normal = self._tilts[:, None] * F[: sub.k][o]
            G_X[sub.k :] -= normal
            G_Y[sub.k :] -= normal
            by_spin = self.rate[: sub.k][o, None] * cross(self.normals[o], d[sub.k :])
            G_Y[sub.k :, 3:] -= by_spin * soft[:, None]
        dVdq = motion.dAdv - motion.dJ
        X = (G_X @ motion.J + F @ dVdq) * sub.mask
        Y = (G_Y @ motion.J + F @ motion.dAdv) * sub.mask
        return X, Y

    def _gradients(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gradients of `rate` by c, and of `acceleration` by c_dot and by omega, each shape (k + m, 3)."""
        sub, k, o, d = self.sub, self.sub.k, self.sub.of_F, self.directions
        e = cross(d, omega)
        spin = self._turn
        if not sub.any_curved:
            return e, e, spin
        h, d_F, g_N_dot = self._h, d[k:], self.rate[:k]
        H_F = self._H[o]
        along = np.einsum("kij,kj->ki", H_F, self._arm[o, None] * e[k:] + g_N_dot[o, None] * d_F)
        # of drilling, and of rolling, whose tangent turns with the normal: dt = -n (t.dn)
        spinning = dot(self.normals[o], omega[k:])[:, None] * self._rolls
        drill = np.einsum("kij,kj->ki", H_F, sub.drill_F[:, None] * omega[k:] - spinning)
        e_X = e + np.concatenate((h, drill - along))
        e_Y = e + np.concatenate((2 * h, drill - along - dot(d_F, h[o])[:, None] * self.normals[o]))
        spin = spin + np.concatenate(
            (np.zeros((k, 3)), sub.drill_F[:, None] * h[o] - self._arm[o, None] * cross(h[o], d_F))
        )
        spin[k:] -= dot(self._rolls, h[o])[:, None] * self.normals[o]
        return e_X, e_Y, spin
