"""A spring of all coordinates of a ball joint or a free joint: MJCF's `stiffness` of these joints.

Of a turn R from the rest it is the rotation vector theta = log(R) that is stretched. Its rate by the angular velocity
in the body is the inverse right Jacobian (Sola, Deray and Atchuthan 2018, equation 144), whose transpose leaves theta
as it is: the torque -k theta in the axes of the body is the gradient of k |theta|^2 / 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.scene.protocols import Declared, Kinematics

# half angle [rad] below which 1 - h cot h loses more digits than its series of three terms
SMALL = 0.05
PLACES = {"JointModelSpherical": 0, "JointModelFreeFlyer": 3}  # of the quaternion in the coordinates of the joint


class PoseSpring:
    """A linear spring that pulls a ball joint or a free joint back to a configuration.

    The torque is -stiffness theta, with theta the rotation vector from the rest, the shorter way; at half a turn from
    the rest it jumps to the other side. Of a free joint the force is -stiffness (p - p_rest) besides.

    Args:
        joint: name of a joint of the kind `pin.JointModelSpherical` or `pin.JointModelFreeFlyer`.
        stiffness: [N m / rad], of a free joint also [N / m].
        rest: configuration of the joint without force, with a unit quaternion (x, y, z, w), as in q: shape (4,), or of
            a free joint (7,) with the position [m] first; None is the neutral one.

    Raises:
        SceneError: the stiffness is not finite or negative; when it is added also: the joint is of another kind, or the
            rest has another length, is not finite or has a quaternion of zero. UnknownName: there is no such joint.
    """

    actuated = False

    def __init__(self, joint: str, stiffness: float, rest: Sequence[float] | np.ndarray | None = None):
        self.joint = checks.name("PoseSpring: joint", joint)
        self.stiffness = checks.number(f"PoseSpring {joint!r}: stiffness", stiffness, 0.0)
        self.rest = rest

    def check(self, scene: Declared) -> None:
        """Find the coordinates."""
        model, what = scene.model, f"PoseSpring {self.joint!r}"
        if not model.existJointName(self.joint):
            raise UnknownName("joint", self.joint, list(model.names)[1:])
        j = model.getJointId(self.joint)
        kind = model.joints[j].shortname()
        if kind not in PLACES:
            raise SceneError(f"{what}: expected a ball joint or a free joint, not a {kind}, which takes a JointSpring")
        self._moves = PLACES[kind] > 0
        self._q, self._v = int(model.idx_qs[j]), int(model.idx_vs[j])
        rest = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        if self.rest is not None:
            rest[3 - PLACES[kind] :] = checks.vector(f"{what}: rest", self.rest, model.nqs[j])
        length = float(np.linalg.norm(rest[3:]))
        if not length:
            raise checks.fail(f"{what}: rest", self.rest, "a unit quaternion (x, y, z, w), at its end")
        rest[3:] /= length
        self._rest = rest

    def bind(self, kinematics: Kinematics) -> PoseSpring:
        """See `Force`."""
        return self

    def enter(self, laws: Any) -> None:
        """Become one of the force laws of the engine."""
        laws.add_pose_spring(self._q, self._v, self._moves)

    @property
    def numbers(self) -> list[float]:
        """What the engine is told in every call."""
        return [self.stiffness, *self._rest.tolist()]

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `Force`."""
        theta, away = self._turn(q), self._way(q)
        at, n = self._v, len(away)
        if n:
            own = slice(at, at + 3)
            tau[own] -= self.stiffness * away
            K[own, own] -= self.stiffness * np.eye(3)
            K[own, at + 3 : at + 6] -= self.stiffness * pin.skew(away)
        own = slice(at + n, at + n + 3)
        tau[own] -= self.stiffness * theta
        K[own, own] -= self.stiffness * _inverse_right_jacobian(theta)

    def energy(self, q: np.ndarray) -> float:
        """Energy stored in the spring [J]."""
        theta, away = self._turn(q), self._way(q)
        return 0.5 * self.stiffness * float(theta @ theta + away @ away)

    def _turn(self, q: np.ndarray) -> np.ndarray:
        """The rotation vector from the rest, in the axes of the body as in those of the rest, shape (3,) [rad]."""
        at = self._q + (3 if self._moves else 0)
        w = float(self._rest[3:] @ q[at : at + 4])
        vector = (
            self._rest[6] * q[at : at + 3] - q[at + 3] * self._rest[3:6] - np.cross(self._rest[3:6], q[at : at + 3])
        )
        vector, w = (-vector, -w) if w < 0.0 else (vector, w)
        sine = float(np.linalg.norm(vector))
        return np.asarray(vector * (2.0 * np.arctan2(sine, w) / sine if sine else 2.0))

    def _way(self, q: np.ndarray) -> np.ndarray:
        """The way from the rest in the axes of the body, shape (3,) [m]; shape (0,) of a ball joint."""
        if not self._moves:
            return np.zeros(0)
        R = pin.Quaternion(q[self._q + 3 : self._q + 7]).toRotationMatrix()
        return np.asarray(R.T @ (q[self._q : self._q + 3] - self._rest[:3]))


def _inverse_right_jacobian(theta: np.ndarray) -> np.ndarray:
    """Derivative of theta by the angular velocity in the body, shape (3, 3): 1 + [theta] / 2 + c [theta]^2."""
    half = 0.5 * float(np.linalg.norm(theta))
    if half < SMALL:
        c = 1.0 / 12.0 + half**2 / 180.0 + half**4 / 1890.0
    else:
        c = (1.0 - half / np.tan(half)) / (4.0 * half**2)
    turn = pin.skew(theta)
    return np.asarray(np.eye(3) + 0.5 * turn + c * turn @ turn)
