"""Local features of shapes: what a shape looks like, to second order, around the point where it is touched.

A feature is the set of points p(n) = c + r n + Q n / sqrt(n.Q n) + E alpha with outward normal n and any alpha: a
vertex (c alone), a sphere (r), an edge or the axis of a capsule (one column of E, r), a face (two columns of E), a rim
(Q = rho^2 (1 - u u^T)), an ellipsoid (Q = A^2), and each of them swept by a sphere. Two features and a guess of the
normal are one packed row of numbers, in the frames of the joints that carry them; `engine/features.hpp` reads them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

# distance from a side of a face, in parts of the longest, at which a corner is on it
ON_SIDE = 1e-9
# places in a packed row: c, E, Q, r of side A, the same of side B, the normal from A to B in the frame of A, and the
# gap of a feature that has vanished: the size of the scene; zero for what is there
SIDE = 19
WIDTH = 2 * SIDE + 4
NORMAL = slice(2 * SIDE, 2 * SIDE + 3)
VANISHED = 2 * SIDE + 3


def _nothing() -> np.ndarray:
    return np.zeros((3, 2))


def _no_ellipsoid() -> np.ndarray:
    return np.zeros((3, 3))


@dataclass(frozen=True, eq=False)
class Feature:
    """One side of a contact, in the frame of its geometry or of its joint.

    Attributes:
        c: point, shape (3,) [m].
        E: unit vectors of the straight directions in its columns, zero where there is none, shape (3, 2).
        Q: squared semi-axes of an ellipsoid or of a disc, shape (3, 3) [m^2].
        r: radius [m]; negative for the inside of a hollow shape.
    """

    c: np.ndarray
    E: np.ndarray = field(default_factory=_nothing)
    Q: np.ndarray = field(default_factory=_no_ellipsoid)
    r: float = 0.0

    def packed(self) -> np.ndarray:
        """Numbers of one side, shape (SIDE,)."""
        return np.concatenate((self.c, self.E.ravel(), self.Q.ravel(), [self.r]))


def pack(a: Feature, b: Feature, normal: np.ndarray) -> np.ndarray:
    """A packed row of two features in the frames of their joints and the normal in the frame of A."""
    return np.concatenate((a.packed(), b.packed(), normal, [0.0]))


def line(c: np.ndarray, direction: np.ndarray, r: float = 0.0) -> Feature:
    """A straight line with a radius."""
    return Feature(c, np.column_stack((direction, np.zeros(3))), r=r)


def face(c: np.ndarray, normal: np.ndarray, r: float = 0.0) -> Feature:
    """A plane through c, moved outwards by r."""
    return Feature(c, tangents(normal).T, r=r)


def rim(c: np.ndarray, axis: np.ndarray, radius: float, r: float = 0.0) -> Feature:
    """The edge of a disc."""
    return Feature(c, Q=radius**2 * (np.eye(3) - np.outer(axis, axis)), r=r)


def tangents(normal: np.ndarray) -> np.ndarray:
    """Two unit vectors that complete a unit normal to a right-handed frame (t1, t2, n), shape (2, 3)."""
    e = np.zeros(3)
    e[int(np.argmin(np.abs(normal)))] = 1.0
    t = e - (e @ normal) * normal
    t /= np.sqrt(t @ t)
    return np.array([t, [normal[1] * t[2] - normal[2] * t[1], normal[2] * t[0] - normal[0] * t[2],
                         normal[0] * t[1] - normal[1] * t[0]]])  # fmt: skip
