"""An actuator of a joint: a force that is affine in its control, in a length and in its rate."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.joint_sum import JointSum, joint_factors
from ngalpha_pin.scene.protocols import Declared, Kinematics
from ngalpha_pin.scene.user_function import array_of, called

NO_RANGE = (-np.inf, np.inf)


def _range(what: str, given: tuple[float, float]) -> tuple[float, float]:
    """Lower and upper bound, which may be infinite."""
    lower, upper = checks.array(what, given, (2,), finite=False)
    if not lower <= upper:
        raise SceneError(f"{what} = {checks.shown(given)} must begin at its lower end")
    return float(lower), float(upper)


class JointActuator:
    """A motor or servo, as the actuators of MJCF.

    With the length l, the sum of gear times joint coordinate, its force is gain . (1, l, l_dot) ctrl + bias . (1, l,
    l_dot), within `force_range`; each joint feels gear times the force. (1, 0, 0) and (0, 0, 0) are a motor, (kp, 0, 0)
    and (0, -kp, -kd) a servo of position. The effort limits of the joints hold as well.

    Args:
        name: of the actuator.
        joints: name of a joint with one coordinate, or gears by joint name.
        gain, bias: shape (3,) each.
        ctrl: the control, a number or a function of (t, q, v); it may be changed during a run.
        ctrl_range, force_range: lower and upper bound.

    Raises:
        SceneError: a shape is wrong or a number is not finite.
    """

    actuated = True
    energy = None

    def __init__(
        self,
        name: str,
        joints: str | Mapping[str, float],
        gain: tuple[float, float, float] = (1.0, 0.0, 0.0),
        bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
        ctrl: float | Callable[[float, np.ndarray, np.ndarray], float] = 0.0,
        ctrl_range: tuple[float, float] = NO_RANGE,
        force_range: tuple[float, float] = NO_RANGE,
    ):
        self.name = checks.name("JointActuator: name", name)
        self.joints = joint_factors(f"actuator {name!r}: joints", joints)
        self.gain, self.bias = (
            checks.vector(f"actuator {name!r}: {w}", x) for w, x in (("gain", gain), ("bias", bias))
        )
        self.ctrl = ctrl if callable(ctrl) else checks.number(f"actuator {name!r}: ctrl", ctrl)
        self.ctrl_range = _range(f"actuator {name!r}: ctrl_range", ctrl_range)
        self.force_range = _range(f"actuator {name!r}: force_range", force_range)

    def __repr__(self) -> str:
        return f"JointActuator({self.name!r}, {self.joints!r})"

    def check(self, scene: Declared) -> None:
        """Find the joints."""
        self._sum = JointSum(f"actuator {self.name!r}", self.joints, scene.model)

    def bind(self, kinematics: Kinematics) -> JointActuator:
        """See `Force`."""
        return self

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `Force`."""
        row = self._sum.row
        state = np.array([1.0, self._sum.value(q), float(row @ v)])
        given = called(f"actuator {self.name!r}", self.ctrl, t, q, v) if callable(self.ctrl) else self.ctrl
        ctrl = float(np.clip(array_of(f"actuator {self.name!r}", given, t, (1,), q, v)[0], *self.ctrl_range))
        slope = self.gain * ctrl + self.bias
        force = float(slope @ state)
        tau += np.clip(force, *self.force_range) * row
        if self.force_range[0] < force < self.force_range[1] and slope[1:].any():
            square = np.outer(row, row)
            K += slope[1] * square
            D += slope[2] * square
