"""Shapes of coal as triangles, for viewers that take nothing else."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common.optional import require

TRIMESH = 'pip install "ngalpha-pin[live]"'
FLAT = 1e-3  # thickness of what has none [m]


def triangles(geometry: pin.GeometryObject) -> tuple[np.ndarray, np.ndarray] | None:
    """Vertices (n, 3) [m] and faces (m, 3) of a geometry in its own frame; None for what has no end, as planes.

    Args:
        geometry: of a geometry model.

    Raises:
        MissingPackageError: trimesh is not installed.
    """
    trimesh = require("trimesh", "live", TRIMESH)
    shape, make = geometry.geometry, trimesh.creation
    if isinstance(shape, (coal.Halfspace, coal.Plane)):
        return None
    if isinstance(shape, coal.BVHModelBase):
        # by number: a triangle of coal cannot be iterated over
        faces = np.array([(t[0], t[1], t[2]) for t in map(shape.tri_indices, range(shape.num_tris))], dtype=int)
        return np.array(shape.vertices()), faces
    if isinstance(shape, coal.Sphere):
        mesh = make.icosphere(subdivisions=3, radius=shape.radius)
    elif isinstance(shape, coal.Box):
        mesh = make.box(extents=2 * np.array(shape.halfSide))
    elif isinstance(shape, coal.Capsule):
        mesh = make.capsule(height=2 * shape.halfLength, radius=shape.radius)  # about its middle
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
    elif isinstance(shape, coal.Cylinder):
        mesh = make.cylinder(radius=shape.radius, height=2 * shape.halfLength)
    elif isinstance(shape, coal.Cone):
        mesh = make.cone(radius=shape.radius, height=2 * shape.halfLength)
        mesh.apply_translation([0.0, 0.0, -shape.halfLength])
    elif isinstance(shape, coal.Ellipsoid):
        mesh = make.icosphere(subdivisions=3)
        mesh.apply_scale(np.array(shape.radii))
    else:
        return _hull(trimesh, shape)
    return np.array(mesh.vertices), np.array(mesh.faces)


def _hull(trimesh: Any, shape: Any) -> tuple[np.ndarray, np.ndarray]:
    """The convex hull of the points of a shape, or the box around it where it does not tell them."""
    if isinstance(shape, coal.ConvexBase):
        points = np.array([shape.point(i) for i in range(shape.num_points)])
    else:
        shape.computeLocalAABB()
        low, high = shape.aabb_local.min_, shape.aabb_local.max_
        points = np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    if np.ptp(points, axis=0).min() < FLAT:
        points = np.vstack((points - FLAT / 2, points + FLAT / 2))
    mesh = trimesh.Trimesh(points).convex_hull
    return np.array(mesh.vertices), np.array(mesh.faces)
