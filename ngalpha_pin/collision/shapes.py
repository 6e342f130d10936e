"""Convex shapes and what they offer to a contact: support, the feature at a point, a face, corners that may touch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.exposed import Exposed
from ngalpha_pin.collision.features import ALIGNED, ON, Corners, Face, Feature, Look, face, line, rim, tangents
from ngalpha_pin.collision.polytope import polytope
from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.scene.meshes import hull_of_mesh

# cosine between normal and axis from which the edge of a cap may come to rest as a whole
STANDS = 0.8
# sine of the inclination below which the lowest point of a rim is not followed, and below which there is none
FLAT, UPRIGHT = 1e-6, 1e-9
CAP_CORNERS = 24  # of the polygon that a cap is for what lies on it


class Solid(Protocol):
    """A convex shape in the frame of its joint; directions m are outward unit vectors there."""

    @property
    def centre(self) -> np.ndarray:
        """Middle of the shape, shape (3,)."""

    @property
    def size(self) -> float:
        """Diameter of a sphere about the centre that holds all of it [m]."""

    @property
    def exposed(self) -> Exposed | None:
        """What of it is surface beside other pieces of its body; None for all of it."""

    def support(self, m: np.ndarray) -> np.ndarray:
        """The farthest point in the direction m, shape (3,)."""

    def feature_at(self, p: np.ndarray, m: np.ndarray) -> Feature:
        """The feature that the point p of the surface belongs to."""

    def face(self, m: np.ndarray, aligned: float = ALIGNED) -> Face | None:
        """The flat side whose normal has a cosine above `aligned` with m, if there is one."""

    def corners(self, m: np.ndarray, look: Look) -> Corners:
        """Features that may touch a plane with the normal -m."""


@dataclass(frozen=True, eq=False)
class Round:
    """A sphere, a capsule or an ellipsoid: a point or a segment with a smooth surface around it."""

    centre: np.ndarray
    half: np.ndarray
    Q: np.ndarray
    r: float
    size: float
    exposed: None = None

    def support(self, m: np.ndarray) -> np.ndarray:
        """See `Solid`."""
        return self._end(np.sign(self.half @ m)).support(m)

    def feature_at(self, p: np.ndarray, m: np.ndarray) -> Feature:
        """See `Solid`."""
        length = float(np.sqrt(self.half @ self.half))
        if length == 0.0:
            return self._end(0.0)
        along = (p - self.centre) @ self.half / length**2
        if abs(along) >= 1.0:
            return self._end(np.sign(along))
        return line(self.centre + along * self.half, self.half / length, self.r)

    def face(self, m: np.ndarray, aligned: float = ALIGNED) -> Face | None:
        """See `Solid`."""
        return None

    def corners(self, m: np.ndarray, look: Look) -> Corners:
        """See `Solid`."""
        return Corners.of([self._end(s) for s in ((-1.0, 1.0) if self.half.any() else (0.0,))])

    def _end(self, sign: float) -> Feature:
        return Feature(self.centre + sign * self.half, Q=self.Q, r=self.r)


@dataclass(frozen=True, eq=False)
class Turned:
    """A cylinder or a cone: discs about an axis, the second one of radius zero for a cone, and their hull."""

    ends: tuple[np.ndarray, np.ndarray]
    axis: np.ndarray
    radii: tuple[float, float]
    r: float
    centre: np.ndarray
    size: float
    exposed: None = None

    def support(self, m: np.ndarray) -> np.ndarray:
        """See `Solid`."""
        points = [self._rim(i).support(m) for i in (0, 1)]
        return max(points, key=lambda x: float(m @ x))

    def feature_at(self, p: np.ndarray, m: np.ndarray) -> Feature:
        """See `Solid`."""
        core = p - self.r * m
        height = float((core - self.ends[0]) @ self.axis)
        length = float((self.ends[1] - self.ends[0]) @ self.axis)
        near, rho = ON * self.size, core - self.ends[0] - height * self.axis
        distance = float(np.sqrt(rho @ rho))
        for i, z, sign in ((0, height, -1.0), (1, length - height, 1.0)):
            if z < near:
                if self.radii[i] == 0.0:
                    return Feature(self.ends[i], r=self.r)
                inside = distance < self.radii[i] - near and m @ self.axis * sign > STANDS
                return face(self.ends[i], sign * self.axis, self.r) if inside else self._rim(i)
        if self.radii[0] == self.radii[1]:
            return line(self.ends[0] + height * self.axis, self.axis, self.radii[0] + self.r)
        # the side of a cone: the cylinder that has its curvature there, about an axis through the point below it
        out = rho / max(distance, TINY)
        slope = (self.radii[0] - self.radii[1]) / length
        normal = (out + slope * self.axis) / np.sqrt(1 + slope**2)
        radius = (self.radii[0] - slope * height) * np.sqrt(1 + slope**2)
        on_side = self.ends[0] + height * self.axis + (self.radii[0] - slope * height) * out
        generator = (self.axis - slope * out) / np.sqrt(1 + slope**2)
        return line(on_side - radius * normal, generator, radius + self.r)

    def face(self, m: np.ndarray, aligned: float = ALIGNED) -> Face | None:
        """See `Solid`."""
        along = float(m @ self.axis)
        i = int(along > 0.0)
        if abs(along) < aligned or self.radii[i] == 0.0:
            return None
        normal = self.axis if i else -self.axis
        return Face(face(self.ends[i], normal, self.r), normal, self._circle(i, normal, CAP_CORNERS))

    def corners(self, m: np.ndarray, look: Look) -> Corners:
        """See `Solid`."""
        along = float(m @ self.axis)
        across = m - along * self.axis
        sine = float(np.sqrt(across @ across))
        found: list[Feature] = []
        for i, sign in ((0, -1.0), (1, 1.0)):
            if self.radii[i] == 0.0:
                found.append(Feature(self.ends[i], r=self.r))
            elif along * sign >= -STANDS:
                found += self._points_of_rim(i, across, sine, along * sign > STANDS, look)
        return Corners.of(found)

    def _points_of_rim(self, i: int, across: np.ndarray, sine: float, stands: bool, look: Look) -> list[Feature]:
        """The lowest point of a rim and, where the shape nearly stands on it, four that are fixed in the body.

        So it stands on the same points whatever is below them, pieces of a floor for example.
        """
        found, centre, radius = [], self.ends[i], self.radii[i]
        if sine > UPRIGHT:
            # the lowest point runs around the rim: it is followed where a step resolves that
            turn = np.inf if look.turn is None else float(np.linalg.norm(np.cross(look.turn, self.axis)))
            lowest = Feature(centre + radius * across / sine, r=self.r)
            found.append(self._rim(i) if sine > max(2.0 * turn, FLAT) else lowest)
        if stands:
            t1, t2 = tangents(self.axis)
            found += [Feature(centre + radius * d, r=self.r) for d in (t1, t2, -t1, -t2)]
        return found

    def _rim(self, i: int) -> Feature:
        return rim(self.ends[i], self.axis, self.radii[i], self.r)

    def _circle(self, i: int, normal: np.ndarray, n: int) -> np.ndarray:
        angle = np.arange(n)[:, None] * 2 * np.pi / n
        t1, t2 = tangents(normal)
        return self.ends[i] + self.radii[i] * (np.cos(angle) * t1 + np.sin(angle) * t2)


@dataclass(frozen=True, eq=False)
class Wall:
    """A half-space, or a plane that is touched from both sides."""

    normal: np.ndarray
    centre: np.ndarray
    two_sided: bool
    size: float = np.inf
    exposed: None = None

    def support(self, m: np.ndarray) -> np.ndarray:
        """See `Solid`; for m along the normal."""
        return self.centre

    def feature_at(self, p: np.ndarray, m: np.ndarray) -> Feature:
        """See `Solid`."""
        return face(self.centre, self.normal)

    def face(self, m: np.ndarray, aligned: float = ALIGNED) -> Face | None:
        """See `Solid`."""
        normal = -self.normal if self.two_sided and m @ self.normal < 0.0 else self.normal
        return Face(face(self.centre, normal), normal, None)

    def corners(self, m: np.ndarray, look: Look) -> Corners:
        """See `Solid`."""
        return Corners.of([])


def solid(geometry: pin.GeometryObject) -> Solid | None:
    """The solid of a geometry in the frame of its joint, or None where there is none."""
    shape, pose = geometry.geometry, geometry.placement
    if isinstance(shape, coal.BVHModelBase):
        return polytope(np.array(hull_of_mesh(shape, geometry.name).points()), 0.0, pose)
    if not isinstance(shape, coal.ShapeBase):
        return None
    swept, c, axis = float(shape.getSweptSphereRadius()), pose.translation.copy(), pose.rotation[:, 2].copy()
    if isinstance(shape, (coal.Halfspace, coal.Plane)):
        normal = pose.rotation @ np.array(shape.n)
        two_sided = isinstance(shape, coal.Plane)
        return Wall(normal, c + (float(shape.d) + (0.0 if two_sided else swept)) * normal, two_sided)
    zero, flat = np.zeros(3), np.zeros((3, 3))
    if isinstance(shape, coal.Sphere):
        return Round(c, zero, flat, float(shape.radius) + swept, 2 * float(shape.radius + swept))
    if isinstance(shape, coal.Capsule):
        half = float(shape.halfLength) * axis
        return Round(c, half, flat, float(shape.radius) + swept, 2 * float(shape.radius + swept + shape.halfLength))
    if isinstance(shape, coal.Ellipsoid):
        semi_axes = np.array(shape.radii)
        Q = pose.rotation @ np.diag(semi_axes**2) @ pose.rotation.T
        return Round(c, zero, Q, swept, 2 * float(semi_axes.max() + swept))
    if isinstance(shape, (coal.Cylinder, coal.Cone)):
        half, radius = float(shape.halfLength) * axis, float(shape.radius)
        radii = (radius, radius if isinstance(shape, coal.Cylinder) else 0.0)
        return Turned(
            (c - half, c + half), axis, radii, swept, c, 2 * float(np.hypot(radius, shape.halfLength) + swept)
        )
    if isinstance(shape, coal.Box):
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
        return polytope(signs * np.array(shape.halfSide), swept, pose)
    if isinstance(shape, coal.TriangleP):
        return polytope(np.array([shape.a, shape.b, shape.c]), swept, pose)
    if isinstance(shape, coal.ConvexBase):
        return polytope(np.array(shape.points()), swept, pose)
    return None
