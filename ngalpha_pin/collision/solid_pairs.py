"""Declared pairs of geometries as pairs of solids, with what of each side is surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin import engine
from ngalpha_pin.collision.narrow_phase import SolidPair
from ngalpha_pin.collision.pieces import exposed
from ngalpha_pin.collision.shapes import Solid, Wall, solid
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.contact import ContactPair
from ngalpha_pin.scene.friction_ellipse import placed_ellipse
from ngalpha_pin.scene.pending_meshes import loaded
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.scene.surface_velocity import moving_surface

# what describes a shape
NUMBERS: dict[type, tuple[str, ...]] = {
    coal.Sphere: ("radius",),
    coal.Ellipsoid: ("radii",),
    coal.Capsule: ("radius", "halfLength"),
    coal.Cylinder: ("radius", "halfLength"),
    coal.Cone: ("radius", "halfLength"),
    coal.Box: ("halfSide",),
}
THIN = 1e-7  # half the thickness that a triangle has for coal, in parts of its size


def solid_pairs(scene: Scene, pairs: list[ContactPair]) -> list[SolidPair]:
    """The shapes of declared pairs; a half-space, or else what is fixed in the world, comes first.

    Raises:
        SceneError: a shape has no description here, or two half-spaces are to touch.
    """
    known: dict[str, tuple[Solid, Any]] = {}
    geometry = cache(partial(loaded, scene.declared_shapes))
    return _with_surfaces([_solid_pair(scene, pair, geometry, known) for pair in pairs])


def _solid_pair(
    scene: Scene,
    pair: ContactPair,
    named: Callable[[str], pin.GeometryObject],
    known: dict[str, tuple[Solid, Any]],
) -> SolidPair:
    geometries = [named(pair.geometry_a), named(pair.geometry_b)]
    sides = []
    for geometry in geometries:
        if geometry.name not in known:
            found = None if geometry.name in scene.hollow else solid(geometry)
            if found is None:
                other = geometries[geometry is geometries[0]]
                hollow = "Hollow " * (geometry.name in scene.hollow)
                raise SceneError(
                    f"contact of {hollow}{type(geometry.geometry).__name__} {geometry.name!r} against "
                    f"{type(other.geometry).__name__} {other.name!r} is not available"
                )
            known[geometry.name] = found, _for_coal(geometry.geometry)
        sides.append((geometry, *known[geometry.name]))
    sides.sort(key=lambda side: (not isinstance(side[1], Wall), side[0].parentJoint > 0))
    if isinstance(sides[1][1], Wall):
        raise SceneError(f"{pair.geometry_a!r} and {pair.geometry_b!r} are half-spaces or planes; these do not touch")
    (a, solid_a, shape_a), (b, solid_b, shape_b) = sides
    moving = moving_surface(pair.law.surface_velocity, geometries[1], b is geometries[1])
    ellipse = placed_ellipse(scene, pair.law, (geometries[0], geometries[1]), b)
    return SolidPair(
        f"{pair.geometry_a}/{pair.geometry_b}", (int(a.parentJoint), int(b.parentJoint)), (solid_a, solid_b),
        (shape_a, shape_b), (a.placement.copy(), b.placement.copy()), pair.law, moving, ellipse,
    )  # fmt: skip


def _with_surfaces(pairs: list[SolidPair]) -> list[SolidPair]:
    """The pairs with what of their shapes is surface beside other pieces of the same body.

    A piece hides another from a shape only if that shape touches both.
    """
    partners: dict[tuple[int, int], dict[int, Solid]] = {}
    for pair in pairs:
        for (own, other), joint in zip((pair.solids, pair.solids[::-1]), pair.joints, strict=True):
            partners.setdefault((joint, id(other)), {})[id(own)] = own
    surfaces: dict[frozenset[int], dict[int, Solid]] = {}  # a body shows several shapes the same pieces
    known: dict[tuple[int, int], dict[int, Solid]] = {}
    for side, pieces in partners.items():
        key = frozenset(pieces)
        if key not in surfaces:
            surfaces[key] = dict(zip(pieces, exposed(list(pieces.values())), strict=True))
        known[side] = surfaces[key]
    found = []
    for pair in pairs:
        sides = []
        for (own, other), joint in zip((pair.solids, pair.solids[::-1]), pair.joints, strict=True):
            sides.append(known[joint, id(other)][id(own)])
        found.append(replace(pair, solids=(sides[0], sides[1])))
    return found


def _for_coal(shape: coal.CollisionGeometry) -> Any:
    """The shape that coal measures, in the engine; None for half-spaces and planes, which are measured without it.

    Of a mesh it is the hull, and of a triangle, for which coal has no distances, a thin prism.
    """
    if isinstance(shape, (coal.Halfspace, coal.Plane)):
        return None
    if isinstance(shape, coal.BVHModelBase):
        shape, swept = shape.convex, 0.0
    else:
        swept = float(shape.getSweptSphereRadius())
    if isinstance(shape, coal.TriangleP):
        shape = _prism(np.array([shape.a, shape.b, shape.c]))
    if isinstance(shape, coal.ConvexBase):
        points = np.array(shape.points())
        return engine.CoalShape.hull(points, [list(shape.neighbors(i)) for i in range(len(points))], swept)
    numbers = np.hstack([getattr(shape, name) for name in NUMBERS[type(shape)]]).tolist()
    return engine.CoalShape.of(type(shape).__name__, numbers, swept)


def _prism(corners: np.ndarray) -> coal.Convex:
    """A triangle with a thickness that distances do not feel, made of its faces: Qhull would call it flat."""
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    size = float(np.linalg.norm(corners - corners[0], axis=1).max())
    normal *= THIN * size / np.linalg.norm(normal)
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for p in (*(corners + normal), *(corners - normal)):
        points.append(p)
    for face in ((0, 1, 2), (5, 4, 3), *((i, i + 3, (i + 1) % 3) for i in range(3))):
        faces.append(coal.Triangle(*face))
    for i in range(3):
        faces.append(coal.Triangle((i + 1) % 3, i + 3, 3 + (i + 1) % 3))
    return coal.Convex(points, faces)
