"""Derivatives by the configuration that the Newton matrix of a step leaves out, because there dt^2 stands before them.

Of the forces W^T la of given multipliers, of M u, and of the accelerations of the rows. They are analytic for points on
planes, limits of joints, dry friction and joints between frames; for round surfaces, features of shapes, beams and
functions of the user they are differences of sixth order of the rows.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.constraints.constraint_set import ConstraintRows
from ngalpha_pin.constraints.frame_rows import FrameRows
from ngalpha_pin.contact.joint_friction import JointRows
from ngalpha_pin.contact.limit_rows import LimitedRows
from ngalpha_pin.contact.point_rows import KinematicRows, Rows
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.numerics.block_matrix import BlockMatrix, dense
from ngalpha_pin.numerics.finite_differences import FIRST, OFFSETS
from ngalpha_pin.sensitivities.row_arms import Arms, by_configuration, of_frames, of_points
from ngalpha_pin.sensitivities.tree import Tree, TreeMotion
from ngalpha_pin.system.system import System

STEP = 1e-3  # of the differences [rad or m], with which they are good to 1e-12


class RowsByQ(NamedTuple):
    """Derivatives by q at given v, a and forces.

    Attributes:
        forces: of la W for each of some la, shape (j, nv, nv).
        acceleration: of the rows, shape (rows, nv).
    """

    forces: np.ndarray
    acceleration: np.ndarray


class Geometry:
    """The derivatives by the configuration of one compiled scene.

    Attributes:
        system: compiled scene.
        tree: which coordinates move which bodies.
    """

    def __init__(self, system: System):
        self.system = system
        self.tree = Tree(system.model)
        self._weightless = system.tree.copy()
        self._weightless.gravity = pin.Motion.Zero()
        self._data = self._weightless.createData()

    def momentum(self, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """D (M u) / dq, shape (nv, nv)."""
        tree, nv = self._weightless, self.system.nv
        found = np.zeros((nv, nv))
        if tree.nv:
            zero = np.zeros(tree.nv)
            pin.computeRNEADerivatives(tree, self._data, q[: tree.nq], zero, u[: tree.nv])
            found[: tree.nv, : tree.nv] = self._data.dtau_dq
        return found

    def rows(
        self,
        t: float,
        sub: Subset,
        q: np.ndarray,
        v: np.ndarray,
        a: np.ndarray,
        forces: np.ndarray,
        parts: list[KinematicRows] | None = None,
    ) -> RowsByQ:
        """Of all rows, at given forces of shape (j, rows); `parts` are the rows there where they are known already."""
        system = self.system
        nv = system.nv
        if parts is None:
            system.dynamics(t, q, v, a)
            parts = row_parts(system, sub, t, q, v, a)
        ends = np.cumsum([0] + [len(part.rate) for part in parts])
        total = RowsByQ(np.zeros((len(forces), nv, nv)), np.zeros((ends[-1], nv)))
        open_, motion = np.zeros(ends[-1], dtype=bool), None
        for part, start, end in zip(parts, ends[:-1], ends[1:], strict=True):
            found = None if system.beams is not None else _arms_of(part, system)
            if found is None:
                open_[start:end] = not isinstance(part, JointRows)
                continue
            for arms, at in found:
                motion = TreeMotion(self.tree, system.motion(v, a)) if motion is None else motion
                _add(total, arms, motion, start + at, forces)
        if open_.any():
            self._add_differences(total, open_, (t, sub, q, v, a), forces)
        return total

    def rates(
        self, t: float, sub: Subset, q: np.ndarray, v: np.ndarray, parts: list[KinematicRows] | None = None
    ) -> np.ndarray:
        """Derivative by q of the rates of all rows but those of joint friction, shape (rows, nv).

        The tangents of round surfaces and of features turn about the normal as well, which the rows themselves leave
        out of their derivatives. `parts` are the rows there, after `dynamics`, where they are known already.
        """
        system, still = self.system, np.zeros(self.system.nv)
        if parts is None:
            system.dynamics(t, q, v, still)
            parts = row_parts(system, sub, t, q, v, still)
        parts = _without_joints(parts)
        if not parts:
            return np.zeros((0, system.nv))
        X = system.row_derivatives(parts, v, still)[0].copy()
        known = [system.beams is None and _arms_of(part, system) is not None for part in parts]
        open_ = ~np.repeat(known, [len(part.rate) for part in parts])
        if open_.any():
            X[open_] = 0.0
            for j, weight, there in self._around(q):
                system.dynamics(t, there, v, still)
                moved = _without_joints(row_parts(system, sub, t, there, v, still))
                X[open_, j] += weight * np.concatenate([part.rate for part in moved])[open_]
            system.dynamics(t, q, v, still)
        return X

    def _around(self, q: np.ndarray) -> Iterator[tuple[int, float, np.ndarray]]:
        """Configurations around q for differences by each coordinate: its number, weight and configuration."""
        for j, way in enumerate(STEP * np.eye(self.system.nv)):
            for i, weight in zip(OFFSETS.tolist(), (FIRST / STEP).tolist(), strict=True):
                if i:
                    yield j, weight, self.system.integrate(q, i * way)

    def _add_differences(
        self,
        total: RowsByQ,
        which: np.ndarray,
        at: tuple[float, Subset, np.ndarray, np.ndarray, np.ndarray],
        forces: np.ndarray,
    ) -> None:
        """Add those of some rows by differences."""
        system, (t, sub, q, v, a) = self.system, at
        for j, weight, there in self._around(q):
            system.dynamics(t, there, v, a)
            parts = row_parts(system, sub, t, there, v, a)
            total.forces[:, :, j] += weight * (forces * which) @ system.directions(parts)
            total.acceleration[which, j] += weight * np.concatenate([x.acceleration for x in parts])[which]
        system.dynamics(t, q, v, a)


def row_parts(
    system: System, sub: Subset, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray
) -> list[KinematicRows]:
    """Rows of contacts, joint friction and constraints, after `dynamics` there."""
    parts: list[KinematicRows] = [system.contact_rows(sub, q, v, a, t)] if sub.k else []
    if system.joint_friction.f:
        parts.append(system.joint_friction.rows(v, a))
    if system.constraints.names:
        parts.append(system.constraint_rows(t, q, v, a))
    return parts


def _without_joints(parts: list[KinematicRows]) -> list[KinematicRows]:
    return [part for part in parts if not isinstance(part, JointRows)]


def full(M: np.ndarray | BlockMatrix) -> np.ndarray:
    """A mass matrix with both of its triangles: Pinocchio fills the upper one."""
    array = dense(M)
    return np.triu(array) + np.triu(array, 1).T


def _add(total: RowsByQ, arms: Arms, motion: TreeMotion, at: np.ndarray, forces: np.ndarray) -> None:
    """Add those of some rows, which stand at some places."""
    W, total.acceleration[at] = by_configuration(arms, motion)
    total.forces[:] += np.einsum("lr,rkj->lkj", forces[:, at], W)
    F = np.concatenate((arms.d, np.cross(arms.c, arms.d) + arms.q), axis=1)
    mask = motion.tree.support[arms.b] - motion.tree.support[arms.a]
    for i, la in enumerate(forces):
        total.forces[i] += motion.turned((la[at][:, None] * mask).T @ F)


def _arms_of(part: KinematicRows, system: System) -> list[tuple[Arms, np.ndarray]] | None:
    """Rows as arms with their places in a part; rows without any do not change; None where it is not known."""
    if isinstance(part, Rows):
        arms = of_points(part)
        return None if arms is None else [(arms, np.arange(len(arms.kind)))]
    if isinstance(part, LimitedRows) and not len(part.sub.own):
        points = part.points
        if points.sub.k == 0:
            return []
        arms = of_points(points) if isinstance(points, Rows) else None
        of = points.sub.of_row
        at = np.where(np.arange(len(of)) < points.sub.k, 0, len(part.sub.limits)) + np.arange(len(of))
        return None if arms is None else [(arms, at)]
    if isinstance(part, ConstraintRows) and len(part.parts) == 1 and isinstance(part.parts[0], FrameRows):
        arms = of_frames(part.parts[0], *system.poses)
        if arms is None:
            return None
        return [(Arms(*(x[part.order] for x in arms)), np.arange(len(part.order)))]
    return None
