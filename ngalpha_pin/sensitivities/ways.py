"""Contact points and planes that move in their bodies: what that does to gaps and rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.contact.limit_rows import LimitedRows
from ngalpha_pin.contact.point_rows import KinematicRows, Rows
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.numerics.spatial import motion_cross
from ngalpha_pin.sensitivities.columns import Columns
from ngalpha_pin.sensitivities.configuration import Geometry
from ngalpha_pin.sensitivities.row_arms import moved_rows, of_points
from ngalpha_pin.sensitivities.tree import TreeMotion


class Ways(NamedTuple):
    """Change of the rows of a subset of contacts, columns last.

    Attributes:
        gaps: shape (k, p).
        W: shape (k + m, nv, p).
        acceleration: shape (k + m, p).
    """

    gaps: np.ndarray
    W: np.ndarray
    acceleration: np.ndarray


def ways_of(
    geometry: Geometry, sub: Subset, rows: KinematicRows, v: np.ndarray, a: np.ndarray, columns: Columns, p: int
) -> Ways | None:
    """What the columns do to the rows of contacts, after `dynamics` at the same motion; None is nothing."""
    points = rows.points if isinstance(rows, LimitedRows) else rows
    if columns.points is None or columns.planes is None or not isinstance(points, Rows):
        return None
    system = geometry.system
    arms = of_points(points)
    assert arms is not None  # columns of other surfaces are refused
    motion = TreeMotion(geometry.tree, system.motion(v, a))
    few = points.sub
    rotations = system.poses[0]
    way, lift = (
        _in_world(columns.points, few, few.body_b, rotations, p),
        _in_world(columns.planes, few, few.body_a, rotations, p),
    )
    of = few.of_row
    X = np.zeros((len(of), p, 6))
    X[:, :, :3] = way[of].transpose(0, 2, 1)
    V = (motion.V[arms.b] - motion.V[arms.a])[:, None]
    A = (motion.A[arms.b] - motion.A[arms.a])[:, None]
    A = A - motion_cross(motion.V[arms.a], V[:, 0])[:, None]
    nothing = np.zeros_like(X)
    W, acceleration = moved_rows(arms, motion, X, (V, A), (nothing, nothing), nothing)
    gaps = np.einsum("ki,kip->kp", points.normals, way - lift)
    return _placed(sub, few, gaps, W, acceleration)


def _placed(sub: Subset, few: Subset, gaps: np.ndarray, W: np.ndarray, acceleration: np.ndarray) -> Ways:
    """The changes of points among those of a subset that also has limits."""
    if few is sub:
        return Ways(gaps, W, acceleration)
    p, nv = gaps.shape[1], W.shape[1]
    at = np.concatenate((np.arange(few.k), sub.k + np.arange(few.m)))
    ways = Ways(np.zeros((sub.k, p)), np.zeros((sub.k + sub.m, nv, p)), np.zeros((sub.k + sub.m, p)))
    ways.gaps[: few.k], ways.W[at], ways.acceleration[at] = gaps, W, acceleration
    return ways


def _in_world(array: np.ndarray, sub: Subset, body: np.ndarray, rotations: list[np.ndarray], p: int) -> np.ndarray:
    """Ways in bodies, of all contacts of the scene, as ways of some contacts in the world, shape (k, 3, p)."""
    found = np.zeros((sub.k, 3, p))
    for i, (contact, place) in enumerate(zip(sub.index.tolist(), body.tolist(), strict=True)):
        found[i, :, : array.shape[2]] = rotations[int(sub.bodies[place])] @ array[contact]
    return found
