"""Local features of shapes: what a shape looks like, to second order, around the point where it is touched.

A feature is the set of points p(n) = c + r n + Q n / sqrt(n.Q n) + E alpha with outward normal n and any alpha: a
vertex (c alone), a sphere (r), an edge or the axis of a capsule (one column of E, r), a face (two columns of E), a rim
(Q = rho^2 (1 - u u^T)), an ellipsoid (Q = A^2), and each of them swept by a sphere. Two features and a guess of the
normal are one packed row of numbers, in the frames of the joints that carry them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

# cosine beyond which a direction is that of a face, and the part of the size of a shape that is no distance between
# features of its surface
ALIGNED = 1 - 1e-10
ON = 1e-6
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

    @property
    def flat(self) -> int:
        """Number of straight directions: 0 point, 1 line, 2 face."""
        return int(self.E.any(axis=0).sum())

    def moved(self, pose: pin.SE3) -> Feature:
        """The same feature in another frame."""
        R = pose.rotation
        return Feature(pose.act(self.c), R @ self.E, R @ self.Q @ R.T, self.r)

    def support(self, m: np.ndarray) -> np.ndarray:
        """Its point with the outward unit normal m, shape (3,)."""
        Qm = self.Q @ m
        size = float(m @ Qm)
        return self.c + self.r * m + (Qm / np.sqrt(size) if size > 0.0 else 0.0)

    def packed(self) -> np.ndarray:
        """Numbers of one side, shape (SIDE,)."""
        return np.concatenate((self.c, self.E.ravel(), self.Q.ravel(), [self.r]))


@dataclass(frozen=True, eq=False)
class Corners:
    """Many features without straight directions: points, each with an ellipsoid or a disc and a radius around it.

    Attributes:
        c: shape (n, 3) [m].
        Q: shape (n, 3, 3) [m^2].
        r: shape (n,) [m].
        cut: which are no corners of the shape, but points between two of them, shape (n,).
    """

    c: np.ndarray
    Q: np.ndarray
    r: np.ndarray
    cut: np.ndarray

    def __len__(self) -> int:
        return len(self.c)

    def __getitem__(self, i: np.ndarray) -> Corners:
        return Corners(self.c[i], self.Q[i], self.r[i], self.cut[i])

    @classmethod
    def of(cls, features: list[Feature]) -> Corners:
        """The same features as arrays."""
        n = len(features)
        c, Q = (np.array([getattr(f, name) for f in features]) for name in ("c", "Q"))
        return cls(c.reshape(n, 3), Q.reshape(n, 3, 3), np.array([f.r for f in features]), np.zeros(n, dtype=bool))

    def feature(self, i: int) -> Feature:
        """One of them."""
        return Feature(self.c[i], Q=self.Q[i], r=float(self.r[i]))

    def moved(self, pose: pin.SE3) -> Corners:
        """The same corners in another frame."""
        R = pose.rotation
        return Corners(self.c @ R.T + pose.translation, R @ self.Q @ R.T, self.r, self.cut)

    def support(self, m: np.ndarray) -> np.ndarray:
        """Their points with the outward unit normal m, shape (n, 3)."""
        Qm = self.Q @ m
        size = np.sqrt(np.maximum(Qm @ m, 0.0))
        return self.c + self.r[:, None] * m + Qm / np.where(size > 0.0, size, 1.0)[:, None]

    def between(self, i: np.ndarray, j: np.ndarray, s: np.ndarray, m: np.ndarray) -> Corners:
        """Points at parts s of the way from corners i to corners j, of a surface with the outward normal m."""
        same = (self.r[i] == self.r[j]) & (self.Q[i] == self.Q[j]).all(axis=(1, 2))
        points = self.support(m)
        first, last = (np.where(same[:, None], self.c[k], points[k]) for k in (i, j))
        c = (1.0 - s)[:, None] * first + s[:, None] * last
        return Corners(c, self.Q[i] * same[:, None, None], self.r[i] * same, np.ones(len(c), dtype=bool))


@dataclass(frozen=True, eq=False)
class Look:
    """What a shape may know of the step when it offers its corners.

    Attributes:
        turn: rotation in the step in the frame of the shape, shape (3,) [rad]; None where corners must be fixed points.
        before: points that it had in the step before, shape (n, 3).
    """

    turn: np.ndarray | None
    before: np.ndarray

    def seen_from(self, R: np.ndarray, before: np.ndarray) -> Look:
        """The same in the axes R of another frame, with its own points."""
        return Look(None if self.turn is None else R.T @ self.turn, before)


@dataclass(frozen=True, eq=False)
class Face:
    """A flat side of a shape.

    Attributes:
        feature: its plane.
        normal: outward unit normal, shape (3,).
        corners: in mathematically positive order about the normal, shape (n, 3); None for an infinite plane.
    """

    feature: Feature
    normal: np.ndarray
    corners: np.ndarray | None


def pack(a: Feature, b: Feature, normal: np.ndarray) -> np.ndarray:
    """A packed row of two features in the frames of their joints and the normal in the frame of A."""
    return np.concatenate((a.packed(), b.packed(), normal, [0.0]))


def gap_along_normal(row: np.ndarray, X: pin.SE3) -> float:
    """Gap of a packed row along its normal, for the pose X of joint B in joint A [m]."""
    n, gap = row[NORMAL], 0.0
    for start, m, c in ((0, n, row[:3]), (SIDE, -(X.rotation.T @ n), X.act(row[SIDE : SIDE + 3]))):
        Q = row[start + 9 : start + 18].reshape(3, 3)
        reach = row[start + 18] + float(np.sqrt(max(m @ Q @ m, 0.0)))
        gap += (float(n @ c) if start else -float(n @ c)) - reach
    return gap


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
