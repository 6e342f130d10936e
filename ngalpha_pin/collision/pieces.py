"""Surface, not pieces: what of a polytope is surface where other pieces of the same body touch it.

Cells of a height field, tiles, parts of a decomposed mesh and steps are convex pieces with faces, edges and corners
that their neighbours cover or continue. At a point p the body fills the cone T of all directions into it, and a normal
n can be one of contact where n . t <= 0 for all t in T. An edge is felt in the arc of such normals between those of its
two faces, a corner where they fill a solid angle: between flush tiles there is one normal alone, that of the tiles,
which their faces have already; where a wall stands on a floor there is none. A face is none where neighbours cover all
of it. All of it is found once, as arrays, when a shape comes near: pieces of one body do not move against each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ngalpha_pin.collision.exposed import ARC, Exposed
from ngalpha_pin.collision.features import ON_SIDE
from ngalpha_pin.collision.flush import flush_faces
from ngalpha_pin.collision.polytope import Polytope
from ngalpha_pin.collision.shapes import Solid
from ngalpha_pin.common.tolerances import CLOSED, ROUNDING, TINY
from ngalpha_pin.numerics.spatial import cross


def exposed(pieces: Sequence[Solid]) -> list[Solid]:
    """The same shapes, which belong to one body; those of them that are polytopes and touch others know their surface.

    Faces of pieces that touch and are off by no more than `CLOSED` times the extent of all of them are flush: they get
    one plane.
    """
    found, plain = list(pieces), [i for i, x in enumerate(pieces) if isinstance(x, Polytope) and x.r == 0.0]
    sharp = [x for x in pieces if isinstance(x, Polytope) and x.r == 0.0]
    if len(sharp) < 2:
        return found
    low, high = (np.array([f(piece.V, axis=0) for piece in sharp]) for f in (np.min, np.max))
    tol = CLOSED * float(np.sqrt(((high.max(axis=0) - low.min(axis=0)) ** 2).sum()))
    around = [
        [j for j in others.tolist() if _meet(sharp[i], sharp[j], tol)]
        for i, others in enumerate(_neighbours(low, high, tol))
    ]
    flush = flush_faces(sharp, around, tol)
    for k, i in enumerate(plain):
        if around[k]:
            shift = float(np.sqrt(((flush[k].V - sharp[k].V) ** 2).sum(axis=1)).max())
            beside = partial(_exposed, flush[k], [flush[j] for j in around[k]], tol, shift)
            found[i] = replace(flush[k], beside=beside)
    return found


def _neighbours(low: np.ndarray, high: np.ndarray, tol: float) -> list[np.ndarray]:
    """Of every box between two corners those that touch it."""
    order = np.argsort(low[:, 0], kind="stable")
    last = np.searchsorted(low[order, 0], high[order, 0] + tol, side="right")
    pairs = [np.zeros((0, 2), dtype=int)]
    for k, i in enumerate(order):
        others = order[k + 1 : last[k]]
        meet = ((low[others] <= high[i] + tol) & (low[i] <= high[others] + tol)).all(axis=1)
        pairs.append(np.column_stack((np.full(int(meet.sum()), i), others[meet])))
    of = np.concatenate(pairs)
    of = np.concatenate((of, of[:, ::-1]))
    of = of[np.lexsort((of[:, 1], of[:, 0]))]
    return np.split(of[:, 1], np.searchsorted(of[:, 0], np.arange(1, len(low))))


class _Others:
    """Pieces that touch one of them, with their faces in one array."""

    def __init__(self, pieces: list[Polytope]):
        self.pieces = pieces
        self.normals, self.offsets = (np.concatenate([getattr(x, y) for x in pieces]) for y in ("normals", "offsets"))
        self._begin = np.cumsum([0, *(len(x.offsets) for x in pieces[:-1])])

    def depths(self, points: np.ndarray) -> np.ndarray:
        """How far points are inside every piece, negative outside, shape (n_pieces, n) [m]."""
        return np.asarray(np.minimum.reduceat(self.offsets[:, None] - self.normals @ points.T, self._begin))

    def spans(self, starts: np.ndarray, ways: np.ndarray, tol: float) -> tuple[np.ndarray, np.ndarray]:
        """Between which parts of ways from points these are in the pieces; the second is smaller if never."""
        room, rate = self.offsets[:, None] + tol - self.normals @ starts.T, self.normals @ ways.T
        at = room / np.where(rate == 0.0, TINY, rate)
        first = np.where(rate < 0.0, at, np.where((rate == 0.0) & (room < 0.0), 1.0, 0.0))
        last = np.where(rate > 0.0, at, 1.0)
        first, last = np.maximum.reduceat(first, self._begin), np.minimum.reduceat(last, self._begin)
        return np.maximum(first, 0.0), np.minimum(last, 1.0)


def _exposed(piece: Polytope, around: list[Polytope], tol: float, shift: float) -> Exposed:
    """What of a piece is surface, beside others that touch it."""
    others = _Others(around)
    faces = np.array([not _is_covered(piece, i, around, tol) for i in range(len(piece.normals))])
    corners, ways = np.ones(len(piece.V), dtype=bool), {}
    depths = others.depths(piece.V)
    for i in np.flatnonzero((depths >= -tol).any(axis=0)).tolist():
        p, sides = piece.V[i], piece.edges[(piece.edges[:, :2] == i).any(axis=1), :2]
        here = [_ways(around[j], p, tol) for j in np.flatnonzero(depths[:, i] >= -tol)]
        if any(found is None for found in here):
            corners[i] = False
            continue
        ways[i] = np.concatenate([found for found in here if found is not None])
        own = piece.V[sides.sum(axis=1) - i] - p
        corners[i] = _pointed(np.concatenate((own[(own**2).sum(axis=1) > (4.0 * tol) ** 2], ways[i])), tol)
    starts = piece.V[piece.edges[:, 0]]
    along = piece.V[piece.edges[:, 1]] - starts
    begin, end = others.spans(starts, along, tol)
    parts = []
    for k, edge in enumerate(piece.edges):
        long = 4.0 * tol / float(np.sqrt(along[k] @ along[k]))
        spans = [(around[j], begin[j, k], end[j, k]) for j in np.flatnonzero(end[:, k] - begin[:, k] > long)]
        parts += _edge_parts(piece, edge, spans, tol)
    first, way, low, high = np.array(parts).reshape(-1, 4, 3).transpose(1, 0, 2)
    near = 2.0 * (tol + ON_SIDE * float(np.sqrt((along**2).sum(axis=1).max())))
    return Exposed(tol, shift, near, piece.V, faces, first, way, low, high, corners, ways)


def _meet(a: Polytope, b: Polytope, tol: float) -> bool:
    """No face of one piece keeps the other apart from it."""
    return not any((one.offsets < (one.normals @ two.V.T).min(axis=1) - tol).any() for one, two in ((a, b), (b, a)))


def _ways(piece: Polytope, p: np.ndarray, tol: float) -> np.ndarray | None:
    """From a point on a piece to what spans the directions into it, shape (n, 3); None inside of it, where all do."""
    near = np.flatnonzero(piece.offsets - piece.normals @ p <= tol)
    if not len(near):
        return None
    corners = np.unique(np.concatenate([piece.members[i] for i in near]))
    away = np.concatenate((piece.V[corners], piece.V.mean(axis=0)[None])) - p
    return np.asarray(away[(away**2).sum(axis=1) > (4.0 * tol) ** 2])


def _pointed(ways: np.ndarray, tol: float) -> bool:
    """The normals n with n . t <= 0 for all the ways t fill a solid angle.

    Their cone is spanned by those that are perpendicular to two of the ways.
    """
    length = np.sqrt((ways**2).sum(axis=1))
    ways, slack = ways / length[:, None], 4.0 * tol / length + ARC
    # a straight line through the corner
    if (1.0 + ways @ ways.T <= 0.5 * (slack[:, None] + slack) ** 2 + ROUNDING).any():
        return False
    first = np.unique(np.round(ways, 9) + 0.0, axis=0, return_index=True)[1]
    ways, slack = ways[first], slack[first]
    one, two = np.triu_indices(len(ways), 1)
    rays = cross(ways[one], ways[two])
    length = np.sqrt((rays**2).sum(axis=1))
    rays = rays[length > ARC] / length[length > ARC, None]
    rays = np.concatenate((rays, -rays))
    rays = rays[(rays @ ways.T <= slack).all(axis=1)]
    return len(rays) > 0 and bool((ways @ rays.sum(axis=0) < -slack).all())


def _is_covered(piece: Polytope, i: int, others: list[Polytope], tol: float) -> bool:
    """Behind every point of face i there is another piece."""
    normal, near = piece.normals[i], piece.offsets[i] + 4.0 * tol
    others = [other for other in others if (other.V @ normal).max() > near]
    if not others or len(piece.members[i]) < 3:
        return False
    # what a plane just outside of the face has of it that is in none of the others
    polygon = piece.side(i) + 4.0 * tol * normal
    if (_Others(others).depths(polygon) < -8.0 * tol).all(axis=0).any():
        return False
    left = [polygon]
    for other in others:
        left = [rest for polygon in left for rest in _outside(polygon, other, tol)]
    return not left


def _outside(polygon: np.ndarray, piece: Polytope, tol: float) -> list[np.ndarray]:
    """Convex parts of a polygon that are not in a piece, without strips that are too narrow to count."""
    depths = piece.offsets[:, None] + tol - piece.normals @ polygon.T
    if (depths.max(axis=1) <= 4.0 * tol).any():
        return [polygon]
    found, rest = [], polygon
    for k in np.flatnonzero(depths.min(axis=1) < 0.0):
        depth = piece.offsets[k] + tol - rest @ piece.normals[k]
        if depth.max() <= 4.0 * tol:
            return [polygon]
        if depth.min() < -4.0 * tol:
            found.append(_cut(rest, -depth))
        if depth.min() < 0.0:
            rest = _cut(rest, depth)
    return found


def _cut(polygon: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """The part of a polygon whose depth is not negative."""
    found = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if depth[i] >= 0.0:
            found.append(polygon[i])
        if depth[i] * depth[j] < 0.0:
            found.append(polygon[i] + depth[i] / (depth[i] - depth[j]) * (polygon[j] - polygon[i]))
    return np.array(found)


def _edge_parts(
    piece: Polytope, edge: np.ndarray, spans: list[tuple[Polytope, float, float]], tol: float
) -> list[tuple[np.ndarray, ...]]:
    """Parts of an edge: start, way to the end, and the normals between which it is felt; zero where it is not.

    Args:
        piece: whose edge it is.
        edge: its row of `Polytope.edges`.
        spans: pieces that it is in or on, and between which parts of its length.
        tol: distance that is none [m].
    """
    a, b, f, g = edge
    start, way, low = piece.V[a], piece.V[b] - piece.V[a], piece.normals[f]
    if not spans:
        return [(start, way, low, piece.normals[g])]
    length = float(np.sqrt(way @ way))
    side = cross(way[None] / length, low[None])[0]
    side = side if side @ piece.normals[g] > 0.0 else -side
    wide = math.atan2(side @ piece.normals[g], low @ piece.normals[g])
    cuts = [0.0]
    for cut in sorted(x for span in spans for x in span[1:]):
        if (cut - cuts[-1]) * length > 4.0 * tol:
            cuts.append(cut)
    if (1.0 - cuts[-1]) * length > 4.0 * tol:
        cuts.append(1.0)
    found = []
    for first, last in zip(cuts[:-1], cuts[1:], strict=True):
        middle, arc = 0.5 * (first + last), (0.0, wide)
        for other, begin, end in spans:
            if begin < middle < end:
                ways = _ways(other, start + middle * way, tol)
                arc = (0.0, 0.0) if ways is None else _arc_beside(ways, low, side, arc, tol)
        there = arc[1] - arc[0] > ARC
        normals = [(math.cos(x) * low + math.sin(x) * side) * there for x in arc]
        found.append((start + first * way, (last - first) * way, *normals))
    return found


def _arc_beside(
    away: np.ndarray, low: np.ndarray, side: np.ndarray, arc: tuple[float, float], tol: float
) -> tuple[float, float]:
    """What of an arc of angles from `low` towards `side` is left beside a piece that the ways `away` lead into."""
    first, last = arc
    for x, y in zip((away @ low).tolist(), (away @ side).tolist(), strict=True):
        r = math.hypot(x, y)
        if r <= 4.0 * tol:
            continue
        angle = math.atan2(y, x)
        angle += 2.0 * math.pi * round((0.5 * (first + last) - angle) / (2.0 * math.pi))
        slack = 2.0 * tol / r + ARC
        # normals within a right angle of a way into the piece are none; flush is what is so up to the tolerance
        inside_first = math.cos(first - angle) > slack
        inside_last = math.cos(last - angle) > slack
        if inside_first and inside_last:
            return 0.0, 0.0
        if inside_first:
            first = angle + 0.5 * math.pi
        elif inside_last:
            last = angle - 0.5 * math.pi
    return first, last
