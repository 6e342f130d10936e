"""An angle between two frames that follows a given function of time, such as (153) of the knee of the hopper."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ngalpha_pin.constraints.frame_rows import ANGLE, FrameRow
from ngalpha_pin.constraints.joint_trajectory import derivatives_of
from ngalpha_pin.constraints.provider import Bodies, RowWrenches
from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.contact.reach import moved_by
from ngalpha_pin.numerics.spatial import dot, force_cross, motion_cross
from ngalpha_pin.scene.constraints import DrivenAngle

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


class DrivenAngles:
    """The driven angles of a scene; see `provider.Provider`."""

    everywhere = True

    def __init__(self, scene: Scene, model: pin.Model, driven: list[DrivenAngle]):
        sides = [constraint.poses(scene) for constraint in driven]
        self.joints = np.array([[joint for joint, _ in side] for side in sides])
        self.bases = np.array([[pose.rotation for _, pose in side] for side in sides])
        self.laws = [derivatives_of(constraint.angle, constraint.name, constraint.breakpoints) for constraint in driven]
        self.names_g: tuple[str, ...] = tuple(constraint.name for constraint in driven)
        self.names_gamma: tuple[str, ...] = ()
        self.group = np.arange(len(driven))
        self.support = np.array([[moved_by(model, joint) for joint in pair] for pair in self.joints])

    def frame_rows(self, which: np.ndarray) -> list[FrameRow]:
        """Some of the rows, for the kernel."""
        found = []
        for i in which:
            (a, b), (R_a, R_b) = self.joints[i].tolist(), self.bases[i]
            found.append(FrameRow(ANGLE, a, b, R_a[:, 2], R_a[:, 0], np.zeros(3), R_b[:, 0], 0.0, 0))
        return found

    def rows(self, bodies: Bodies) -> DrivenAngleRows:
        """Rows at one motion."""
        wanted = np.array([law(bodies.t) for law in self.laws])
        return DrivenAngleRows(self, bodies, wanted)


class DrivenAngleRows:
    """Rows of `DrivenAngles` at one motion; attributes as those of `provider.ProviderRows`.

    Compiled twin: engine/kernel/frames.c.

    With the axis e of frame a, a row is the world wrench F = (0, e): rate = e.omega_rel - angle_dot.
    """

    def __init__(self, table: DrivenAngles, bodies: Bodies, wanted: np.ndarray):
        motion = bodies.motion
        R = np.array([[bodies.rotation[joint] for joint in pair] for pair in table.joints]) @ table.bases
        R_a, R_b = R[:, 0], R[:, 1]
        x_b = np.einsum("kij,ki->kj", R_a, R_b[:, :, 0])  # x-axis of b in the axes of a
        angle = np.arctan2(x_b[:, 1], x_b[:, 0]) - wanted[:, 0]
        self.g = (angle + np.pi) % (2 * np.pi) - np.pi
        self._F = F = np.concatenate((np.zeros((len(angle), 3)), R_a[:, :, 2]), axis=1)
        self.wrenches = RowWrenches(F, *table.joints.T)
        self._V_a, self._V_b = ((table.support[:, i] * motion.v) @ motion.J.T for i in (0, 1))
        self._mask = table.support[:, 1] - table.support[:, 0]
        self.W = (F @ motion.J) * self._mask
        relative = self._V_b - self._V_a
        self.rate = dot(F, relative) - wanted[:, 1]
        bias = ((F @ motion.dJ) * self._mask) @ motion.v - dot(F, motion_cross(self._V_a, relative))
        self.acceleration = self.W @ motion.a + bias - wanted[:, 2]
        self.sizes = np.pi, float(max(np.abs(self._V_b).max(), np.abs(wanted[:, 1]).max()))

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each shape (n, nv)."""
        by_b = force_cross(self._V_b, self._F)
        X = (by_b @ motion.J + self._F @ (motion.dAdv - motion.dJ)) * self._mask
        Y = ((by_b + force_cross(self._V_a, self._F)) @ motion.J + self._F @ motion.dAdv) * self._mask
        return X, Y


def driven_angles(scene: Scene, model: pin.Model) -> DrivenAngles | None:
    """The driven angles of a scene; None where it has none."""
    found = [constraint for constraint in scene.constraints if isinstance(constraint, DrivenAngle)]
    return DrivenAngles(scene, model, found) if found else None
