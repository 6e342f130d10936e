"""A wall of boxes, every other layer shifted, that stands; a ball may be thrown at it."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

SIZE = np.array([0.2, 0.1, 0.1])  # of a box, along the wall, through it, and its height [m]
GAP = 0.01  # between neighbours in a layer [m]
RADIUS = 0.08  # of the ball [m]


def load(
    *, rows: int = 5, columns: int = 5, mass: float = 1.0, mu: float = 0.6, speed: float = 0.0
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the wall on the floor z = 0, at rest.

    Args:
        rows: layers of boxes.
        columns: boxes in each of them.
        mass: of a box, and of the ball [kg].
        mu: friction coefficient of all contacts [-].
        speed: of the ball towards the middle of the wall [m/s]; without a speed there is no ball.

    Returns:
        The scene, q0 of shape (7 n,) and v0 of shape (6 n,) for n bodies.
    """
    model = pin.Model()
    model.name = "wall"
    scene_bodies = [f"box_{i}_{j}" for i in range(rows) for j in range(columns)] + ["ball"] * (speed > 0.0)
    for name in scene_bodies:
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
        inertia = pin.Inertia.FromSphere(mass, RADIUS) if name == "ball" else pin.Inertia.FromBox(mass, *SIZE)
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        model.addJointFrame(joint)
    scene = nga.Scene(model)
    for name in scene_bodies:
        scene.add_geometry(name, coal.Sphere(RADIUS) if name == "ball" else coal.Box(*SIZE), parent=name)
    scene.add_plane("floor")
    scene.add_contact("*", "*", mu=mu)
    q0, v0 = pin.neutral(model), np.zeros(model.nv)
    pitch = SIZE[0] + GAP
    for i in range(rows):
        for j in range(columns):
            shift = (j + 0.3 * (i % 2)) * pitch
            q0[7 * (i * columns + j) :][:3] = shift, 0.0, (i + 0.5) * SIZE[2]
    if speed > 0.0:
        q0[-7:-4] = 0.5 * columns * pitch, -0.5, 0.5 * rows * SIZE[2]
        v0[-5] = speed
    return scene, q0, v0
