"""In which directions the mechanism can move a contact point: those that have friction rows."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from ngalpha_pin.tolerances import MOVABLE, TINY


class _Table(Protocol):
    """Contact points as `ContactTable` has them."""

    n_points: int
    first_place: Any
    normal: Any
    axis: Any
    curved: Any
    drilling: Any
    mu: Any
    bodies: Any
    body_a: Any
    body_b: Any
    support: Any
    point: Any
    radius: Any


# reference axis of the tangents on a sphere: no scene is likely to have a normal along it
GENERIC_AXIS = np.array([0.3567, 0.8321, 0.4249]) / np.linalg.norm([0.3567, 0.8321, 0.4249])


def plane_tangents(normal: np.ndarray) -> np.ndarray:
    """Two unit vectors that complete a unit normal to a right-handed frame (t1, t2, n), shape (2, 3).

    For a horizontal plane they are the x and y axes.
    """
    e = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    t1 = e - (e @ normal) * normal
    t1 /= np.linalg.norm(t1)
    return np.array([t1, np.cross(normal, t1)])


def friction_directions(
    table: _Table, translation: np.ndarray, rotation: np.ndarray
) -> tuple[list[list[int]], np.ndarray]:
    """Kinds of the friction rows of each contact and the vectors they are built from.

    A direction in which the mechanism cannot move the contact point (a planar mechanism in space) would be a zero row
    and make the Newton matrix singular, so it is dropped.

    Args:
        table: of the contacts.
        translation: see `point_motion`.
        rotation: likewise.

    Returns:
        For each contact the kinds of its rows: 0 and 1 the first and second tangent, 2 drilling. And per contact two
        vectors, shape (n, 2, 3): the tangents of a plane, or, for a round surface, its reference axis and zero.
    """
    kinds: list[list[int]] = []
    tangents = np.zeros((table.n_points, 2, 3))
    first = table.first_place
    for k in range(table.n_points):
        if first[k] < k:  # another place of the same pair
            tangents[k] = tangents[first[k]]
            kinds.append(kinds[first[k]])
            continue
        G = translation[k]
        size = np.trace(G)
        normal_direction = table.normal[k]
        if not table.curved[k]:
            tangents[k], movable = _plane_directions(normal_direction, G)
        else:
            values, vectors = np.linalg.eigh(G)
            axis = table.axis[k] if table.axis[k].any() else GENERIC_AXIS
            if values[0] <= MOVABLE**2 * size < values[1]:  # planar motion: the axis is what cannot move
                axis = axis if abs(axis @ vectors[:, 0]) > 1 - 1e-12 else vectors[:, 0]
            tangents[k, 0] = axis
            along = axis @ G @ axis > MOVABLE**2 * size
            movable = [bool(size > 0), bool(along)]
        drill = table.drilling[k] > 0 and (not table.curved[k] or rotation[k].any())
        if drill and not table.curved[k]:
            drill = normal_direction @ rotation[k] @ normal_direction > MOVABLE**2 * np.trace(rotation[k])
        rows = [i for i in (0, 1) if movable[i]] + [2] * bool(drill)
        kinds.append(rows if table.mu[k] > 0 else [])
    return kinds, tangents


def _plane_directions(normal: np.ndarray, G: np.ndarray) -> tuple[np.ndarray, list[bool]]:
    """Tangents of a plane and which of them move; where only one does, it is the first."""
    T = plane_tangents(normal)
    values, vectors = np.linalg.eigh(T @ G @ T.T)
    movable = values > MOVABLE**2 * max(np.trace(G), TINY)
    if movable.sum() != 1:
        return T, [bool(m) for m in movable]
    t = vectors[:, 1] @ T
    t *= np.sign(t[np.argmax(np.abs(t))])
    return np.array([t, np.cross(normal, t)]), [True, False]


def point_motion(model: pin.Model, data: pin.Data, table: _Table) -> tuple[np.ndarray, np.ndarray]:
    """Gram matrices of the translation and rotation of B relative to A, in A's axes, each (n, 3, 3).

    They are sums over random configurations, so that what vanishes in them never moves.
    """
    rng = np.random.default_rng(0)
    translation, rotation = np.zeros((table.n_points, 3, 3)), np.zeros((table.n_points, 3, 3))
    for _ in range(4):
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        J = pin.computeJointJacobians(model, data, q).reshape(6, -1)
        for k in np.unique(table.first_place):
            a, b = int(table.bodies[table.body_a[k]]), int(table.bodies[table.body_b[k]])
            mask = table.support[table.body_b[k]] - table.support[table.body_a[k]]
            moved = np.flatnonzero(mask)
            R = data.oMi[a].rotation
            n = R @ table.normal[k] if not table.curved[k] else rng.normal(size=3)
            p = data.oMi[b].act(table.point[k]) - table.radius[k] * n
            Jp = R.T @ ((J[:3, moved] - pin.skew(p) @ J[3:, moved]) * mask[moved])
            Jr = R.T @ (J[3:, moved] * mask[moved])
            translation[k] += Jp @ Jp.T
            rotation[k] += Jr @ Jr.T
    return translation, rotation
