"""Rows as wrenches between two bodies, and how they and their accelerations change with the configuration.

Seen from body A, with the relative twist (V, omega), the relative acceleration and a point c of body B, every row is

    W v = d.c_dot + q.omega        acceleration = d.c_ddot + d_dot.c_dot + q.alpha + q_dot.omega

with the wrench F = (d, c x d + q). For planes d and q are fixed in A; for a distance d is the unit vector along it; for
axes that stay perpendicular q = b x n with b fixed in B; for a blade d = b.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.constraints.frame_rows import AXES, BLADE, DISTANCE, PLANE, FrameRows
from ngalpha_pin.contact.point_rows import Rows
from ngalpha_pin.numerics.spatial import cross
from ngalpha_pin.sensitivities.tree import TreeMotion, products


class Arms(NamedTuple):
    """Rows between pairs of bodies.

    Attributes:
        kind: PLANE, DISTANCE, AXES or BLADE, shape (n,).
        a, b: joints of the two bodies, shape (n,).
        c: point of B, shape (n, 3) [m].
        d, q: force and moment of the wrench, shape (n, 3).
        n, axis: of axes, the vector of A and that of B; of a blade that of B, shape (n, 3).
        by_length: one over the distance, zero for others, shape (n,) [1/m].
    """

    kind: np.ndarray
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    q: np.ndarray
    n: np.ndarray
    axis: np.ndarray
    by_length: np.ndarray


def of_points(rows: Rows) -> Arms | None:
    """Contact points on planes; None where there are other surfaces, or some that move along themselves."""
    sub, of = rows.sub, rows.sub.of_row
    if sub.any_curved or sub.surfaces is not None:
        return None
    c, d, zero = rows.c[of], rows.directions, np.zeros((len(of), 3))
    q = rows.F[:, 3:] - cross(c, d)
    kind = np.full(len(of), PLANE)
    return Arms(kind, sub.bodies[sub.body_a][of], sub.bodies[sub.body_b][of], c, d, q, zero, zero, np.zeros(len(of)))


def of_frames(rows: FrameRows, rotations: list[np.ndarray], translations: list[np.ndarray]) -> Arms | None:
    """Rows that tie frames of bodies; None where one of the frames is moved."""
    table = rows.table
    if table.n_moved:
        return None
    R, p = (np.array([x[j] for j in table.joints]) for x in (rotations, translations))
    n = np.einsum("kij,kj->ki", R[table.a], table.vector_a)
    axis = np.einsum("kij,kj->ki", R[table.b], table.vector_b)
    arm = rows.c - p[table.a] - np.einsum("kij,kj->ki", R[table.a], table.point_a)
    length = np.sqrt((arm * arm).sum(axis=1))
    d = rows.F[:, :3]
    q = np.where(table.axes[:, None], cross(axis, n), 0.0)
    by_length = np.where(table.distance, 1.0 / np.where(table.distance, length, 1.0), 0.0)
    return Arms(table.kind, table.joints[table.a], table.joints[table.b], rows.c, d, q, n, axis, by_length)


def by_configuration(arms: Arms, motion: TreeMotion) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives by q of W and of the accelerations at given v and a, shapes (n, nv, nv) and (n, nv).

    Entry (r, k, j) of the first is that of W_rk by coordinate j, without what turns the twists of the coordinates
    themselves (see `TreeMotion.turned`).
    """
    joints, at = np.unique(np.concatenate((arms.a, arms.b)), return_inverse=True)
    (a, b), moved = np.split(at, 2), motion.moved(joints)
    (X_a, dV_a, dA_a), (X_b, dV_b, dA_b) = (tuple(x[i] for x in moved) for i in (a, b))
    V_a, A_a = motion.V[arms.a][:, None], motion.A[arms.a][:, None]
    V = motion.V[arms.b][:, None] - V_a
    A = motion.A[arms.b][:, None] - A_a - products(V_a, V)
    X = X_b - X_a
    # as seen from A, which moves as well
    dV = dV_b - dV_a
    dA = dA_b - dA_a - products(dV_a, V) - products(V_a, dV) - products(X_a, A)
    dV = dV - products(X_a, V)
    return moved_rows(arms, motion, X, (V, A), (dV, dA), X_a)


def moved_rows(
    arms: Arms,
    motion: TreeMotion,
    X: np.ndarray,
    now: tuple[np.ndarray, np.ndarray],
    change: tuple[np.ndarray, np.ndarray],
    X_a: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Change of W and of the accelerations.

    Args:
        arms: the rows.
        motion: of the tree.
        X: displacements of B relative to A, shape (n, p, 6).
        now: relative twist and acceleration, shape (n, 1, 6) each.
        change: of these as seen from A, shape (n, p, 6) each.
        X_a: displacements of A, shape (n, p, 6).

    Returns:
        Shapes (n, nv, p) and (n, p).
    """
    (V, A), (dV, dA) = now, change
    c, d, q, n, axis = (x[:, None] for x in (arms.c, arms.d, arms.q, arms.n, arms.axis))
    omega, d_omega, alpha, d_alpha = V[..., 3:], dV[..., 3:], A[..., 3:], dA[..., 3:]
    dc = X[..., :3] + _x(X[..., 3:], c)
    speed = V[..., :3] + _x(omega, c)
    d_speed = dV[..., :3] + _x(d_omega, c) + _x(omega, dc)
    acceleration = A[..., :3] + _x(alpha, c) + _x(omega, speed)
    d_acceleration = dA[..., :3] + _x(d_alpha, c) + _x(alpha, dc) + _x(d_omega, speed) + _x(omega, d_speed)

    axis_dot, d_axis = _x(omega, axis), _x(X[..., 3:], axis)
    d_axis_dot = _x(d_omega, axis) + _x(omega, d_axis)
    axes, blade = ((arms.kind == kind)[:, None, None] for kind in (AXES, BLADE))
    by_length = arms.by_length[:, None, None] * (arms.kind == DISTANCE)[:, None, None]
    across = speed - d * _dot(d, speed)
    d_dot = by_length * across + blade * axis_dot
    change_d = by_length * (dc - d * _dot(d, dc)) + blade * d_axis
    d_across = d_speed - change_d * _dot(d, speed) - d * (_dot(change_d, speed) + _dot(d, d_speed))
    change_d_dot = by_length * (d_across - across * by_length * _dot(d, dc)) + blade * d_axis_dot
    q_dot, change_q, change_q_dot = (axes * _x(x, n) for x in (axis_dot, d_axis, d_axis_dot))

    turned = _dot(change_d, acceleration) + _dot(d, d_acceleration) + _dot(change_d_dot, speed) + _dot(d_dot, d_speed)
    turned += _dot(change_q, alpha) + _dot(q, d_alpha) + _dot(change_q_dot, omega) + _dot(q_dot, d_omega)
    dF = np.concatenate(np.broadcast_arrays(change_d, _x(dc, d) + _x(c, change_d) + change_q), axis=-1)
    F = np.concatenate((d, _x(c, d) + q), axis=-1)
    dF = dF + _forces(X_a, F)
    mask = motion.tree.support[arms.b] - motion.tree.support[arms.a]
    W = mask[:, :, None] * np.einsum("ks,rjs->rkj", motion.J, dF)
    return W, turned[..., 0]


def _x(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products along the last axis."""
    found = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return found


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(axis=-1, keepdims=True)


def _forces(x: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Dual products of motions and wrenches along the last axis."""
    linear, angular, force, moment = x[..., :3], x[..., 3:], f[..., :3], f[..., 3:]
    return np.concatenate((_x(angular, force), _x(linear, force) + _x(angular, moment)), axis=-1)
