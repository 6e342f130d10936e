"""Convex parts of a mesh with faces where the mesh has them.

coacd leaves slivers of some 5e-5 of the size away: a floor that it has cut has steps and gaps of that size. Here a
face that is off by so little from one of the mesh, or from that of another part, is put on it, and a cut that passes a
corner of the mesh as closely goes through it; parts are what their faces enclose.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError, cKDTree

# by which faces of parts are off, in parts of the size of the mesh, and sine of the angle
OFF, OFF_ANGLE = 1e-4, 1e-3
# faces smaller than this times what they may be off by are left away, and corners nearer than this part of it are one
SLIVER, SAME_CORNER = 10.0, 0.01
# part of the largest singular value below which known corners do not tell a plane, and planes not a corner
SAME_PLANE, SAME_POINT = 1e-6, 1e-3


def on_faces(parts: list[np.ndarray], vertices: np.ndarray, triangles: np.ndarray) -> list[np.ndarray]:
    """The parts with their faces on those of the mesh, and on those of parts before them, where they are off by little.

    Args:
        parts: corners of each, shape (n, 3) [m].
        vertices: of the mesh, shape (n, 3) [m].
        triangles: of the mesh, shape (m, 3).
    """
    planes = _Planes(vertices, triangles)
    return [_enclosed(part, planes) for part in parts]


class _Planes:
    """Those of a mesh, and those of parts that are in none of them."""

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray):
        self.corners, self.off = vertices, OFF * float(np.ptp(vertices, axis=0).max())
        a, b, c = (vertices[triangles[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        area = np.linalg.norm(normals, axis=1)
        order = np.argsort(-area, kind="stable")
        order = order[area[order] > (SLIVER * self.off) ** 2]
        self.normals = normals[order] / area[order, None]
        self.offsets = (self.normals * a[order]).sum(axis=1)

    def of(self, n: np.ndarray, d: float, corners: np.ndarray) -> tuple[np.ndarray, float]:
        """The plane that takes the place of that of a face."""
        away = np.abs(self.normals @ corners.T - self.offsets[:, None]).max(axis=1, initial=0.0)
        along = self.normals @ n
        near = np.flatnonzero((away <= self.off) & (np.abs(along) > 1.0 - OFF_ANGLE**2))
        if len(near):
            i = int(near[0])
            sign = 1.0 if along[i] > 0.0 else -1.0
            return sign * self.normals[i], sign * float(self.offsets[i])
        n, d = self._through_corners(n, d, corners)
        self.normals, self.offsets = np.vstack((self.normals, n)), np.append(self.offsets, d)
        return n, d

    def _through_corners(self, n: np.ndarray, d: float, corners: np.ndarray) -> tuple[np.ndarray, float]:
        """The plane of a cut through the corners of the mesh that it passes closely."""
        low, high = corners.min(axis=0) - self.off, corners.max(axis=0) + self.off
        here = ((self.corners >= low) & (self.corners <= high)).all(axis=1)
        passed = self.corners[here & (np.abs(self.corners @ n - d) <= self.off)]
        if not len(passed):
            return n, d
        middle = corners.mean(axis=0)
        size = float(np.ptp(corners, axis=0).max())
        A = np.column_stack(((passed - middle) / size, -np.ones(len(passed))))
        w = np.append(n, (d - n @ middle) / size)
        for _ in range(3):  # the smallest change of the plane
            w = w - np.linalg.lstsq(A, A @ w, rcond=SAME_PLANE)[0]
            w /= np.linalg.norm(w[:3])
        moved, to = w[:3], float(w[3] * size + w[:3] @ middle)
        return (moved, to) if np.abs(corners @ moved - to).max() <= 3.0 * self.off else (n, d)


def _enclosed(part: np.ndarray, planes: _Planes) -> np.ndarray:
    """Corners of what the faces of a part enclose once they are where they belong."""
    hull = ConvexHull(part)
    _, first, face = np.unique(np.round(hull.equations, 9), axis=0, return_index=True, return_inverse=True)
    sides: dict[tuple[float, ...], None] = {}
    for i, k in enumerate(first):
        corners = part[np.unique(hull.simplices[face.ravel() == i])]
        if np.ptp(corners, axis=0).max() > SLIVER * planes.off:
            n, d = planes.of(hull.equations[k, :3], -float(hull.equations[k, 3]), corners)
            key = (*n.tolist(), d)
            sides[key] = None
    found = np.array(list(sides))
    try:
        new = _corners(found[:, :3], found[:, 3], part.mean(axis=0), planes.off)
        low, high = part.min(axis=0) - SLIVER * planes.off, part.max(axis=0) + SLIVER * planes.off
        fits = len(new) > 3 and (new >= low).all() and (new <= high).all()
        return new[ConvexHull(new).vertices] if fits else part
    except QhullError:  # as thin as what faces are off by
        return part


def _corners(normals: np.ndarray, offsets: np.ndarray, inside: np.ndarray, off: float) -> np.ndarray:
    """Of the intersection of half-spaces, those that are nearly the same as one."""
    found = HalfspaceIntersection(np.column_stack((normals, -offsets)), inside).intersections
    found = found[np.isfinite(found).all(axis=1)]
    pairs = cKDTree(found).query_pairs(SAME_CORNER * off, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(found), len(found)))
    n, which = connected_components(graph, directed=False)
    corners = []
    for i in range(n):
        p = found[which == i].mean(axis=0)
        for _ in range(2):  # the second time is for rounding
            on = np.abs(normals @ p - offsets) <= 2.0 * SAME_CORNER * off
            p = p + np.linalg.lstsq(normals[on], offsets[on] - normals[on] @ p, rcond=SAME_POINT)[0]
        corners.append(p)
    return np.array(corners)
