"""Ends of the range of a length or an angle that names of the model describe, as in MJCF: unilateral constraints.

They go along where models are put together, which functions of all coordinates cannot.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import UnknownName
from ngalpha_pin.scene.constraints import WORLD, place_of
from ngalpha_pin.scene.joint_sum import Joints, JointSum
from ngalpha_pin.scene.protocols import Declared
from ngalpha_pin.scene.unilateral import UnilateralConstraint


class LengthLimit(UnilateralConstraint):
    """A length stays above the lower end of its range, or below the upper one.

    Args:
        name: of the constraint.
        end: of the range [m, or rad].
        upper: it is the upper one.
    """

    by_names = True

    def __init__(self, name: str, end: float, upper: bool):
        super().__init__(self._left, name=name)
        self.end, self.upper = float(end), upper

    def _left(self, t: float, q: np.ndarray) -> float:
        """How far the length is from the end."""
        away = self.length(q) - self.end
        return -away if self.upper else away

    def length(self, q: np.ndarray) -> float:
        """The length at q, shape (nq,)."""
        raise NotImplementedError

    def moved(self, prefix: str, on: str, placement: pin.SE3) -> LengthLimit:
        """The same in a scene in which the names of its model stand behind a prefix.

        Args:
            prefix: of the names.
            on: frame of the scene that carries the world of the model.
            placement: of that world in the frame.
        """
        raise NotImplementedError


class JointSumLimit(LengthLimit):
    """A limit of a joint coordinate or of a sum of them, as of a fixed tendon.

    Args:
        joints: name of a joint with one coordinate, or factors by joint name.
    """

    def __init__(self, joints: Joints, name: str, end: float, upper: bool):
        super().__init__(name, end, upper)
        self.joints = joints

    def check(self, scene: Declared) -> None:
        """Find the joints."""
        self._sum = JointSum(self.name, self.joints, scene.model)
        self.gap.row = -self._sum.row if self.upper else self._sum.row
        super().check(scene)

    def length(self, q: np.ndarray) -> float:
        """See `LengthLimit`."""
        return self._sum.value(q)

    def moved(self, prefix: str, on: str, placement: pin.SE3) -> JointSumLimit:
        """See `LengthLimit`."""
        joints = self.joints if isinstance(self.joints, str) else dict(self.joints)
        named = prefix + joints if isinstance(joints, str) else {prefix + j: x for j, x in joints.items()}
        return JointSumLimit(named, prefix + self.name, self.end, self.upper)


class BallLimit(LengthLimit):
    """The largest angle that a ball joint is turned by, about whatever axis.

    Args:
        joint: name of a joint of the kind `pin.JointModelSpherical`.
        name: of the constraint.
        end: the angle, up to pi [rad].
    """

    def __init__(self, joint: str, name: str, end: float):
        super().__init__(name, end, True)
        self.joint = joint

    def check(self, scene: Declared) -> None:
        """Find the joint."""
        if not scene.model.existJointName(self.joint):
            raise UnknownName("joint", self.joint, list(scene.model.names)[1:])
        self._at = int(scene.model.idx_qs[scene.model.getJointId(self.joint)])
        super().check(scene)

    def length(self, q: np.ndarray) -> float:
        """See `LengthLimit`; the angle [rad]."""
        x, y, z, w = (float(number) for number in q[self._at : self._at + 4])
        return 2.0 * math.atan2(math.hypot(x, y, z), abs(w))

    def moved(self, prefix: str, on: str, placement: pin.SE3) -> BallLimit:
        """See `LengthLimit`."""
        return BallLimit(prefix + self.joint, prefix + self.name, self.end)


class PathPoint(NamedTuple):
    """A point that a path goes through.

    Attributes:
        frame: name of a frame of the model, or "world".
        point: in that frame, shape (3,) [m].
    """

    frame: str
    point: np.ndarray


class PathLimit(LengthLimit):
    """A limit of the length of a path of straight pieces, as of a cable through eyes.

    Args:
        points: of the path.
        pieces: numbers of the two points of each piece, and what its length is divided by: the strands of a pulley.
    """

    def __init__(
        self,
        points: Sequence[PathPoint],
        pieces: Sequence[tuple[int, int, float]],
        name: str,
        end: float,
        upper: bool,
    ):
        super().__init__(name, end, upper)
        self.points, self.pieces = list(points), list(pieces)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in ("_model", "_places", "_own")}

    def check(self, scene: Declared) -> None:
        """Find the frames."""
        self._model, self._own = scene.model, threading.local()  # simulators of one scene run on several threads
        placed = ((place_of(scene, p.frame), p.point) for p in self.points)
        self._places = [(joint, pose.act(point)) for (joint, pose), point in placed]
        super().check(scene)

    def length(self, q: np.ndarray) -> float:
        """See `LengthLimit`."""
        if not hasattr(self._own, "data"):
            self._own.data = self._model.createData()
        data = self._own.data
        pin.forwardKinematics(self._model, data, q)
        at = [data.oMi[joint].act(point) for joint, point in self._places]
        return float(sum(np.linalg.norm(at[i] - at[j]) / parts for i, j, parts in self.pieces))

    def moved(self, prefix: str, on: str, placement: pin.SE3) -> PathLimit:
        """See `LengthLimit`."""
        points = [
            PathPoint(on, placement.act(p.point)) if p.frame == WORLD else PathPoint(prefix + p.frame, p.point)
            for p in self.points
        ]
        return PathLimit(points, self.pieces, prefix + self.name, self.end, self.upper)
