"""In which directions the mechanism can move a contact point: those that have friction rows."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from ngalpha_pin.common.tolerances import MOVABLE, PARALLEL, TINY
from ngalpha_pin.contact.cones import DRILLING, KINDS, ROLLING
from ngalpha_pin.contact.friction_axes import FrictionAxes
from ngalpha_pin.contact.moving_surfaces import MovingSurfaces
from ngalpha_pin.numerics.spatial import cross, dot


class _Table(Protocol):
    """Contact points as `ContactTable` has them."""

    n_points: int
    first_place: Any
    normal: Any
    axis: Any
    curved: Any
    drilling: Any
    rolling: Any
    mu: Any
    bodies: Any
    body_a: Any
    body_b: Any
    support: Any
    point: Any
    radius: Any
    surfaces: MovingSurfaces
    axes: FrictionAxes


CHUNK = 1 << 15  # numbers of an array over points and coordinates: larger ones are slow to get from the system
# reference axis of the tangents on a sphere: no scene is likely to have a normal along it
GENERIC_AXIS = np.array([0.3567, 0.8321, 0.4249]) / np.linalg.norm([0.3567, 0.8321, 0.4249])


def plane_tangents(normals: np.ndarray) -> np.ndarray:
    """Two unit vectors for each unit normal that complete it to a right-handed frame (t1, t2, n), shape (n, 2, 3).

    For a horizontal plane they are the x and y axes.
    """
    e = np.where(np.abs(normals[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    t1 = e - dot(e, normals)[:, None] * normals
    t1 /= np.sqrt(dot(t1, t1))[:, None]
    return np.stack((t1, cross(normals, t1)), axis=1)


def friction_directions(table: _Table, translation: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Kinds of the friction rows of each contact and the vectors they are built from.

    A direction in which the mechanism cannot move the contact point (a planar mechanism in space) would be a zero row
    and make the Newton matrix singular, so it is dropped.

    Args:
        table: of the contacts.
        translation: see `point_motion`.
        rotation: likewise.

    Returns:
        Which kinds of rows each contact has (see `cones`), shape (n, KINDS). And per contact two vectors, shape
        (n, 2, 3): the tangents of a plane, or, for a round surface, its reference axis and zero.
    """
    first, curved = table.first_place, table.curved
    own = first == np.arange(table.n_points)  # the other places of a pair have the directions of the first one
    tangents, movable = np.zeros((table.n_points, 2, 3)), np.zeros((table.n_points, KINDS), dtype=bool)
    flat, round_ = np.flatnonzero(own & ~curved), np.flatnonzero(own & curved)
    tangents[flat], movable[flat, :2] = _plane_directions(table.normal[flat], translation[flat])
    tangents[round_, 0], movable[round_, :2] = _round_directions(table.axis[round_], translation[round_])
    n = table.normal[flat]
    spins = dot(n, np.einsum("kij,kj->ki", rotation[flat], n)) > MOVABLE**2 * _trace(rotation[flat])
    movable[flat, DRILLING] = (table.drilling[flat] > 0.0) & spins
    movable[round_, DRILLING] = (table.drilling[round_] > 0.0) & rotation[round_].any(axis=(1, 2))
    movable[flat, ROLLING:] = _turns_about(tangents[flat], rotation[flat])
    movable[round_, ROLLING + 1] = _turns_about(tangents[round_, :1], rotation[round_])[:, 0]
    across = np.eye(3) - tangents[round_, 0, :, None] * tangents[round_, 0, None, :]
    movable[round_, ROLLING] = _turns_about(across, rotation[round_]).any(axis=1)
    # the axes of an ellipse may turn; where one of them does not move, see `blocked_tangents`
    movable[table.axes.has, :DRILLING] = movable[table.axes.has, ROLLING:] = True
    movable = movable[first]
    movable[:, :ROLLING] &= (table.mu[: table.n_points] > 0.0)[:, None]
    movable[:, ROLLING:] &= (table.rolling[: table.n_points] > 0.0)[:, None]
    return movable, tangents[first]


def _turns_about(vectors: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Whether bodies turn about vectors, shape (n, j, 3) -> (n, j)."""
    about = np.einsum("kti,kij,ktj->kt", vectors, rotation, vectors)
    return np.asarray(about > MOVABLE**2 * np.maximum(_trace(rotation), TINY)[:, None])


def _plane_directions(normals: np.ndarray, G: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tangents of planes, shape (n, 2, 3), and which of them move, (n, 2); where only one does, it is the first."""
    T = plane_tangents(normals)
    S = T @ G @ T.transpose(0, 2, 1)
    middle, half = 0.5 * _trace(S), np.hypot(0.5 * (S[:, 0, 0] - S[:, 1, 1]), S[:, 0, 1])
    values = np.column_stack((middle - half, middle + half))  # eigenvalues; few need eigenvectors, which take long
    movable: np.ndarray = values > MOVABLE**2 * np.maximum(_trace(G), TINY)[:, None]
    one = movable.sum(axis=1) == 1
    t = np.einsum("ki,kij->kj", np.linalg.eigh(S[one])[1][:, :, 1], T[one])
    largest = np.take_along_axis(t, np.argmax(np.abs(t), axis=1)[:, None], axis=1)
    t *= np.sign(largest)
    T[one] = np.stack((t, cross(normals[one], t)), axis=1)
    movable[one] = [True, False]
    return T, movable


def _round_directions(axes: np.ndarray, G: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reference axes of round surfaces, shape (n, 3), and which of the tangents across and along them move, (n, 2)."""
    values, vectors = np.linalg.eigh(G)
    size, still = _trace(G), vectors[:, :, 0]
    axes = np.where(np.any(axes, axis=1)[:, None], axes, GENERIC_AXIS)
    planar = (values[:, 0] <= MOVABLE**2 * size) & (MOVABLE**2 * size < values[:, 1])
    # in a planar motion the axis is what cannot move
    turned = np.asarray(planar & (np.abs(dot(axes, still)) <= 1 - PARALLEL))
    axes = np.where(turned[:, None], still, axes)
    along = dot(axes, np.einsum("kij,kj->ki", G, axes)) > MOVABLE**2 * size
    return axes, np.column_stack((size > 0.0, along))


def _trace(G: np.ndarray) -> np.ndarray:
    return np.asarray(np.trace(G, axis1=1, axis2=2))


def point_motion(model: pin.Model, data: pin.Data, table: _Table) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gram matrices of the translation and rotation of B relative to A, in A's axes, each (n, 3, 3).

    The third one is that of the motion of the surfaces along themselves, as large as the translation.

    They are sums over random configurations, so that what vanishes in them never moves.
    """
    rng = np.random.default_rng(0)
    translation, rotation, along = np.zeros((3, table.n_points, 3, 3))
    asked = np.unique(table.first_place)
    round_, normals = asked[table.curved[asked]], table.normal.copy()
    codes, of = np.unique(table.body_a[asked] * len(table.bodies) + table.body_b[asked], return_inverse=True)
    pairs = np.column_stack(np.divmod(codes, max(len(table.bodies), 1)))
    ways = _ways(table.support[pairs[:, 1]] - table.support[pairs[:, 0]])
    size = max(CHUNK // max(3 * ways[0].shape[1], 1), 1)
    chunks = [(asked[i : i + size], of.ravel()[i : i + size]) for i in range(0, len(asked), size)]
    for _ in range(4):
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        J = pin.computeJointJacobians(model, data, q).reshape(6, -1)
        normals[round_] = rng.normal(size=(len(round_), 3))
        poses = [data.oMi[int(joint)] for joint in table.bodies]
        for k, pair in chunks:
            p = _add_grams(table, k, poses, normals[k], (J, ways, pairs, pair), translation, rotation)
            _add_driven(table, k, poses, p, along)
    whole = _trace(along)
    size_along = np.where(whole > 0.0, _trace(translation), 0.0) / np.where(whole > 0.0, whole, 1.0)
    return translation, rotation, size_along[:, None, None] * along


def _ways(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The coordinates that move some pairs of bodies, and the signs with which they do, from a mask over all of them.

    Of shape (pairs, most of one pair) each; the sign is zero where a pair has fewer.
    """
    moved = mask != 0.0
    width = int(moved.sum(axis=1).max(initial=0))
    columns = np.argsort(~moved, axis=1, kind="stable")[:, :width]
    return columns, np.take_along_axis(mask, columns, axis=1)


def _add_grams(
    table: _Table,
    k: np.ndarray,
    poses: list[pin.SE3],
    normals: np.ndarray,
    motion: tuple[np.ndarray, tuple[np.ndarray, np.ndarray], np.ndarray, np.ndarray],
    translation: np.ndarray,
    rotation: np.ndarray,
) -> np.ndarray:
    """Add what one configuration has to the Gram matrices of points k, whose places in the world are returned."""
    J, (columns, signs), pairs, pair = motion
    R, t = np.array([pose.rotation for pose in poses]), np.array([pose.translation for pose in poses])
    R_a = R[table.body_a[k]]
    n = np.where(table.curved[k, None], normals, np.einsum("kij,kj->ki", R_a, normals))
    p = np.einsum("kij,kj->ki", R[table.body_b[k]], table.point[k]) + t[table.body_b[k]] - table.radius[k, None] * n
    # in the axes of A, by pair; and of each point what turning about the origin of the world adds. Points come last,
    # so that few long sums are left
    by_pair = np.einsum("pji,cjpw->ciwp", R[pairs[:, 0]], J.reshape(2, 3, -1)[:, :, columns] * signs).copy()
    (x, y, z), (J_x, J_y, J_z) = np.einsum("kji,kj->ki", R_a, p).T.copy(), by_pair[1].take(pair, axis=2)
    J_p = by_pair[0].take(pair, axis=2)
    J_p[0] -= y * J_z - z * J_y
    J_p[1] -= z * J_x - x * J_z
    J_p[2] -= x * J_y - y * J_x
    gram = np.empty((3, 3, len(k)))
    for i, j in (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2):
        gram[i, j] = gram[j, i] = np.einsum("wk,wk->k", J_p[i], J_p[j])
    translation[k] += gram.transpose(2, 0, 1)
    rotation[k] += np.einsum("iwp,jwp->pij", by_pair[1], by_pair[1])[pair]
    return p


def _add_driven(table: _Table, k: np.ndarray, poses: list[pin.SE3], p: np.ndarray, along: np.ndarray) -> None:
    """Add the squares of the ways of surfaces that move along themselves; p: the points in the world."""
    driven = table.surfaces.of(np.arange(table.n_points))
    if driven is None:
        return
    for a, b in np.unique(np.column_stack((table.body_a, table.body_b))[k], axis=0):
        here = (table.body_a[k] == a) & (table.body_b[k] == b)
        w = driven.velocities(k[here], poses[a], poses[b], p[here]) @ poses[a].rotation
        along[k[here]] += w[:, :, None] * w[:, None, :]
