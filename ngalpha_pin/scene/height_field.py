"""Terrain from an array of heights: one convex prism for every flat piece of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError

FIELDS = (coal.HeightFieldOBBRSS, coal.HeightFieldAABB)
FLAT = 1e-9  # distance of the fourth corner of a cell from the plane of the others that is none, in parts of the size


def prisms(heights: np.ndarray, size: Sequence[float], depth: float | None) -> Iterator[tuple[str, coal.Convex]]:
    """Pieces of a height field with the end of their names: a cell that is flat, or either half of it.

    Args:
        heights: z at the points of a regular grid, x along the first axis, shape (n, m) [m].
        size: extent of the grid along x and y, about the origin [m].
        depth: how far the material reaches below the lowest point [m]; None is a tenth of the size.

    Raises:
        SceneError: the numbers do not make a field.
    """
    z, extent = np.asarray(heights, dtype=float), np.asarray(size, dtype=float)
    if z.ndim != 2 or min(z.shape) < 2 or not np.isfinite(z).all():
        raise SceneError("heights must be a finite array of at least 2 x 2 points")
    if extent.shape != (2,) or not (np.isfinite(extent).all() and extent.min() > 0):
        raise SceneError("size must be two positive lengths, along x and y")
    depth = 0.1 * float(extent.max()) if depth is None else float(depth)
    if not depth > 0:
        raise SceneError(f"depth = {depth} must be positive")
    x, y = (np.linspace(-0.5 * a, 0.5 * a, n) for a, n in zip(extent, z.shape, strict=True))
    bottom = float(z.min()) - depth
    for i in range(len(x) - 1):
        for j in range(len(y) - 1):
            cell = [np.array([x[p], y[q], z[p, q]]) for p, q in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]
            if abs(cell[0][2] - cell[1][2] + cell[2][2] - cell[3][2]) <= FLAT * extent.max():
                yield f"{i}_{j}", _prism(cell, bottom)
            else:
                yield f"{i}_{j}_a", _prism(cell[:3], bottom)
                yield f"{i}_{j}_b", _prism([cell[0], *cell[2:]], bottom)


def prisms_of(field: coal.CollisionGeometry) -> Iterator[tuple[str, coal.Convex]]:
    """The pieces of one of coal's height fields, as of `prisms`."""
    # coal has a column for every x, and a row for every y from the largest down
    heights = np.array(field.getHeights())[::-1].T
    depth = float(heights.min() - field.getMinHeight())
    return prisms(heights, (field.getXDim(), field.getYDim()), depth if depth > 0.0 else None)


def pieces(geometry: pin.GeometryObject) -> Iterator[pin.GeometryObject]:
    """The convex pieces of a geometry that is one of coal's height fields, named after it."""
    for end, shape in prisms_of(geometry.geometry):
        piece = pin.GeometryObject(f"{geometry.name}_{end}", geometry.parentJoint, geometry.placement, shape)
        piece.parentFrame, piece.meshColor = geometry.parentFrame, geometry.meshColor
        yield piece


def _prism(top: list[np.ndarray], bottom: float) -> coal.Convex:
    points = coal.StdVec_Vec3s()
    for p in top:
        points.append(p)
        points.append(np.array([p[0], p[1], bottom]))
    return coal.Convex.convexHull(points, True, "Qt")
