"""What of a shape may come to rest on a face of another: its corners, cut to the face and reduced to a few.

Four points that are far from each other carry whatever rests there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ngalpha_pin.collision.features import ON, ON_SIDE, Corners, Face, Feature, tangents
from ngalpha_pin.common.tolerances import TINY

POINTS = 4


# tells of a point, and whether it is cut, if it is surface of both shapes
Felt = Callable[[np.ndarray, bool], bool]


def resting_points(
    on: Face, corners: Corners, kept: Sequence[np.ndarray] = (), felt: Felt | None = None
) -> list[Feature]:
    """At most four of the corners, cut to a face, far from each other, deep ones first; none beside the face.

    And those at the points `kept`: what rests on a corner goes on to do so, whichever others are farther apart now.
    """
    n = on.normal
    if len(corners) == 0:
        return []
    t, points = tangents(n), corners.support(-n)
    if on.corners is not None:
        flat, heights = points @ t.T, points @ n
        lowest = int(np.argmin(heights))
        order = np.array(_convex_order(flat) if len(flat) > 2 else range(len(flat)), dtype=int)
        chosen = _clip(corners[order], on.corners, t, n)
        # the lowest one may be in the middle of the others
        if lowest not in order:
            chosen = _joined(chosen, _clip(corners[np.array([lowest])], on.corners, t, n))
        corners, points = chosen, chosen.support(-n)
    if felt is not None:
        corners = corners[np.array([felt(p, cut) for p, cut in zip(points, corners.cut, strict=True)], dtype=bool)]
        points = corners.support(-n)
    if len(corners) <= POINTS:
        return [corners.feature(i) for i in range(len(corners))]
    found = set(spread(points @ t.T, points @ n))
    near = ON * float(np.ptp(points, axis=0).max())
    for point in kept:
        away = np.abs(corners.c - point).max(axis=1)
        i = int(np.argmin(away))
        if away[i] < near:
            found.add(i)
    return [corners.feature(i) for i in sorted(found)]


def _joined(a: Corners, b: Corners) -> Corners:
    return Corners(*(np.concatenate((getattr(a, x), getattr(b, x))) for x in ("c", "Q", "r", "cut")))


def _clip(corners: Corners, polygon: np.ndarray, t: np.ndarray, n: np.ndarray) -> Corners:
    """Corners in order about -n or n, cut by the sides of a polygon about n with the tangents t."""
    closed = len(corners) > 2
    start = polygon @ t.T
    side = np.roll(start, -1, axis=0) - start
    inwards = np.column_stack((-side[:, 1], side[:, 0]))
    inwards /= np.maximum(np.sqrt((inwards**2).sum(axis=1)), TINY)[:, None]
    offsets = (inwards * start).sum(axis=1)
    # a corner on a side, up to rounding, is inside: faces of one width would lose their corners to each other
    offsets -= ON_SIDE * np.abs(side).max()
    # what is inside at first stays inside
    cuts = ((corners.support(-n) @ t.T) @ inwards.T < offsets).any(axis=0)
    for i in np.flatnonzero(cuts):
        depth = (corners.support(-n) @ t.T) @ inwards[i] - offsets[i]
        inside = depth >= 0.0
        if inside.all():
            continue
        here = np.arange(len(corners) if closed else len(corners) - 1)
        following = (here + 1) % len(corners)
        here, following = (x[inside[here] != inside[following]] for x in (here, following))
        s = depth[here] / (depth[here] - depth[following])
        # a cut through a corner is that corner
        proper = (s > 1e-9) & (s < 1 - 1e-9)
        here, following, s = here[proper], following[proper], s[proper]
        kept = np.flatnonzero(inside)
        order = np.argsort(np.concatenate((kept, here + 0.5)))
        corners = _joined(corners[kept], corners.between(here, following, s, -n))[order]
        if len(corners) == 0:
            break
    return corners


def _convex_order(flat: np.ndarray) -> list[int]:
    """Corners of the hull of points in the plane, in order (monotone chains)."""
    order = np.lexsort((flat[:, 1], flat[:, 0])).tolist()
    size, points = float(np.ptp(flat, axis=0).max()), flat.tolist()
    chains: list[int] = []
    for sequence in (order, order[::-1]):
        chain: list[int] = []
        for i in sequence:
            x, y = points[i]
            while len(chain) > 1:
                (x0, y0), (x1, y1) = points[chain[-2]], points[chain[-1]]
                if (x1 - x0) * (y - y1) - (y1 - y0) * (x - x1) > 1e-12 * size * size:
                    break
                chain.pop()
            chain.append(i)
        chains += chain[:-1]
    return list(dict.fromkeys(chains))


def spread(places: np.ndarray, heights: np.ndarray) -> list[int]:
    """Four points that are far from each other: the deepest, the farthest from it, the widest on either side."""
    size = float(np.ptp(places, axis=0).max())
    first = int(np.argmax(heights < heights.min() + 1e-9 * size))
    away = places - places[first]
    second = int(np.argmax((away**2).sum(axis=1)))
    d = away[second]
    side = away[:, 1] * d[0] - away[:, 0] * d[1]
    return sorted({first, second, int(np.argmax(side)), int(np.argmin(side))})
