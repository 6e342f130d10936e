"""What of a polytope is surface, where other pieces of its body touch it; `surface` finds it, `narrow_phase` asks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.numerics.spatial import cross

# arcs of normals below this one are rounding [rad]
ARC = 1e-9


@dataclass(frozen=True, eq=False)
class Exposed:
    """Faces, parts of edges and corners of a polytope that are surface, and in which directions they are felt.

    Attributes:
        tol: distance that is none between pieces [m].
        shift: how far its corners were moved, so that its faces are flush with those of its neighbours [m].
        near: distance from an edge or a corner at which a point is on it [m].
        V: corners of the polytope, shape (n, 3) [m].
        faces: which faces are, at least in part, shape (f,).
        first, way: start of every part of an edge, and the way to its end, shape (m, 3) [m].
        low, high: normals at both ends of the arc in which it is felt, zero where it is not, shape (m, 3).
        corners: which corners are, shape (n,).
        blocked: of a corner beside other pieces, the ways from it to their corners [m].
    """

    tol: float
    shift: float
    near: float
    V: np.ndarray
    faces: np.ndarray
    first: np.ndarray
    way: np.ndarray
    low: np.ndarray
    high: np.ndarray
    corners: np.ndarray
    blocked: dict[int, np.ndarray]

    @property
    def edges(self) -> np.ndarray:
        """Which parts of edges are surface, shape (m,)."""
        return np.asarray(self.low.any(axis=1))

    def felt(self, p: np.ndarray, n: np.ndarray) -> bool:
        """The corner or edge that the point p lies on is surface in the direction of the outward unit normal n.

        On neither of them p lies in a face, and is.
        """
        away = ((self.V - p) ** 2).sum(axis=1)
        i = int(np.argmin(away))
        if away[i] <= self.near**2:
            ways = self.blocked.get(i)
            return bool(self.corners[i]) and (ways is None or bool((ways @ n <= 2.0 * self.tol).all()))
        from_first = p - self.first
        s = (from_first * self.way).sum(axis=1) / np.maximum((self.way**2).sum(axis=1), TINY)
        beside = from_first - np.clip(s, 0.0, 1.0)[:, None] * self.way
        here = np.flatnonzero((beside**2).sum(axis=1) <= self.near**2)
        low, high = self.low[here], self.high[here]
        axis = cross(low, high)
        size = np.sqrt((axis**2).sum(axis=1))
        n = np.broadcast_to(n, low.shape)
        within = (cross(low, n) * axis).sum(axis=1) >= -ARC * size
        within &= (cross(n, high) * axis).sum(axis=1) >= -ARC * size
        return len(here) == 0 or bool((within & (size > 0.0)).any())
