"""Newton's cradle: pendulums side by side, the first one raised and let go."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

RADIUS, LENGTH = 0.1, 1.0
"""Of the balls and of the pendulums [m]."""


def load(
    *, n: int = 5, gap: float = 2e-3, e_N: float = 0.9, raised: float = 0.5
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the balls of 1 kg on massless rods; neighbours touch as "ball_0" and "ball_1" and so on.

    Args:
        n: number of balls.
        gap: between neighbours that hang straight [m].
        e_N: restitution [-].
        raised: angle of the first one at the start [rad].

    Returns:
        The scene, q0 of shape (n,) [rad] and v0 = 0 of shape (n,).
    """
    model = pin.Model()
    model.name = "cradle"
    for i in range(n):
        place = pin.SE3(np.eye(3), np.array([i * (2 * RADIUS + gap), 0.0, LENGTH]))
        joint = model.addJoint(0, pin.JointModelRY(), place, f"pivot_{i}")
        bob = pin.Inertia(1.0, np.array([0.0, 0.0, -LENGTH]), np.zeros((3, 3)))
        model.appendBodyToJoint(joint, bob, pin.SE3.Identity())
        model.addJointFrame(joint)
    scene = nga.Scene(model)
    hang = pin.SE3(np.eye(3), np.array([0.0, 0.0, -LENGTH]))
    for i in range(n):
        scene.add_geometry(f"ball_{i}", coal.Sphere(RADIUS), parent=f"pivot_{i}", placement=hang)
    for i in range(n - 1):
        scene.add_contact(f"ball_{i}", f"ball_{i + 1}", e_N=e_N)
    q0 = np.zeros(n)
    q0[0] = raised
    return scene, q0, np.zeros(n)
