"""Discs that roll without slip on a plane, on a sphere or inside one.

The rim point nearest to the surface is x = c + R u, with u the direction of the surface within the disc. As seen from
the body of the surface, with its normal n there and the tangents t1 = d x u along the rim and t2 = n x t1, d the axis,

    g_dot = n.w    gamma = (t1.w, t2.w)    w = c_dot + omega x R u     the velocity of the body at the rim point
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.contact_points import Surface, surface_of
from ngalpha_pin.constraints.provider import Bodies, RowWrenches
from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.contact.reach import moved_by
from ngalpha_pin.errors import SceneError
from ngalpha_pin.numerics.spatial import force_cross, motion_cross, wrench
from ngalpha_pin.scene.constraints import RollingDisc

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene

COMPLEX_STEP = 1e-30  # imaginary part whose square is below rounding of every number


class Disc(NamedTuple):
    """A disc and its surface, each in the frame of its joint; `support` of both, each shape (nv,)."""

    name: str
    joint: int
    centre: np.ndarray
    axis: np.ndarray
    radius: float
    surface: Surface
    support: tuple[np.ndarray, np.ndarray]


class Discs:
    """The rolling discs of a scene; see `provider.Provider`."""

    everywhere = True

    def __init__(self, discs: list[Disc]):
        self._discs, n = discs, len(discs)
        self.names_g = tuple(disc.name for disc in discs)
        self.names_gamma = tuple(name for name in self.names_g for _ in range(2))
        self.group = np.concatenate((np.arange(n), n + np.repeat(np.arange(n), 2)))

    def rows(self, bodies: Bodies) -> DiscRows:
        """Rows at one motion."""
        return DiscRows([RimPoint(disc, bodies) for disc in self._discs])


class DiscRows:
    """Rows of `Discs` at one motion; attributes as those of `provider.ProviderRows`."""

    def __init__(self, points: list[RimPoint]):
        self._points = points
        self.g = np.array([point.g for point in points])
        self.W, self.rate, self.acceleration = (
            _by_level([getattr(point, name) for point in points]) for name in ("W", "rate", "acceleration")
        )
        self.sizes = max(point.sizes[0] for point in points), max(point.sizes[1] for point in points)

    @property
    def wrenches(self) -> RowWrenches:
        """What the rows do to bodies."""
        parts = [point.wrenches for point in self._points]
        return RowWrenches(*(_by_level([part[i] for part in parts]) for i in range(3)))

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each of the shape of W."""
        X, Y = zip(*(point.derivatives(motion) for point in self._points), strict=True)
        return _by_level(list(X)), _by_level(list(Y))


class RimPoint:
    """The three rows of one disc; attributes as those of `provider.ProviderRows`."""

    def __init__(self, disc: Disc, bodies: Bodies):
        self._disc, surface = disc, disc.surface
        R, p, motion = bodies.rotation, bodies.translation, bodies.motion
        a, b = surface.joint, disc.joint
        on_b, on_a = disc.support
        self._mask = on_b - on_a
        self.c, self._axis = R[b] @ disc.centre + p[b], R[b] @ disc.axis
        self._centre = R[a] @ surface.centre + p[a]
        self._normal = R[a] @ surface.normal
        self._offset = surface.offset + self._normal @ p[a]
        self._V_b, V_a = (motion.J * on_b) @ motion.v, (motion.J * on_a) @ motion.v
        self._V, self._V_a = self._V_b - V_a, V_a
        x, n, t1, t2, self.g = self._frame(self.c, self._axis)
        self._F = wrench(np.array([n, t1, t2]), np.array([x, x, x]))
        self.W = (self._F @ motion.J) * self._mask
        self.rate = self._F @ self._V
        A = (motion.dJ * self._mask) @ motion.v - motion_cross(V_a[None], self._V[None])[0]
        c_dot = self._V[:3] + np.cross(self._V[3:], self.c)
        self._own = self._second(c_dot, self._V[3:])
        self.acceleration = self.W @ motion.a + self._F @ A + self._own
        self.sizes = float(np.abs(self.c).max()) + disc.radius, float(np.abs(self._V).max())
        self._c_dot = c_dot

    @property
    def wrenches(self) -> RowWrenches:
        """What the rows do to bodies."""
        disc = self._disc
        return RowWrenches(self._F, np.full(3, disc.surface.joint), np.full(3, disc.joint))

    def _frame(self, c: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, ...]:
        """Rim point, normal, tangents and gap; complex numbers pass, vectors along the last axis."""
        surface, r = self._disc.surface, self._disc.radius
        e = -self._normal + 0 * c if surface.is_plane else surface.side * (self._centre - c)
        u = _unit(e - axis * _dot(axis, e))
        x = c + r * u
        if surface.is_plane:
            n, g = self._normal + 0 * c, _dot(self._normal, x) - self._offset
        else:
            arm = x - self._centre
            rho = np.sqrt(_dot(arm, arm))
            n, g = surface.side * arm / rho, surface.side * (rho - surface.radius)
        t1 = np.cross(axis, u)
        return x, n, t1, np.cross(n, t1), g[..., 0]

    def _second(self, c_dot: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """What the turning of F adds to the accelerations: those without spatial acceleration, shape (..., 3)."""
        surface, r, d = self._disc.surface, self._disc.radius, self._axis
        e = -self._normal if surface.is_plane else surface.side * (self._centre - self.c)
        e_dot = 0 * c_dot if surface.is_plane else -surface.side * c_dot
        d_dot = np.cross(omega, d)
        across = e - d * (d @ e)
        length = np.sqrt(across @ across)
        u = across / length
        turn = e_dot - d_dot * (d @ e) - d * (_dot(d_dot, e) + _dot(e_dot, d))
        u_dot = (turn - u * _dot(turn, u)) / length
        x, n, t1, t2, _ = self._frame(self.c, d)
        n_dot = 0 * c_dot
        if not surface.is_plane:
            x_dot = c_dot + r * u_dot
            n_dot = surface.side * (x_dot - n * _dot(x_dot, n)) / np.sqrt((x - self._centre) @ (x - self._centre))
        t1_dot = np.cross(d_dot, u) + np.cross(d, u_dot)
        t2_dot = np.cross(n_dot, t1) + np.cross(n, t1_dot)
        w = c_dot + np.cross(omega, r * u)
        w_dot = np.cross(omega, c_dot) + np.cross(omega, r * u_dot)
        pairs = ((n, n_dot), (t1, t1_dot), (t2, t2_dot))
        return np.concatenate([_dot(w_dot, y) + _dot(w, y_dot) for y, y_dot in pairs], axis=-1)

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each shape (3, nv); exact, by complex steps."""
        step, V = 1j * COMPLEX_STEP * np.eye(3), self._V
        still = np.zeros((3, 3))
        # the rate with the spatial velocity held, by the centre and by a rotation of the disc
        c = self.c + np.vstack((step, still))
        axis = self._axis + np.vstack((still, np.cross(step, self._axis)))
        x, *vectors, _ = self._frame(c, axis)
        at_x = V[:3] + np.cross(V[3:], x)
        by_pose = np.concatenate([_dot(y, at_x) for y in vectors], axis=-1).imag.T / COMPLEX_STEP
        by_twist = self._second(self._c_dot + np.vstack((step, still)), V[3:] + np.vstack((still, step)))
        by_twist = by_twist.imag.T / COMPLEX_STEP
        centres, three = np.repeat(self.c[None], 3, axis=0), np.ones((3, 1))
        by_b = force_cross(three * self._V_b, self._F)
        G_X = by_b + wrench(by_pose[:, :3], centres)
        G_Y = by_b + force_cross(three * self._V_a, self._F) + wrench(by_twist[:, :3], centres)
        G_X[:, 3:] += by_pose[:, 3:]
        G_Y[:, 3:] += by_twist[:, 3:]
        X = (G_X @ motion.J + self._F @ (motion.dAdv - motion.dJ)) * self._mask
        Y = (G_Y @ motion.J + self._F @ motion.dAdv) * self._mask
        return X, Y


def discs(scene: Scene, model: pin.Model) -> Discs | None:
    """The rolling discs of a scene; None where it has none."""
    found = []
    for constraint in scene.constraints:
        if not isinstance(constraint, RollingDisc):
            continue
        body, ground = scene.geometry(constraint.body), scene.geometry(constraint.surface)
        surface = surface_of(ground, ground.name in scene.hollow)
        if not isinstance(body.geometry, coal.Cylinder):
            raise SceneError(f"{constraint.name}: {constraint.body!r} must be a coal.Cylinder")
        if surface is None or surface.axis.any():
            raise SceneError(f"{constraint.name}: a disc rolls on a half-space or on a sphere, not on {ground.name!r}")
        joint, radius = int(body.parentJoint), float(body.geometry.radius)
        if surface.side < 0 and radius >= surface.radius:
            raise SceneError(f"{constraint.name}: the disc does not fit into {ground.name!r}")
        place, support = body.placement, (moved_by(model, joint), moved_by(model, surface.joint))
        found.append(
            Disc(
                constraint.name, joint, place.translation.copy(), place.rotation[:, 2].copy(), radius, surface, support
            )
        )
    return Discs(found) if found else None


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scalar product along the last axis, which is kept; complex numbers are not conjugated."""
    return (a * b).sum(axis=-1, keepdims=True)


def _unit(a: np.ndarray) -> np.ndarray:
    return a / np.sqrt(_dot(a, a))


def _by_level(parts: list[np.ndarray]) -> np.ndarray:
    """Rows of all discs: those of g, then those of gamma."""
    return np.concatenate([part[:1] for part in parts] + [part[1:] for part in parts])
