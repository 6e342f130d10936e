"""A gripper with two fingers that lifts a box."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin
from gymnasium import spaces

from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.state import State

from .scene_env import SceneEnv

EDGE, OPEN, TIP = 0.05, 0.06, 0.01  # of the box, of the gripper, radius of a fingertip [m]
MASS, PALM, FINGER = 0.2, 0.5, 0.1  # [kg]
LIFT = 0.1  # height that is wanted [m]
DAMPING = 20.0, 5.0, 5.0  # of palm and fingers [N s / m]
COST = 0.01  # of a full action
SOFT = 0.01  # radius of the area on which a tip resists turning [m]


class Gripper(SceneEnv):
    """A box of 0.2 kg on the ground, between two soft fingertips: it is to be 0.1 m up.

    Actions push the palm along z and the two fingers together, shape (2,), -1 to open and let down. Observed are the
    positions of palm, fingers and box, and all velocities, shape (18,). The reward is the height of the box in parts of
    what is wanted, at most 1, less what the action costs; the episode ends where the box is thrown away.

    Args:
        mu: friction between tips and box [-].
        noise: of the place of the box at the start [m].
        **options: of `SceneEnv`: dt, hold, method, render_mode.
    """

    def __init__(self, mu: float = 0.8, noise: float = 0.003, **options: Any):
        self.noise = float(noise)
        scene = gripper_scene(mu)
        q0 = np.array([0.0, 0.0, 0.0, 0.0, 0.0, EDGE / 2, 0.0, 0.0, 0.0, 1.0])
        super().__init__(scene, q0, actuated=[0, 1, 2], effort=[10.0, 15.0, 15.0], **options)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)

    def start(self, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Open, the box somewhere between the fingers."""
        q = self._q0.copy()
        q[3:5] += random.uniform(-self.noise, self.noise, 2)
        return q, self._v0

    def observe(self, state: State) -> np.ndarray:
        """Positions of palm, fingers and box, its height in parts of the wanted one, velocities: shape (18,)."""
        return np.concatenate((state.q[:6], state.q[6:], [_height(state)], state.v[:1], state.v[3:]))

    def forces(self, action: np.ndarray, state: State) -> np.ndarray:
        """Lift and squeeze, beside the weight of the gripper."""
        lift, squeeze = action * self.effort[:2]
        tau = np.zeros(self.scene.model.nv)
        tau[:3] = 9.81 * (PALM + 2 * FINGER) + lift, squeeze, -squeeze
        return tau

    def reward(self, before: State, after: State, action: np.ndarray) -> float:
        """See the class."""
        return min(_height(after), 1.0) - COST * float(np.mean(action**2))

    def ended(self, state: State) -> bool:
        """The box is out of reach."""
        return bool(np.abs(state.q[3:5]).max() > 2 * EDGE)


def _height(state: State) -> float:
    """Of the box above the ground, in parts of what is wanted."""
    return float(state.q[5] - EDGE / 2) / LIFT


def gripper_scene(mu: float) -> Scene:
    """The gripper around a box on the ground: palm along z, fingers along x, the box free.

    Args:
        mu: friction between tips and box [-].
    """
    model = pin.Model()
    model.name = "gripper"
    palm = model.addJoint(
        0, pin.JointModelPZ(), pin.SE3(np.eye(3), np.array([0.0, 0.0, EDGE / 2])), "palm", *_within(0.0, 0.3)
    )
    model.appendBodyToJoint(palm, pin.Inertia.FromSphere(PALM, 0.05), pin.SE3.Identity())
    for name, side in (("left", -1.0), ("right", 1.0)):
        place = pin.SE3(np.eye(3), np.array([side * OPEN, 0.0, 0.0]))
        limits = sorted((0.0, -side * (OPEN + EDGE / 2)))
        finger = model.addJoint(palm, pin.JointModelPX(), place, name, *_within(*limits))
        model.appendBodyToJoint(finger, pin.Inertia.FromSphere(FINGER, 0.02), pin.SE3.Identity())
    box = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "box")
    model.appendBodyToJoint(box, pin.Inertia.FromBox(MASS, EDGE, EDGE, EDGE), pin.SE3.Identity())
    model.damping[:3] = DAMPING
    for joint in range(1, model.njoints):
        model.addJointFrame(joint)
    scene = Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("box", coal.Box(EDGE, EDGE, EDGE), parent="box", color=(0.9, 0.6, 0.2, 1.0))
    scene.add_contact("box", "ground", mu=0.5)
    for name in ("left", "right"):
        scene.add_geometry(name, coal.Sphere(TIP), parent=name)
        scene.add_contact(name, "box", mu=mu, contact_radius=SOFT)
    return scene


def _within(low: float, high: float) -> tuple[np.ndarray, ...]:
    """Limits of a joint: effort, velocity, and position."""
    return np.array([np.inf]), np.array([np.inf]), np.array([low]), np.array([high])
