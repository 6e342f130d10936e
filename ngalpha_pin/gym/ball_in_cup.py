"""A ball on a string that is to be swung into its cup, in a vertical plane."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.scene.contact import Hollow
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.state import State

from .scene_env import SceneEnv

STRING, BALL = 0.3, 0.025  # length of the string, radius of the ball [m]
WIDTH, DEPTH, WALL = 0.1, 0.08, 0.01  # of the cup inside, and thickness of its walls [m]
CUP, MASS = 0.3, 0.05  # [kg]
EFFORT = 5.0  # of the hand in either direction [N]
SPRING, DAMPING = 10.0, 1.0  # that bring the cup back to the middle [N / m, N s / m]
COST = 0.01  # of a full action


class BallInCup(SceneEnv):
    """A hand moves a cup along x and z; the ball hangs from its bottom on a string that can go slack.

    Observed are the position of the cup, that of the ball beside it, and both velocities, shape (8,). The reward is 1
    while the ball is in the cup, less what the action costs.

    Args:
        noise: angle of the string at the start [rad].
        **options: of `SceneEnv`: dt, hold, method, render_mode.
    """

    def __init__(self, noise: float = 0.3, **options: Any):
        self.noise = float(noise)
        q0 = np.array([0.0, 0.0, 0.0, -STRING])
        super().__init__(cup_scene(), q0, actuated=[0, 1], effort=EFFORT, **options)

    def start(self, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """The ball at rest, anywhere within the angle and the length of the string."""
        angle, length = random.uniform(-self.noise, self.noise), random.uniform(0.9, 0.999) * STRING
        return np.array([0.0, 0.0, length * np.sin(angle), -length * np.cos(angle)]), self._v0

    def observe(self, state: State) -> np.ndarray:
        """See the class."""
        return np.concatenate((state.q[:2], state.q[2:] - state.q[:2], state.v[:2], state.v[2:] - state.v[:2]))

    def forces(self, action: np.ndarray, state: State) -> np.ndarray:
        """Of the hand, which holds the weight of the cup and brings it back."""
        tau = super().forces(action, state)
        tau[1] += 9.81 * CUP
        tau[:2] -= SPRING * state.q[:2]
        return tau

    def reward(self, before: State, after: State, action: np.ndarray) -> float:
        """See the class."""
        return float(in_cup(after)) - COST * float(np.mean(action**2))


def in_cup(state: State) -> bool:
    """The middle of the ball is between the walls."""
    x, z = state.q[2:] - state.q[:2]
    return bool(abs(x) < WIDTH / 2 and WALL < z < WALL + DEPTH)


def cup_scene() -> Scene:
    """A cup that moves along x and z, and a ball that does; the string is a sphere around the bottom of the cup."""
    model = pin.Model()
    model.name = "ball_in_cup"
    for name, mass in (("cup", CUP), ("ball", MASS)):
        x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), f"{name}_x")
        z = model.addJoint(x, pin.JointModelPZ(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(z, pin.Inertia.FromSphere(mass, BALL), pin.SE3.Identity())
        model.addJointFrame(z)
    model.damping[:2] = DAMPING
    scene = Scene(model)
    scene.add_geometry("ball", coal.Sphere(BALL), parent="ball", color=(0.9, 0.3, 0.2, 1.0))
    scene.add_geometry("string", Hollow(coal.Sphere(STRING + BALL)), parent="cup", color=(0.6, 0.6, 0.6, 0.0))
    scene.add_contact("ball", "string")
    height, side = DEPTH + WALL, (WIDTH + WALL) / 2 + BALL
    walls = {
        "bottom": (np.array([0.0, 0.0, WALL / 2]), (2 * side - WALL, WALL)),
        "left": (np.array([-side, 0.0, height / 2]), (WALL, height)),
        "right": (np.array([side, 0.0, height / 2]), (WALL, height)),
    }
    for name, (at, (width, tall)) in walls.items():
        shape = coal.Box(width, WIDTH, tall)
        scene.add_geometry(name, shape, parent="cup", placement=pin.SE3(np.eye(3), at), color=(0.3, 0.5, 0.8, 0.6))
        scene.add_contact("ball", name, e_N=0.3)
    return scene
