"""Meshes of a scene in convex parts, and what is said where only the hull of one overlaps something."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.contact import ContactPair
from ngalpha_pin.scene.contents import Entry, listed
from ngalpha_pin.scene.convex_hull import hull
from ngalpha_pin.scene.convex_parts import convex_parts, volume
from ngalpha_pin.scene.meshes import SAME, arrays, hull_excess, hull_of_mesh
from ngalpha_pin.scene.pending_meshes import loaded

THRESHOLD = 0.05  # of coacd: how concave a part may be, in parts of the size of the mesh


def decomposed(scene: Any, pattern: str, threshold: float = THRESHOLD, most: int | None = None) -> list[str]:
    """See `SceneParts.decompose`."""
    checks.number("decompose: threshold", threshold, 0.01, 1.0)
    if most is not None:
        checks.integer("decompose: most", most, 1)
    names = scene.geometries(pattern)
    meshes = [name for name in names if _is_mesh(loaded(scene.declared_shapes, name))]
    if not meshes:
        kinds = listed(f"{name!r} ({type(scene.geometry(name).geometry).__name__})" for name in names)
        raise SceneError(f"decompose: {pattern!r} is no mesh with triangles but {kinds}, which contact takes as it is")
    return [part for name in meshes for part in _in_parts(scene, name, threshold, most)]


def decompose_concave(scene: Any) -> None:
    """Every mesh whose hull is larger than it is, in place."""
    for name in [g.name for g in scene.declared_shapes.geometryObjects]:
        if hull_excess(loaded(scene.declared_shapes, name)):
            _in_parts(scene, name, THRESHOLD, None)


def _is_mesh(geometry: pin.GeometryObject) -> bool:
    return isinstance(geometry.geometry, coal.BVHModelBase) and geometry.geometry.num_tris > 0


def _in_parts(scene: Any, name: str, threshold: float, most: int | None) -> list[str]:
    geometry = loaded(scene.declared_shapes, name)
    what = f"geometry {name!r}"
    vertices, triangles = arrays(geometry.geometry)
    parts = convex_parts(what, vertices, triangles, threshold, most)
    shapes = [hull(f"{what}, part {i}", points) for i, points in enumerate(parts)]
    new = [f"{name} {i}" for i in range(len(shapes))]
    taken = [n for n in new if scene.declared_shapes.existGeometryName(n)]
    if taken:
        raise SceneError(f"decompose: the scene has a geometry named {taken[0]!r} already")
    pieces = []
    for part, shape in zip(new, shapes, strict=True):
        piece = pin.GeometryObject(part, geometry.parentJoint, geometry.placement, shape)
        piece.parentFrame, piece.meshColor = geometry.parentFrame, geometry.meshColor
        pieces.append(piece)
    of_mesh, of_hull = abs(volume(vertices, triangles)), float(hull_of_mesh(geometry.geometry, name).computeVolume())
    of_parts = sum(float(shape.computeVolume()) for shape in shapes)
    scene.declared_shapes.removeGeometryObject(name)
    for piece in pieces:
        scene.declared_shapes.addGeometryObject(piece)
    scene.contents.append(
        Entry(
            f"convex parts of {name}",
            len(new),
            "used" if abs(of_parts - of_mesh) < SAME * of_mesh else "approximated",
            f"{of_parts:.3g} m^3, the mesh has {of_mesh:.3g}, its hull {of_hull:.3g}",
        )
    )
    _take_the_place(scene, name, new)
    return new


def _take_the_place(scene: Any, name: str, new: list[str]) -> None:
    """Parts have the contacts and properties of what they are of."""

    def of(pairs: Iterable[ContactPair]) -> list[ContactPair]:
        found = []
        for pair in pairs:
            a, b = (new if n == name else [n] for n in (pair.geometry_a, pair.geometry_b))
            found += [ContactPair(x, y, pair.law, pair.found) for x in a for y in b]
        return found

    scene.contacts, scene.left_out = of(scene.contacts), of(scene.left_out)
    if name in scene.surfaces:
        law = scene.surfaces.pop(name)
        scene.surfaces |= dict.fromkeys(new, law)
    scene.disabled = {
        frozenset((*(pair - {name}), *end))
        for pair in scene.disabled
        for end in ([(n,) for n in new] if name in pair else [()])
    }
    scene.complete = [names - {name} | set(new) if name in names else names for names in scene.complete]
    scene.added = [n for given in scene.added for n in (new if given == name else [given])]


def only_hulls_of(scene: Any, data: pin.Data, pairs: Iterable[tuple[str, str]]) -> str:
    """What to say of pairs that overlap where of one of both it is its convex hull that does, not the mesh.

    Args:
        scene: with the geometries.
        data: with the poses of the bodies.
        pairs: names of the geometries.
    """
    found: dict[str, None] = {}
    for pair in pairs:
        geometries = [scene.geometry(name) for name in pair]
        for mesh, other in (geometries, geometries[::-1]):
            if hull_excess(mesh) is not None and not _touches(data, mesh, other):
                found[mesh.name] = None
    if not found:
        return ""
    names = listed(map(repr, found))
    return (
        f"; of {names} it is the convex hull that overlaps, not the mesh: scene.decompose({next(iter(found))!r}) makes "
        "convex parts of it"
    )


def _touches(data: pin.Data, mesh: pin.GeometryObject, other: pin.GeometryObject) -> bool:
    """Something of the other shape is in the mesh: it cuts its surface, or a point of it is inside."""
    X, Y = (data.oMi[g.parentJoint] * g.placement for g in (mesh, other))
    places = (coal.Transform3s(T.rotation, T.translation) for T in (X, Y))
    at_mesh, at_other = places
    result = coal.CollisionResult()
    if coal.collide(mesh.geometry, at_mesh, other.geometry, at_other, coal.CollisionRequest(), result):
        return True
    other.geometry.computeLocalAABB()
    point = X.actInv(Y.act(np.array(other.geometry.aabb_center)))
    vertices, triangles = arrays(mesh.geometry)
    return abs(_winding(vertices[triangles] - point)) > 0.5


def _winding(corners: np.ndarray) -> float:
    """How often triangles go around the origin, shape (n, 3, 3)."""
    a, b, c = corners.transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    along = (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    angles = np.arctan2(np.einsum("ij,ij->i", a, np.cross(b, c)), la * lb * lc + along)
    return float(angles.sum() / (2.0 * np.pi))
