"""Polytopes: boxes, convex shapes, hulls of meshes, triangles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import combinations, pairwise

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from ngalpha_pin.collision.exposed import Exposed
from ngalpha_pin.collision.features import ALIGNED, ON, Corners, Face, Feature, Look, face, line, tangents
from ngalpha_pin.common.tolerances import ROUNDING, TINY
from ngalpha_pin.errors import SceneError

# turn of a step beyond which corners are found by the looks at its end [rad]
MOST_TURN = 0.1

# corners, normals and offsets of the faces, corners of every face, edges
Described = tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Polytope:
    """The hull of points, swept by a sphere of radius r.

    Attributes:
        V: corners, shape (n, 3) [m].
        normals, offsets: of the faces, normal . x = offset, shapes (f, 3) and (f,).
        members: numbers of the corners of every face, in no order.
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
    _sides: dict[int, Face] = field(default_factory=dict)

    @cached_property
    def exposed(self) -> Exposed | None:
        """What of it is surface, found when something comes near; None for all of it."""
        return None if self.beside is None else self.beside()

    def support(self, m: np.ndarray) -> np.ndarray:
        """The farthest point in the direction m, shape (3,)."""
        return self.V[int(np.argmax(self.V @ m))] + self.r * m

    def feature_at(self, p: np.ndarray, m: np.ndarray) -> Feature:
        """The corner, edge or face that the point p of the surface belongs to."""
        near, core = ON * self.size, p - self.r * m
        depth = self.offsets - self.normals @ core
        on = np.flatnonzero(depth < near)
        # a flat polygon has two sides everywhere; a sharp edge belongs to both of its faces whatever the direction
        normals = self.normals[on]
        on = on[~((normals @ normals.T < -ALIGNED).any(axis=1) & (normals @ m < 0.0))]
        if len(on) == 1:
            return self._face(int(on[0]))
        corner = int(np.argmin(((self.V - core) ** 2).sum(axis=1)))
        if len(on) == 0 or np.abs(self.V[corner] - core).max() < near:
            return Feature(self.V[corner], r=self.r)
        # of the edges between these faces the one that the point is nearest to
        found, nearest = Feature(self.V[corner], r=self.r), np.inf
        for i, j in combinations(on, 2):
            shared = np.intersect1d(self.members[i], self.members[j])
            if len(shared) != 2:
                continue
            a, b = self.V[shared]
            direction = (b - a) / np.linalg.norm(b - a)
            foot = a + ((core - a) @ direction) * direction
            distance = float(np.abs(foot - core).max())
            if distance < nearest:
                found, nearest = line(foot, direction, self.r), distance
        return found

    def face(self, m: np.ndarray, aligned: float = ALIGNED) -> Face | None:
        """The face whose normal has a cosine above `aligned` with m, if there is one and it is surface."""
        i = int(np.argmax(self.normals @ m))
        is_face = self.normals[i] @ m > aligned and len(self.members[i]) > 2
        return self.side(i) if is_face and (self.exposed is None or self.exposed.faces[i]) else None

    def side(self, i: int) -> Face:
        """Face i."""
        if i not in self._sides:
            corners = self.V[_ordered(self.V, self.members[i], self.normals[i])]
            self._sides[i] = Face(self._face(i), self.normals[i], corners)
        return self._sides[i]

    def corners(self, m: np.ndarray, look: Look) -> Corners:
        """Corners that may touch a plane with the normal -m in a step: of the face that looks there, and others.

        A corner is the farthest one along a direction that is turned by an angle only if none that it shares an edge
        with stands out farther than the angle times their distance across m. So angles decide, not lengths, and a
        plate may be as thin as it likes.
        """
        height, turn = self.V @ m, 0.0 if look.turn is None else float(np.sqrt(look.turn @ look.turn))
        first, second = self.edges[:, 0], self.edges[:, 1]
        rise = height[second] - height[first]
        across = np.sqrt(np.maximum(((self.V[second] - self.V[first]) ** 2).sum(axis=1) - rise**2, 0.0))
        least = 2.0 * min(turn, MOST_TURN) * across + ROUNDING * float(np.abs(height).max())
        near = np.ones(len(self.V), dtype=bool)
        near[first[rise > least]] = near[second[-rise > least]] = False
        i = int(np.argmax(self.normals @ m))
        if self.normals[i] @ m > 0.5:
            near[self.members[i]] = True
        V = self.V[near]
        return Corners(V, np.zeros((len(V), 3, 3)), np.full(len(V), self.r), np.zeros(len(V), dtype=bool))

    def _face(self, i: int) -> Feature:
        return face(self.offsets[i] * self.normals[i], self.normals[i], self.r)


def polytope(points: np.ndarray, swept: float, pose: pin.SE3) -> Polytope:
    """The hull of points given in the frame of a geometry."""
    size = float(np.ptp(points, axis=0).max())
    values, vectors = np.linalg.eigh(np.cov(points.T) if len(points) > 1 else np.zeros((3, 3)))
    if len(points) < 3 or values[1] <= (1e-9 * size) ** 2:
        raise SceneError("a shape of contact needs at least three points that are not on a line")
    try:
        flat = not values[0] > (1e-9 * size) ** 2
        V, normals, offsets, members, edges = _flat(points, vectors[:, 0]) if flat else _hull(points.tobytes())
    except QhullError as error:
        raise SceneError(f"the hull of a shape cannot be built: {str(error).splitlines()[0]}") from error
    # planes are told apart in the frame of the shape, where those of a box are exact
    V, normals = V @ pose.rotation.T + pose.translation, normals @ pose.rotation.T
    offsets = offsets + normals @ pose.translation
    centre = 0.5 * (V.min(axis=0) + V.max(axis=0))
    extent = 2.0 * float(np.sqrt(((V - centre) ** 2).sum(axis=1).max())) + 2.0 * swept
    return Polytope(V, normals, offsets, members, edges, swept, centre, extent)


@lru_cache(maxsize=256)
def _hull(of: bytes) -> Described:
    """What describes a hull; of points that were asked for before, the same arrays again."""
    points = np.frombuffer(of).reshape(-1, 3)
    hull = ConvexHull(points)
    V = points[hull.vertices]
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(V))
    # triangles of one and the same plane are one face
    scale = max(float(np.abs(V).max()), TINY)
    first, face = _different(np.round(hull.equations / [1, 1, 1, scale], 7))
    normals = hull.equations[first, :3]
    edges = _edges(number[hull.simplices], face)
    face, corner = np.divmod(np.unique(face.reshape(-1, 1) * len(V) + number[hull.simplices]), len(V))
    starts = np.searchsorted(face, np.arange(len(first)))
    members = [corner[i:j] for i, j in pairwise([*starts.tolist(), len(face)])]
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
    loop = _ordered(V, np.arange(len(V)), normal)
    edges = [np.array([a, b]) for a, b in zip(loop, np.roll(loop, -1), strict=True)]
    outwards = np.cross([V[b] - V[a] for a, b in edges], normal)
    normals = np.vstack((normal, -normal, outwards / np.linalg.norm(outwards, axis=1, keepdims=True)))
    members = [loop, loop, *edges]
    offsets = np.array([n @ V[m[0]] for n, m in zip(normals, members, strict=True)])
    sides = [(*edge, i, 2 + k) for k, edge in enumerate(edges) for i in (0, 1)]
    return V, normals, offsets, members, np.array(sides)


def _ordered(V: np.ndarray, corners: np.ndarray, normal: np.ndarray) -> np.ndarray:
    t = tangents(normal)
    flat = (V[corners] - V[corners].mean(axis=0)) @ t.T
    return corners[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))]
