"""Kinematics to second order of the rows that tie two frames to each other, all of them in a few array operations.

As for contacts (see `contact.point_rows`), a row is a world wrench F = (d, c x d + q) on the motion of body B relative
to body A, and rates are those seen from A. Four kinds of row make up every joint, with n, o fixed in A and c, b in B:

    plane      g = n.(c - o)              d = n                  the point c stays in a plane
    distance   g = |c - o| - L            d = e = (c - o)/|c - o|
    axes       g = n.b                    d = 0, q = b x n       two axes stay perpendicular
    blade      gamma = b.c_dot            d = b                  the point c does not move along b
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.constraints.provider import RowWrenches
from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.numerics.spatial import cross, dot, force_cross, motion_cross, wrench

PLANE, DISTANCE, AXES, BLADE = range(4)
NO_TURN = 1e-9  # sine of an angle between unit vectors that is none, or half a turn: the axis is rounding there
ANGLE = 4  # of the kernel alone, see `driven_angle`


class FrameRow(NamedTuple):
    """One row between two bodies, everything in the frames of their joints.

    Attributes:
        kind: PLANE, DISTANCE, AXES or BLADE; ANGLE with the axis n, and two axes across it, o in A and b in B.
        body_a, body_b: joints, 0 is the world; or a moved frame: -1 - (its number).
        n: vector of A, shape (3,); zero for a distance or a blade.
        o: point of A, shape (3,) [m].
        c: point of B, shape (3,) [m].
        b: vector of B, shape (3,); zero for a plane or a distance.
        length: of a distance [m].
        group: rows of one group have the same unit and share their scale.
    """

    kind: int
    body_a: int
    body_b: int
    n: np.ndarray
    o: np.ndarray
    c: np.ndarray
    b: np.ndarray
    length: float
    group: int


@dataclass(frozen=True)
class MovedFrame:
    """Where a frame with a prescribed motion is: pose, and world twist and its derivative about the world origin."""

    pose: pin.SE3
    twist: np.ndarray
    twist_dot: np.ndarray


class FrameTable:
    """Frame rows as flat arrays.

    Attributes:
        kind, group: of each row, shape (n,).
        unit: size of what rows of axes subtract, zero where there are none.
        a, b: places in `joints` of the bodies of each row, those of moved frames behind them, shape (n,).
        support: which coordinates move each joint, shape (joints, nv).
    """

    def __init__(self, model: pin.Model, rows: list[FrameRow], moved: int):
        self.rows, self.n, self.n_moved = rows, len(rows), moved
        self.kind = kind = np.array([row.kind for row in rows])
        self.plane, self.distance, self.axes, self.blade = (kind == i for i in (PLANE, DISTANCE, AXES, BLADE))
        self.group = np.array([row.group for row in rows])
        self.unit = 1.0 * self.axes.any()
        joints = np.array([[row.body_a, row.body_b] for row in rows])
        self.joints = np.unique(joints[joints >= 0])
        # bodies in the arrays below: the joints in use, then the moved frames
        place = np.where(joints >= 0, np.searchsorted(self.joints, joints), len(self.joints) - 1 - joints)
        self.a, self.b = place.T
        support = np.zeros((len(self.joints) + moved, model.nv))
        for i, joint in enumerate(self.joints):
            for j in list(model.supports[int(joint)])[1:]:
                support[i, model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = 1.0
        self.support, self.support_T = support, np.ascontiguousarray(support.T)
        self.mask = support[self.b] - support[self.a]
        self.vector_a, self.point_a, self.point_b, self.vector_b = (
            np.array([getattr(row, name) for row in rows]) for name in ("n", "o", "c", "b")
        )
        self.length = np.array([row.length for row in rows])


class FrameRows:
    """Rows of a `FrameTable` at (t, q), and by `move` at a velocity and an acceleration.

    Attributes:
        g: of all rows but the blades, which come last [m, -].
        F: world wrenches of all rows, shape (n, 6).
        W: generalized force directions, transposed, shape (n, nv).
        rate, acceleration: g_dot and g_ddot, or gamma and gamma_dot, shape (n,).
    """

    W: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray

    def __init__(
        self, table: FrameTable, rotation: list[np.ndarray], translation: list[np.ndarray], moved: list[MovedFrame]
    ):
        self.table, self.moved = table, moved
        poses = [m.pose for m in moved]
        R = np.array([rotation[j] for j in table.joints] + [pose.rotation for pose in poses])
        p = np.array([translation[j] for j in table.joints] + [pose.translation for pose in poses])
        R_a, R_b = R[table.a], R[table.b]
        self._n = np.einsum("kij,kj->ki", R_a, table.vector_a)
        self._b = np.einsum("kij,kj->ki", R_b, table.vector_b)
        on_a, on_b = np.einsum("kij,kj->ki", R_a, table.point_a), np.einsum("kij,kj->ki", R_b, table.point_b)
        self.c = on_b + p[table.b]
        arm = self.c - on_a - p[table.a]
        # a point near the origin is the difference of large numbers
        self._size = float(max(np.abs(p).max(), np.abs(on_a).max(), np.abs(on_b).max()))
        rho = np.maximum(np.sqrt(dot(arm, arm)), TINY)
        e = arm / rho[:, None]
        self._by_rho = table.distance / rho
        self.g = np.where(
            table.plane, dot(self._n, arm), np.where(table.distance, rho - table.length, dot(self._n, self._b))
        )
        self.g = self.g[~table.blade]
        d = np.where(table.distance[:, None], e, self._n)
        self._d = np.where(table.axes[:, None], 0.0, np.where(table.blade[:, None], self._b, d))
        self._q = table.axes[:, None] * cross(self._b, self._n)
        self.F = np.concatenate((self._d, cross(self.c, self._d) + self._q), axis=1)

    def move(self, motion: Motion) -> FrameRows:
        """Add the rows and their rates."""
        table, F, d = self.table, self.F, self._d
        V = ((motion.J * motion.v) @ table.support_T).T
        V[len(table.joints) :] = np.array([m.twist for m in self.moved]).reshape(-1, 6)
        self._V_b, self._V_a = V[table.b], V[table.a]
        relative = self._V_b - self._V_a
        self._omega = omega = relative[:, 3:]
        self.W = (F @ motion.J) * table.mask
        self.rate = dot(F, relative)
        self.c_dot = c_dot = relative[:, :3] + cross(omega, self.c)
        along = dot(d, c_dot)
        self._e_dot = self._by_rho[:, None] * (c_dot - along[:, None] * d)
        self._b_dot = cross(omega, self._b)
        self._turn = cross(c_dot, d)
        own = (
            dot(self._e_dot, c_dot)
            + dot(self._turn, omega)
            + table.axes * dot(cross(self._b_dot, self._n), omega)
            + table.blade * dot(self._b_dot, c_dot)
        )
        self.acceleration = (
            self.W @ motion.a
            + ((F @ motion.dJ) * table.mask) @ motion.v
            - dot(F, motion_cross(self._V_a, relative))
            + own
        )
        if self.moved:
            A = np.concatenate((np.zeros((len(table.joints), 6)), [m.twist_dot for m in self.moved]))
            self.acceleration += dot(F, A[table.b] - A[table.a])
        return self

    def aligned(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """G and W_g^T with angles in place of the products of axes, which also vanish where axes point backwards.

        Any orientation leads to the right one along these; they are not the derivatives of each other far from it.
        """
        table, turns = self.table, self.table.mask[:, None] * motion.J[3:]
        g, W = self.g.copy(), self.W[: len(self.g)].copy()
        for group in np.unique(table.group[table.axes]):
            i = np.flatnonzero(table.axes & (table.group == group))
            n, b = self._n[i], self._b[i]
            if len(i) == 3:  # x with y, y with z, z with x
                g[i] = pin.log3(n @ np.roll(b, 1, axis=0).T)
            elif len(i) == 2:  # x and y with z
                g[i] = n @ turn_between(np.cross(n[0], n[1]), b[0])
            else:
                continue
            W[i] = np.einsum("ij,ijk->ik", n, turns[i])
        return g, W

    @property
    def wrenches(self) -> RowWrenches:
        """What the rows do to bodies; moved frames are the world."""
        a, b = (np.array([max(0, getattr(row, side)) for row in self.table.rows]) for side in ("body_a", "body_b"))
        return RowWrenches(self.F, a, b)

    @property
    def sizes(self) -> tuple[float, float]:
        """Largest coordinate of the joints and points and of the twists, 1 for axes."""
        speed = max(np.abs(self._V_a).max(), np.abs(self._V_b).max())
        return max(self.table.unit, self._size), float(speed)

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each shape (n, nv)."""
        table, d, omega = self.table, self._d, self._omega
        axes, blade = table.axes[:, None], table.blade[:, None]
        e = cross(d, omega)
        by_b = force_cross(self._V_b, self.F)
        turned = axes * cross(self._b, cross(self._n, omega))
        G_X = by_b + wrench(e + self._e_dot, self.c)
        G_X[:, 3:] += turned + blade * cross(d, self.c_dot)
        G_Y = by_b + force_cross(self._V_a, self.F) + wrench(~blade * e + 2 * self._e_dot, self.c)
        G_Y[:, 3:] += ~blade * self._turn + axes * cross(self._b_dot, self._n) + turned
        X = (G_X @ motion.J + self.F @ (motion.dAdv - motion.dJ)) * table.mask
        Y = (G_Y @ motion.J + self.F @ motion.dAdv) * table.mask
        return X, Y


def turn_between(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The rotation vector that takes one unit vector to another, shape (3,); of opposite ones, any."""
    sine, cosine = np.cross(x, y), float(x @ y)
    size = float(np.linalg.norm(sine))
    if size > NO_TURN:
        return np.arctan2(size, cosine) / size * sine
    if cosine > 0.0:
        return sine
    across = np.cross(x, np.eye(3)[int(np.argmin(np.abs(x)))])
    return np.pi / np.linalg.norm(across) * across
