"""Pairs of shapes to contacts.

Where one side is a half-space, a sphere or a hollow shape, most contacts are a small sphere (a point where its radius
is zero) that is fixed in one body, against a surface that is fixed in another one: a sphere gives one such point, a
capsule two, a box or a convex its vertices. Of all other pairs, and of shapes with many corners in one face, the
touching features change, see `manifold`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.polytope import largest_face
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.contact import ContactLaw, ContactPair
from ngalpha_pin.scene.friction_ellipse import PlacedEllipse, placed_ellipse
from ngalpha_pin.scene.meshes import hull_of_mesh
from ngalpha_pin.scene.pending_meshes import loaded
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.scene.surface_velocity import MovingSurface, moving_surface
from ngalpha_pin.scene.welds import pairs_apart

# a shape with more corners than the first in one face, and more than the second of all its corners, rests on four of
# them, which are chosen in every step: all of them as unknowns would be dependent, and steps slow. Of other shapes with
# many corners, which are round, few close at a time, so that any number of them are points
FACE_CORNERS, FACE_SHARE = 16, 0.2


@dataclass(frozen=True)
class Surface:
    """The smooth surface of one side, in the frame of its joint.

    Attributes:
        joint: index of the joint it moves with, 0 for the world.
        normal: unit normal of a plane, shape (3,); zero for a round surface.
        offset: of a plane, normal . x = offset on the surface [m].
        centre: point of a sphere or on the axis of a cylinder, shape (3,) [m].
        axis: unit vector of a cylinder, shape (3,); zero for a sphere.
        radius: of a sphere or cylinder [m].
        half_length: of a cylinder [m]; contact ends there.
        side: +1 is touched from the outside, -1 from the inside.
    """

    joint: int
    normal: np.ndarray
    offset: float
    centre: np.ndarray
    axis: np.ndarray
    radius: float
    half_length: float
    side: float

    @property
    def is_plane(self) -> bool:
        """A half-space, not a round surface."""
        return bool(self.normal.any())


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """The contacts of one pair: spheres of one radius >= 0 fixed in `joint`, against a surface, with their law.

    Attributes:
        names: of each of k contacts, e.g. "ball/ground" or "box[3]/ground".
        joint: index of the joint that the points move with.
        points: their centres in the frame of that joint, shape (k, 3) [m].
        in_shape: the same in the frame of their geometry.
        radius: [m].
        surface: the other side.
        law: mu, e_N, e_F, contact radius.
        moving: which of the two surfaces moves along itself, or None.
        ellipse: of friction, or None.
    """

    names: tuple[str, ...]
    joint: int
    points: np.ndarray
    in_shape: np.ndarray
    radius: float
    surface: Surface
    law: ContactLaw
    moving: MovingSurface | None = None
    ellipse: PlacedEllipse | None = None


class Sides:
    """The geometries of a scene by name, and the surfaces that they offer to a contact point."""

    def __init__(self, scene: Scene):
        self._scene, self._hollow = scene, scene.hollow
        self._geometry = cache(partial(loaded, scene.declared_shapes))  # which loads those that are asked for
        self._surfaces: dict[str, Surface | None] = {}

    def points(self, pair: ContactPair) -> ContactPoints | None:
        """Points fixed in a body for one pair, or None where there is no such description.

        Raises:
            SceneError: the body does not fit into a hollow shape.
        """
        a, b = self._geometry(pair.geometry_a), self._geometry(pair.geometry_b)
        for body, other in ((a, b), (b, a)):
            surface = self._surface(other)
            if surface is None or body.name in self._hollow:
                continue
            spheres = _spheres(body, surface)
            if spheres is None:
                continue
            points, radius = spheres
            _check_fit(radius, surface, body.name, other.name)
            indices = [""] if len(points) == 1 else [f"[{i}]" for i in range(len(points))]
            ends = (a.name, "/" + b.name) if body is a else (f"{a.name}/{b.name}", "")
            names = tuple(f"{ends[0]}{i}{ends[1]}" for i in indices)
            joint, pose = int(body.parentJoint), body.placement
            moving = moving_surface(pair.law.surface_velocity, b, body is b)
            ellipse = placed_ellipse(self._scene, pair.law, (a, b), body)
            # entry by entry: a product of matrices may round in another way, and other points with it
            placed = (pose.rotation * points[:, None, :]).cumsum(axis=2)[:, :, 2] + pose.translation
            return ContactPoints(names, joint, placed, points, radius, surface, pair.law, moving, ellipse)
        return None

    def _surface(self, geometry: pin.GeometryObject) -> Surface | None:
        name = geometry.name
        if name not in self._surfaces:
            self._surfaces[name] = surface_of(geometry, name in self._hollow)
        return self._surfaces[name]


def contact_points(scene: Scene) -> tuple[list[ContactPoints], list[ContactPair]]:
    """The contacts of a scene that are points fixed in a body, by pair, and the pairs that are left.

    Raises:
        SceneError: a pair cannot touch at all.
    """
    points: list[ContactPoints] = []
    others: list[ContactPair] = []
    of_beams, sides = {point.name for point in scene.beam_points}, Sides(scene)
    for pair in scene.contacts:
        if scene.beams and pair.law.adhesion > 0.0:
            raise SceneError(
                f"contact of {pair.geometry_a!r} with {pair.geometry_b!r}: adhesion is not available in a scene with "
                "beams"
            )
    for pair in pairs_apart(scene):
        found = sides.points(pair)
        if of_beams & {pair.geometry_a, pair.geometry_b}:
            if found is None:
                raise SceneError(
                    f"contact of {pair.geometry_a!r} with {pair.geometry_b!r}: points of beams touch half-spaces, "
                    "spheres and the lateral surface of cylinders"
                )
            points.append(found)
            continue
        # from outside, a cylinder can be touched at its ends as well
        outside = found is not None and found.surface.side > 0
        if found is None or (outside and (found.surface.axis.any() or _rests_on_faces(found))):
            if pair.law.compliance is not None:
                raise SceneError(
                    f"contact of {pair.geometry_a!r} with {pair.geometry_b!r}: compliant are spheres and corners "
                    "against half-spaces, spheres and hollow shapes, and points of beams; leave the compliance out"
                )
            others.append(pair)
        else:
            points.append(found)
    return points, others


def _rests_on_faces(found: ContactPoints) -> bool:
    """Many of the corners lie in one plane, as those of a wheel, a coin or a flat foot from a mesh."""
    n = len(found.points)
    if n <= FACE_CORNERS:
        return False
    return largest_face(found.in_shape) > max(FACE_CORNERS, FACE_SHARE * n)


def pair_points(scene: Scene, pair: ContactPair) -> ContactPoints | None:
    """Points fixed in a body for one pair, or None where there is no such description."""
    return Sides(scene).points(pair)


def _check_fit(radius: float, surface: Surface, body: str, other: str) -> None:
    if surface.side < 0 and radius >= surface.radius:
        raise SceneError(f"{body!r} does not fit into the hollow {other!r}: its radius must be smaller")


def surface_of(geometry: pin.GeometryObject, hollow: bool) -> Surface | None:
    """The surface a geometry offers to a contact point, or None."""
    shape, placement = geometry.geometry, geometry.placement
    joint, zero = int(geometry.parentJoint), np.zeros(3)
    swept = float(shape.getSweptSphereRadius()) if isinstance(shape, coal.ShapeBase) else 0.0
    if isinstance(shape, coal.Halfspace):
        normal = placement.rotation @ np.array(shape.n)
        offset = float(shape.d) + swept + float(normal @ placement.translation)
        return Surface(joint, normal, offset, zero, zero, 0.0, np.inf, 1.0)
    side = -1.0 if hollow else 1.0
    if isinstance(shape, coal.Sphere):
        radius = float(shape.radius) + side * swept
        return Surface(joint, zero, 0.0, placement.translation.copy(), zero, radius, np.inf, side)
    if isinstance(shape, coal.Cylinder):
        radius = float(shape.radius) + side * swept
        axis, half = placement.rotation[:, 2].copy(), float(shape.halfLength)
        return Surface(joint, zero, 0.0, placement.translation.copy(), axis, radius, half, side)
    return None


def _spheres(geometry: pin.GeometryObject, surface: Surface) -> tuple[np.ndarray, float] | None:
    """Centres (k, 3) of the contact points of a shape in its own frame, and their radius, or None."""
    shape = geometry.geometry
    swept = float(shape.getSweptSphereRadius()) if isinstance(shape, coal.ShapeBase) else 0.0
    if isinstance(shape, coal.Sphere):
        return np.zeros((1, 3)), float(shape.radius) + swept
    if not surface.is_plane and surface.side > 0:
        return None
    if isinstance(shape, coal.Capsule):
        half = float(shape.halfLength)
        return np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]), float(shape.radius) + swept
    vertices = _vertices(geometry)
    return None if vertices is None else (vertices, swept)


def _vertices(geometry: pin.GeometryObject) -> np.ndarray | None:
    """Corners of a polyhedral shape, shape (n, 3), or None."""
    shape = geometry.geometry
    if isinstance(shape, coal.Box):
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
        return signs * np.array(shape.halfSide)
    if isinstance(shape, coal.TriangleP):
        return np.array([shape.a, shape.b, shape.c])
    if isinstance(shape, coal.BVHModelBase):
        return np.array(hull_of_mesh(shape, geometry.name).points())
    if isinstance(shape, coal.ConvexBase):
        return np.array(shape.points())
    return None
