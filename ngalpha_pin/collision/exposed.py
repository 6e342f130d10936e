"""What of a polytope is surface, where other pieces of its body touch it; `pieces` finds it, the engine asks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ngalpha_pin import engine

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

    @cached_property
    def native(self) -> Any:
        """The same in the engine, which tells where it is felt."""
        parts = [self.first, self.way, self.low, self.high]
        ways = [self.blocked.get(i, np.zeros((0, 3))) for i in range(len(self.V))]
        return engine.Exposed.of(self.tol, self.near, self.V, self.faces.tolist(), self.corners.tolist(), parts, ways)
