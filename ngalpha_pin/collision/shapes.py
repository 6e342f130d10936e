"""Convex shapes, described; what they offer to a contact is in the engine: `solid.hpp`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin import engine
from ngalpha_pin.collision.exposed import Exposed
from ngalpha_pin.collision.polytope import polytope
from ngalpha_pin.scene.meshes import hull_of_mesh


class Solid(Protocol):
    """A convex shape in the frame of its joint."""

    @property
    def centre(self) -> np.ndarray:
        """Middle of the shape, shape (3,)."""

    @property
    def size(self) -> float:
        """Diameter of a sphere about the centre that holds all of it [m]."""

    @property
    def exposed(self) -> Exposed | None:
        """What of it is surface beside other pieces of its body; None for all of it."""

    @property
    def native(self) -> Any:
        """The shape in the engine: its support, the feature at a point, a face, corners that may touch."""


@dataclass(frozen=True, eq=False)
class Round:
    """A sphere, a capsule or an ellipsoid: a point or a segment with a smooth surface around it."""

    centre: np.ndarray
    half: np.ndarray
    Q: np.ndarray
    r: float
    size: float
    exposed: None = None

    @cached_property
    def native(self) -> Any:
        """See `Solid`."""
        return engine.Solid.round(self.centre, self.half, self.Q, self.r, self.size)


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

    @cached_property
    def native(self) -> Any:
        """See `Solid`."""
        return engine.Solid.turned(np.array(self.ends), self.axis, *self.radii, self.r, self.centre, self.size)


@dataclass(frozen=True, eq=False)
class Wall:
    """A half-space, or a plane that is touched from both sides."""

    normal: np.ndarray
    centre: np.ndarray
    two_sided: bool
    size: float = np.inf
    exposed: None = None

    @cached_property
    def native(self) -> Any:
        """See `Solid`."""
        return engine.Solid.wall(self.normal, self.centre, self.two_sided)


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
