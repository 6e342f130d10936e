"""Terrain from an array of heights: one convex prism for every flat piece of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.convex_hull import FLAT, hull

FIELDS = (coal.HeightFieldOBBRSS, coal.HeightFieldAABB)
# distance of the fourth corner of a cell from the plane of the others that is none, in parts of the size
LEVEL = 1e-9
# Pinocchio's list of geometries has a matrix over all pairs, which it copies for each that is added: more than so many
# pieces take many minutes to declare, and gigabytes
MOST = 4000


def prisms(heights: np.ndarray, size: Sequence[float], depth: float | None) -> Iterator[tuple[str, coal.Convex]]:
    """Pieces of a height field with the end of their names: a cell that is flat, or either half of it.

    Args:
        heights: z at the points of a regular grid, x along the first axis, shape (n, m) [m].
        size: extent of the grid along x and y, about the origin [m].
        depth: how far the material reaches below the lowest point [m]; None is a tenth of the size.

    Raises:
        SceneError: the numbers do not make a field.
    """
    z, extent = (
        checks.array("height field: heights", heights, (None, None)),
        checks.vector("height field: size", size, 2),
    )
    if min(z.shape) < 2 or extent.min() <= 0:
        raise SceneError(
            "a height field needs at least 2 x 2 heights and a size of two positive lengths, along x and y"
        )
    depth = 0.1 * float(extent.max()) if depth is None else depth
    depth = checks.number("height field: depth", depth, 0.0, above=True, unit="metres")
    width, tall = float((extent / (np.array(z.shape) - 1)).max()), float(np.ptp(z)) + depth
    if min(width, depth) < FLAT * max(width, tall):
        raise SceneError(
            f"height field: cells of {width:.3g} m, heights over {np.ptp(z):.3g} m and a depth of {depth:.3g} m make "
            f"pieces that are too thin; the largest of these lengths can be {1 / FLAT:.0e} times the smallest"
        )
    rise = z[:-1, :-1] - z[1:, :-1] + z[1:, 1:] - z[:-1, 1:]
    level = np.abs(rise) <= LEVEL * extent.max()  # cells that are flat
    if (number := level.size + int((~level).sum())) > MOST:
        raise SceneError(
            f"a height field of {z.shape[0]} x {z.shape[1]} heights has {number} flat pieces, a scene holds at most "
            f"{MOST}: take the part that is walked on, or fewer heights, one of {np.ceil(np.sqrt(number / MOST)):.0f}"
        )
    x, y = (np.linspace(-0.5 * a, 0.5 * a, n) for a, n in zip(extent, z.shape, strict=True))
    bottom = float(z.min()) - depth
    for i in range(len(x) - 1):
        for j in range(len(y) - 1):
            cell = [np.array([x[p], y[q], z[p, q]]) for p, q in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]
            if level[i, j]:
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
    points = [x for p in top for x in (p, np.array([p[0], p[1], bottom]))]
    return hull("height field", np.array(points))
