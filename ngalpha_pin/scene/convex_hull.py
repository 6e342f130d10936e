"""Convex hulls of points, by coal. Its Qhull ends the process where there is no hull; here that is found before."""

from __future__ import annotations

import coal
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ngalpha_pin.errors import SceneError

# flatter than this in parts of its size, a set of points has no hull that Qhull finds in whatever direction it lies
FLAT = 3e-6
# size [m], and distance from the origin in parts of the size, from which on rounding flattens a shape
LARGEST, FARTHEST = 1e12, 1e8


def hull(what: str, points: np.ndarray) -> coal.Convex:
    """The convex hull of points; of points in one plane a plate of the thickness `FLAT` times their size.

    Args:
        what: whose points they are, for messages.
        points: shape (n, 3) [m].

    Raises:
        SceneError: they are not finite, on a line, or so far away that their shape is rounded off.
    """
    flat = plane_of(what, points)
    if flat is not None:
        normal, size = flat
        off = (points - points.mean(axis=0)) @ normal
        middle = points - off[:, None] * normal
        points = np.concatenate((middle - 0.5 * FLAT * size * normal, middle + 0.5 * FLAT * size * normal))
    check_hull(what, points)
    return coal.Convex.convexHull(_as_list(points), True, "Qt")


def plane_of(what: str, points: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Normal of the plane that all points lie in and their size [m]; None where they fill space.

    Raises:
        SceneError: as of `hull`.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1:] != (3,) or len(points) < 3:
        raise SceneError(f"{what}: expected at least three points of three coordinates, not shape {points.shape}")
    if not np.isfinite(points).all():
        i = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise SceneError(f"{what}: point {i} of {len(points)}, {points[i].tolist()}, is not finite")
    low, high = points.min(axis=0), points.max(axis=0)
    size, away = float((high - low).max()), float(np.abs([low, high]).max())
    if away > LARGEST:
        raise SceneError(f"{what}: its points are up to {away:.3g} m away from its origin, at most {LARGEST:g} can be")
    if not size > away / FARTHEST:
        raise SceneError(f"{what}: all of its points are the same to rounding")
    centred = (points - low) / size
    centred -= centred.mean(axis=0)
    along = np.linalg.eigh(centred.T @ centred)[1]  # the direction of least spread first
    extent = np.ptp(centred @ along, axis=0)
    if extent[1] <= FLAT:
        raise SceneError(f"{what}: its points are all on one line, which no contact can be computed with")
    return (along[:, 0], size) if extent[0] <= FLAT else None


def check_hull(what: str, points: np.ndarray) -> None:
    """Make sure that Qhull finds the hull of points that fill space.

    Raises:
        SceneError: it does not.
    """
    try:
        ConvexHull(points, qhull_options="Qt")
    except QhullError as error:
        raise SceneError(f"{what}: its convex hull cannot be built: {str(error).splitlines()[0]}") from error


def _as_list(points: np.ndarray) -> coal.StdVec_Vec3s:
    found = coal.StdVec_Vec3s()
    for point in points:
        found.append(point)
    return found
