"""Polytopes: boxes, convex shapes, hulls of meshes, triangles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from ngalpha_pin import engine
from ngalpha_pin.collision.exposed import Exposed
from ngalpha_pin.collision.features import tangents
from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.errors import SceneError

# width of points on a line or in a plane, in parts of their size: a skin of 1e-9 of a part is its surface
FLAT = 1e-9
# corners, normals and offsets of the faces, corners of every face, edges
Described = tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Polytope:
    """The hull of points, swept by a sphere of radius r.

    Attributes:
        V: corners, shape (n, 3) [m].
        normals, offsets: of the faces, normal . x = offset, shapes (f, 3) and (f,).
        members: numbers of the corners of every face, in mathematically positive order about its normal.
        edges: numbers of both corners and of both faces of every edge, shape (e, 4).
        r: radius [m].
        centre: middle of the corners, shape (3,).
        size: twice their largest distance from it [m].
        beside: finds what of it is surface where other pieces of its body touch it; None where none does.
    """

    V: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray
    members: list[np.ndarray]
    edges: np.ndarray
    r: float
    centre: np.ndarray
    size: float
    beside: Callable[[], Exposed] | None = None

    @cached_property
    def exposed(self) -> Exposed | None:
        """What of it is surface; None for all of it."""
        return None if self.beside is None else self.beside()

    def side(self, i: int) -> np.ndarray:
        """Corners of face i in mathematically positive order about its normal, shape (n, 3)."""
        return np.asarray(self.V[self.members[i]])

    @cached_property
    def native(self) -> Any:
        """The shape in the engine."""
        members = [corners.tolist() for corners in self.members]
        beside = None if self.beside is None else partial(_surface, self.beside)
        edges = self.edges.ravel().tolist()
        faces = (self.normals, self.offsets, members)
        return engine.Solid.polytope(self.V, *faces, edges, self.r, self.centre, self.size, beside)


def _surface(beside: Callable[[], Exposed]) -> Any:
    """What of a piece is surface, for the engine; it does not refer to the piece, which refers to the engine."""
    return beside().native


def polytope(points: np.ndarray, swept: float, pose: pin.SE3) -> Polytope:
    """The hull of points given in the frame of a geometry."""
    normal = _normal_of_flat(points)
    with _told():
        V, normals, offsets, members, edges = _hull(points.tobytes()) if normal is None else _flat(points, normal)
    # planes are told apart in the frame of the shape, where those of a box are exact
    V, normals = V @ pose.rotation.T + pose.translation, normals @ pose.rotation.T
    offsets = offsets + normals @ pose.translation
    centre = 0.5 * (V.min(axis=0) + V.max(axis=0))
    extent = 2.0 * float(np.sqrt(((V - centre) ** 2).sum(axis=1).max())) + 2.0 * swept
    return Polytope(V, normals, offsets, members, edges, swept, centre, extent)


def largest_face(points: np.ndarray) -> int:
    """Most corners of a face of the hull of points; of those that were asked for before it is known.

    Raises:
        SceneError: they have no hull.
    """
    return _largest_face(points.tobytes())


@lru_cache(maxsize=256)
def _largest_face(of: bytes) -> int:
    points = np.frombuffer(of).reshape(-1, 3)
    if (normal := _normal_of_flat(points)) is not None:
        with _told():
            return len(_flat(points, normal)[0])
    with _told():
        return int(np.bincount(_faces(of).face).max())


def _normal_of_flat(points: np.ndarray) -> np.ndarray | None:
    """The normal of points in one plane, None of others."""
    size = float(np.ptp(points, axis=0).max())
    values, vectors = np.linalg.eigh(np.cov(points.T) if len(points) > 1 else np.zeros((3, 3)))
    if len(points) < 3 or values[1] <= (FLAT * size) ** 2:
        raise SceneError("a shape of contact needs at least three points that are not on a line")
    return None if values[0] > (FLAT * size) ** 2 else vectors[:, 0]


@contextmanager
def _told() -> Iterator[None]:
    try:
        yield
    except QhullError as error:
        raise SceneError(f"the hull of a shape cannot be built: {str(error).splitlines()[0]}") from error


class _Faces(NamedTuple):
    """Corners of a hull and its triangles, and of each face the normal; of each corner of a face both numbers."""

    V: np.ndarray
    triangles: np.ndarray
    of_triangles: np.ndarray
    normals: np.ndarray
    face: np.ndarray
    corner: np.ndarray


@lru_cache(maxsize=256)
def _faces(of: bytes) -> _Faces:
    """What faces the hull of points has; of those that were asked for before, the same arrays again."""
    points = np.frombuffer(of).reshape(-1, 3)
    hull = ConvexHull(points)
    V = points[hull.vertices]
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(V))
    # triangles of one and the same plane are one face
    scale = max(float(np.abs(V).max()), TINY)
    first, of_triangles = _different(np.round(hull.equations / [1, 1, 1, scale], 7))
    triangles = number[hull.simplices]
    face, corner = np.divmod(np.unique(of_triangles.reshape(-1, 1) * len(V) + triangles), len(V))
    return _Faces(V, triangles, of_triangles, hull.equations[first, :3], face, corner)


@lru_cache(maxsize=256)
def _hull(of: bytes) -> Described:
    """What describes a hull; of points that were asked for before, the same arrays again."""
    V, triangles, of_triangles, normals, face, corner = _faces(of)
    edges = _edges(triangles, of_triangles)
    starts = np.searchsorted(face, np.arange(len(normals)))
    members = _around(V, corner, starts, normals)
    offsets = np.maximum.reduceat((V[corner] * normals[face]).sum(axis=1), starts)
    return V, normals, offsets, members, edges


def _different(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first of the rows that are the same, in the order of their entries, and the number of that of every row.

    As `numpy.unique` of rows, which takes ten times as long.
    """
    order = np.lexsort(rows.T[::-1])
    new = np.append(True, (rows[order[1:]] != rows[order[:-1]]).any(axis=1))
    number = np.empty(len(rows), dtype=int)
    number[order] = np.cumsum(new) - 1
    return order[new], number


def _edges(triangles: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Corners and faces of the sides of triangles at which two different faces meet, shape (e, 4)."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    found = np.column_stack((sides, np.repeat(faces, 3)))
    found = found[_different(found)[0]]
    same = np.flatnonzero((found[1:, :2] == found[:-1, :2]).all(axis=1))
    return np.column_stack((found[same], found[same + 1, 2]))


def _flat(points: np.ndarray, normal: np.ndarray) -> Described:
    """Both sides of a flat polygon and, as faces of two corners, its edges."""
    V = points[ConvexHull(points @ tangents(normal).T).vertices]
    (loop,) = _around(V, np.arange(len(V)), np.array([0]), normal[None])
    edges = [np.array([a, b]) for a, b in zip(loop, np.roll(loop, -1), strict=True)]
    outwards = np.cross([V[b] - V[a] for a, b in edges], normal)
    normals = np.vstack((normal, -normal, outwards / np.linalg.norm(outwards, axis=1, keepdims=True)))
    members = [loop, loop[::-1], *edges]
    offsets = np.array([n @ V[m[0]] for n, m in zip(normals, members, strict=True)])
    sides = [(*edge, i, 2 + k) for k, edge in enumerate(edges) for i in (0, 1)]
    return V, normals, offsets, members, np.array(sides)


def _around(V: np.ndarray, corners: np.ndarray, starts: np.ndarray, normals: np.ndarray) -> list[np.ndarray]:
    """Corners of all faces, given one after the other, in mathematically positive order about the normals."""
    counts = np.diff([*starts, len(corners)])
    face, at = np.repeat(np.arange(len(starts)), counts), V[corners]
    flat = at - (np.add.reduceat(at, starts) / counts[:, None])[face]
    along = np.eye(3)[np.abs(normals).argmin(axis=1)]
    t1 = along - (along * normals).sum(axis=1, keepdims=True) * normals
    t2 = np.cross(normals, t1)  # as long as t1
    angle = np.arctan2((flat * t2[face]).sum(axis=1), (flat * t1[face]).sum(axis=1))
    ordered = corners[np.lexsort((angle, face))]
    return [ordered[i:j] for i, j in pairwise([*starts.tolist(), len(corners)])]
