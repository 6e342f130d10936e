"""A quadruped that stands, or walks at a speed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.robots import load
from ngalpha_pin.system.state import State

from .scene_env import SceneEnv

LOW, TILT = 0.5, 0.5  # parts of the height at the start, and cosine of the tilt, below which it has fallen
COST = 0.05  # of a full action


class Quadruped(SceneEnv):
    """The quadruped of 12 kg on its feet: actions are torques of its twelve joints, beside those of its servos.

    Observed are height, orientation, joints and velocities of the base in its own frame, shape (34,). The reward of an
    action is 1 at the wanted speed, less where it is missed and for what the action costs; the episode ends in a fall.

    Args:
        speed: to walk at along x [m/s]; 0 is to stand.
        effort: torque of an action of 1 [N m].
        kp: stiffness of the servos that hold the posture [N m / rad].
        kd: their damping [N m s / rad].
        noise: of joints and velocities at the start [rad, rad/s].
        **options: of `SceneEnv`: dt, hold, method, render_mode.
    """

    def __init__(
        self,
        speed: float = 0.0,
        effort: float = 20.0,
        kp: float = 40.0,
        kd: float = 1.0,
        noise: float = 0.05,
        **options: Any,
    ):
        scene, q0, _ = load("quadruped", height=0.0, kp=kp, kd=kd)
        self.speed, self.noise, self._feet = float(speed), float(noise), "ground"
        super().__init__(scene, q0, actuated=np.arange(6, 18), effort=effort, **options)

    def start(self, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """On the ground, joints and velocities by chance."""
        q, v = self._q0.copy(), self._v0.copy()
        q[7:] += random.uniform(-self.noise, self.noise, 12)
        v[6:] = random.uniform(-self.noise, self.noise, 12)
        return self.scene.place_on("ground", q, 1e-3), v

    def observe(self, state: State) -> np.ndarray:
        """Height, the vertical in the frame of the base, joints, and velocities: shape (34,)."""
        return np.concatenate((state.q[2:3], _vertical(state), state.q[7:], state.v))

    def reward(self, before: State, after: State, action: np.ndarray) -> float:
        """See the class."""
        speed = (after.q[0] - before.q[0]) / max(after.t - before.t, 1e-12)
        wanted = float(np.exp(-((speed - self.speed) ** 2) / 0.1))
        return wanted * float(_vertical(after)[2]) - COST * float(np.mean(action**2))

    def ended(self, state: State) -> bool:
        """It has fallen."""
        return bool(state.q[2] < LOW * self._q0[2] or _vertical(state)[2] < TILT)


def _vertical(state: State) -> np.ndarray:
    """The vertical in the frame of the base, shape (3,)."""
    return pin.Quaternion(state.q[3:7]).matrix()[2]
