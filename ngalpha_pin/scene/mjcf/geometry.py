"""Geoms of a compiled MJCF model as geometries of coal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.scene.convex_hull import hull
from ngalpha_pin.scene.height_field import prisms
from ngalpha_pin.scene.mjcf.compiler import mujoco, pose
from ngalpha_pin.scene.mjcf.tree import Tree

DRAWN_GROUPS = 3  # of geoms, the first ones: those that MuJoCo's own viewer shows


def touches(m: Any, g: int) -> bool:
    """A geom can be in contact, by its type and conaffinity or by an explicit pair."""
    return bool(m.geom_contype[g] or m.geom_conaffinity[g] or g in m.pair_geom1 or g in m.pair_geom2)


def collision_model(m: Any, tree: Tree) -> tuple[pin.GeometryModel, dict[int, list[str]]]:
    """The geoms that can be in contact, and the names of the geometries of each: several of a height field."""
    found, names = pin.GeometryModel(), {}
    for g in range(m.ngeom):
        if touches(m, g):
            pieces = [
                _placed(m, tree, g, f"{tree.names.geoms[g]}{end}", shape)
                for end, shape in _shapes(m, g, tree.names.geoms[g])
            ]
            for piece in pieces:
                found.addGeometryObject(piece)
            names[g] = [piece.name for piece in pieces]
    return found, names


def visual_model(m: Any, tree: Tree) -> pin.GeometryModel:
    """The geoms that are drawn, meshes with their triangles."""
    found = pin.GeometryModel()
    for g in range(m.ngeom):
        if m.geom_group[g] < DRAWN_GROUPS:
            is_mesh = m.geom_type[g] == mujoco().mjtGeom.mjGEOM_MESH
            shapes = [("", _triangles(m, int(m.geom_dataid[g])))] if is_mesh else _shapes(m, g, tree.names.geoms[g])
            for end, shape in shapes:
                found.addGeometryObject(_placed(m, tree, g, f"{tree.names.geoms[g]}{end}", shape))
    return found


def _placed(m: Any, tree: Tree, g: int, name: str, shape: coal.CollisionGeometry) -> pin.GeometryObject:
    body = int(m.geom_bodyid[g])
    joint, at = tree.places[body]
    frame = tree.model.getFrameId(tree.names.bodies[body], pin.FrameType.BODY) if body else 0
    geometry = pin.GeometryObject(name, joint, frame, at * pose(m.geom_pos[g], m.geom_quat[g]), shape)
    material = m.geom_matid[g]
    geometry.meshColor = np.array(m.geom_rgba[g] if material < 0 else m.mat_rgba[material], dtype=float)
    return geometry


def _shapes(m: Any, g: int, name: str) -> Iterator[tuple[str, coal.CollisionGeometry]]:
    """Shapes of a geom with the ends of their names; none of a kind that is not known."""
    kinds, size = mujoco().mjtGeom, [float(s) for s in m.geom_size[g]]
    kind = m.geom_type[g]
    if kind == kinds.mjGEOM_PLANE:  # its size is for drawing: contact does not end there
        yield "", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    elif kind == kinds.mjGEOM_SPHERE:
        yield "", coal.Sphere(size[0])
    elif kind == kinds.mjGEOM_CAPSULE:
        yield "", coal.Capsule(size[0], 2 * size[1])
    elif kind == kinds.mjGEOM_ELLIPSOID:
        yield "", coal.Ellipsoid(*size)
    elif kind == kinds.mjGEOM_CYLINDER:
        yield "", coal.Cylinder(size[0], 2 * size[1])
    elif kind == kinds.mjGEOM_BOX:
        yield "", coal.Box(*(2 * s for s in size))
    elif kind == kinds.mjGEOM_MESH:
        yield "", _hull(m, int(m.geom_dataid[g]), name)
    elif kind == kinds.mjGEOM_HFIELD:
        for end, piece in _terrain(m, int(m.geom_dataid[g])):
            yield f"_{end}", piece


def mesh_arrays(m: Any, mesh: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners, shape (n, 3) [m], and triangles, shape (k, 3), of a mesh in the frame of its geoms."""
    v, f = int(m.mesh_vertadr[mesh]), int(m.mesh_faceadr[mesh])
    points = np.array(m.mesh_vert[v : v + m.mesh_vertnum[mesh]], dtype=float)
    return points, np.array(m.mesh_face[f : f + m.mesh_facenum[mesh]], dtype=int)


def _points(points: np.ndarray) -> coal.StdVec_Vec3s:
    found = coal.StdVec_Vec3s()
    for p in points:
        found.append(p)
    return found


def _hull(m: Any, mesh: int, name: str) -> coal.Convex:
    """The convex hull, which is what MuJoCo too takes for contact."""
    return hull(f"geom {name!r}", mesh_arrays(m, mesh)[0])


def _triangles(m: Any, mesh: int) -> coal.BVHModelOBBRSS:
    points, faces = mesh_arrays(m, mesh)
    triangles = coal.StdVec_Triangle()
    for face in faces:
        triangles.append(coal.Triangle(*map(int, face)))
    found = coal.BVHModelOBBRSS()
    found.beginModel(len(faces), len(points))
    found.addSubModel(_points(points), triangles)
    found.endModel()
    return found


def _terrain(m: Any, field: int) -> Iterator[tuple[str, coal.Convex]]:
    """Prisms with the surface of MuJoCo, whose data have a row for every y."""
    rows, columns, first = int(m.hfield_nrow[field]), int(m.hfield_ncol[field]), int(m.hfield_adr[field])
    x, y, top, bottom = (float(s) for s in m.hfield_size[field])
    heights = top * np.array(m.hfield_data[first : first + rows * columns], dtype=float).reshape(rows, columns).T
    return prisms(heights, (2 * x, 2 * y), float(heights.min()) + bottom)
