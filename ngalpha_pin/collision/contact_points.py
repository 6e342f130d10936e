"""Pairs of shapes to contacts.

Where one side is a half-space, a sphere or a hollow shape, most contacts are a small sphere (a point where its radius
is zero) that is fixed in one body, against a surface that is fixed in another one: a sphere gives one such point, a
capsule two, a box or a convex its vertices. Of all other pairs, and of shapes with many corners in one face, the
touching features change, see `manifold`.
"""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.polytope import polytope
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.contact import ContactLaw, ContactPair
from ngalpha_pin.scene.meshes import hull_of_mesh
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


@dataclass(frozen=True)
class ContactPoint:
    """One contact k: a sphere of radius >= 0 fixed in `joint`, against a surface, with its law.

    Attributes:
        name: e.g. "ball/ground" or "box[3]/ground".
        joint: index of the joint that the point moves with.
        point: its centre in the frame of that joint, shape (3,) [m].
        radius: [m].
        surface: the other side.
        law: mu, e_N, e_F, contact radius.
        moving: which of the two surfaces moves along itself, or None.
    """

    name: str
    joint: int
    point: np.ndarray
    radius: float
    surface: Surface
    law: ContactLaw
    moving: MovingSurface | None = None


def contact_points(scene: Scene) -> tuple[list[ContactPoint], list[ContactPair]]:
    """The contacts of a scene that are points fixed in a body, and the pairs that are left.

    Raises:
        SceneError: a pair cannot touch at all.
    """
    points: list[ContactPoint] = []
    others: list[ContactPair] = []
    on_faces: dict[bytes, bool] = {}
    of_beams = {point.name for point in scene.beam_points}
    for pair in scene.contacts:
        if scene.beams and pair.law.adhesion > 0.0:
            raise SceneError(
                f"contact of {pair.geometry_a!r} with {pair.geometry_b!r}: adhesion is not available in a scene with "
                "beams"
            )
    for pair in pairs_apart(scene):
        found = pair_points(scene, pair)
        if of_beams & {pair.geometry_a, pair.geometry_b}:
            if not found:
                raise SceneError(
                    f"contact of {pair.geometry_a!r} with {pair.geometry_b!r}: points of beams touch half-spaces, "
                    "spheres and the lateral surface of cylinders"
                )
            points += found
            continue
        # from outside, a cylinder can be touched at its ends as well
        outside = bool(found) and found[0].surface.side > 0
        if not found or (outside and (found[0].surface.axis.any() or _rests_on_faces(found, on_faces))):
            if pair.law.compliance is not None:
                raise SceneError(
                    f"contact of {pair.geometry_a!r} with {pair.geometry_b!r}: compliant are spheres and corners "
                    "against half-spaces, spheres and hollow shapes, and points of beams; leave the compliance out"
                )
            others.append(pair)
        else:
            points += found
    return points, others


def _rests_on_faces(points: list[ContactPoint], known: dict[bytes, bool]) -> bool:
    """Many of the corners lie in one plane, as those of a wheel, a coin or a flat foot from a mesh.

    Args:
        points: corners of one geometry.
        known: answers for other geometries, and then this one: the feet of a robot are often one mesh.
    """
    if len(points) <= FACE_CORNERS:
        return False
    corners = np.array([p.point for p in points])
    # those of one mesh differ by the rounding of their placements
    shape = np.round(corners - corners[0], 9).tobytes()
    if shape not in known:
        members = polytope(corners, 0.0, pin.SE3.Identity()).members
        known[shape] = max(map(len, members)) > max(FACE_CORNERS, FACE_SHARE * len(points))
    return known[shape]


def pair_points(scene: Scene, pair: ContactPair) -> list[ContactPoint]:
    """Points fixed in a body for one pair; none where there is no such description."""
    a, b = scene.geometry(pair.geometry_a), scene.geometry(pair.geometry_b)
    for body, other in ((a, b), (b, a)):
        surface = surface_of(other, other.name in scene.hollow)
        if surface is None or body.name in scene.hollow:
            continue
        spheres = _spheres(body, surface)
        if spheres is None:
            continue
        _check_fit(spheres, surface, body.name, other.name)
        indices = [""] if len(spheres) == 1 else [f"[{i}]" for i in range(len(spheres))]
        names = [f"{g.name}{i}" if g is body else g.name for i in indices for g in (a, b)]
        joint, placement = int(body.parentJoint), body.placement
        moving = moving_surface(pair.law.surface_velocity, b, body is b)
        return [
            ContactPoint(f"{names[2 * i]}/{names[2 * i + 1]}", joint, placement.act(p), r, surface, pair.law, moving)
            for i, (p, r) in enumerate(spheres)
        ]
    return []


def _check_fit(spheres: list[tuple[np.ndarray, float]], surface: Surface, body: str, other: str) -> None:
    if surface.side < 0 and max(r for _, r in spheres) >= surface.radius:
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


def _spheres(geometry: pin.GeometryObject, surface: Surface) -> list[tuple[np.ndarray, float]] | None:
    """Centres and radii of the contact points of a shape, in the frame of the shape, or None."""
    shape = geometry.geometry
    swept = float(shape.getSweptSphereRadius()) if isinstance(shape, coal.ShapeBase) else 0.0
    if isinstance(shape, coal.Sphere):
        return [(np.zeros(3), float(shape.radius) + swept)]
    if not surface.is_plane and surface.side > 0:
        return None
    if isinstance(shape, coal.Capsule):
        half = float(shape.halfLength)
        return [(np.array([0.0, 0.0, z]), float(shape.radius) + swept) for z in (-half, half)]
    vertices = _vertices(geometry)
    return None if vertices is None else [(vertex, swept) for vertex in vertices]


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
