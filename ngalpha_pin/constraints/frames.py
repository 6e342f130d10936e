"""Joints between frames, and frames with a given motion, as rows of a `FrameTable`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ngalpha_pin.constraints.frame_rows import AXES, BLADE, DISTANCE, PLANE, FrameRow, FrameRows, FrameTable, MovedFrame
from ngalpha_pin.constraints.provider import Bodies
from ngalpha_pin.errors import SceneError
from ngalpha_pin.numerics.finite_differences import two_derivatives
from ngalpha_pin.scene.breakpoints import room_around
from ngalpha_pin.scene.constraints import Distance, FrameConstraint, FrameTrajectory, KnifeEdge, Weld, place_of
from ngalpha_pin.scene.user_function import TIME_STEP, called

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


Place = tuple[int, pin.SE3]


class Frames:
    """The frame constraints of a scene; see `provider.Provider`."""

    everywhere = True

    def __init__(self, model: pin.Model, rows: list[tuple[str, FrameRow]], trajectories: list[FrameTrajectory]):
        self._trajectories = trajectories
        self.table = FrameTable(model, [row for _, row in rows], len(trajectories))
        self.names_g = tuple(name for name, row in rows if row.kind != BLADE)
        self.names_gamma = tuple(name for name, row in rows if row.kind == BLADE)
        self.group = self.table.group

    def rows(self, bodies: Bodies) -> FrameRows:
        """Rows at one motion."""
        moved = [moved_frame(trajectory, bodies.t) for trajectory in self._trajectories]
        return FrameRows(self.table, bodies.rotation, bodies.translation, moved).move(bodies.motion)


def frames(scene: Scene, model: pin.Model) -> Frames | None:
    """The frame constraints of a scene; None where it has none."""
    rows: list[tuple[str, FrameRow]] = []
    trajectories: list[FrameTrajectory] = []
    for constraint in scene.constraints:
        group = 2 * len(rows)
        if isinstance(constraint, FrameTrajectory):
            trajectories.append(constraint)
            made = _joint_rows(Weld, (-len(trajectories), pin.SE3.Identity()), place_of(scene, constraint.frame), group)
        elif isinstance(constraint, FrameConstraint):
            made = frame_rows(scene, constraint, group)
        else:
            continue
        rows += [(constraint.name, row) for row in made]
    if not rows:
        return None
    rows.sort(key=lambda row: row[1].kind == BLADE)
    return Frames(model, rows, trajectories)


def frame_rows(scene: Scene, constraint: FrameConstraint, group: int = 0) -> list[FrameRow]:
    """The rows of one joint between frames; `group` and `group + 1` number its units."""
    a, b = constraint.poses(scene)
    zero = np.zeros(3)
    if isinstance(constraint, Distance):
        return [_row(DISTANCE, a, b, zero, zero, constraint.length, group)]
    if isinstance(constraint, KnifeEdge):
        return [_row(BLADE, a, b, zero, b[1].rotation[:, 2], 0.0, group)]
    return _joint_rows(type(constraint), a, b, group)


def _joint_rows(kind: type[FrameConstraint], a: Place, b: Place, group: int) -> list[FrameRow]:
    zero, R_a, R_b = np.zeros(3), a[1].rotation, b[1].rotation
    planes = [_row(PLANE, a, b, R_a[:, i], zero, 0.0, group) for i in kind.planes]
    return planes + [_row(AXES, a, b, R_a[:, i], R_b[:, j], 0.0, group + 1) for i, j in kind.axes]


def _row(kind: int, a: Place, b: Place, n: np.ndarray, axis_b: np.ndarray, length: float, group: int) -> FrameRow:
    return FrameRow(kind, a[0], b[0], n.copy(), a[1].translation, b[1].translation, axis_b.copy(), length, group)


def moved_frame(trajectory: FrameTrajectory, t: float) -> MovedFrame:
    """Where the frame has to be at t, with its world twist and its derivative.

    Raises:
        SceneError: the function gives something else than a finite pose.
    """
    given = called(trajectory.name, trajectory.pose, t)
    if isinstance(given, tuple) and len(given) == 3:
        pose, twist, twist_dot = given[0], *(np.asarray(x, dtype=float) for x in given[1:])
    else:
        pose = given
        if isinstance(pose, pin.SE3):
            inverse = pose.inverse()
            _, twist, twist_dot = two_derivatives(
                lambda s: pin.log6(inverse * trajectory.pose(t + s)).vector,
                TIME_STEP,
                room_around(t, trajectory.breakpoints),
            )
        else:
            twist = twist_dot = np.full(6, np.nan)
    if not (
        isinstance(pose, pin.SE3)
        and twist.shape == twist_dot.shape == (6,)
        and np.isfinite([*pose.homogeneous.ravel(), *twist, *twist_dot]).all()
    ):
        raise SceneError(
            f"{trajectory.name}: the function gave {given!r} at t = {t:g}; it must be a finite pin.SE3, "
            "or (pin.SE3, twist, acceleration)"
        )
    return MovedFrame(pose, pose.toActionMatrix() @ twist, pose.toActionMatrix() @ twist_dot)
