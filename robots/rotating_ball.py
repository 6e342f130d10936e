"""Rotating bouncing ball, section 10.1: a spinning ball falls on a plane, bounces, slips, rolls.

The plane of motion is x-z with gravity along -z. The paper's coordinates map as

    x, y, phi  ->  q = (x, z, cos phi, sin phi)        u_x, u_y, u_phi  ->  v = (v_x, v_z, phi_dot)

phi turns about -y, from x to z, as in the paper from x to y: gamma_F = u_x + R u_phi (148), so a positive
omega pushes the ball to -x.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import ngalpha_pin as nga

URDF = Path(__file__).parent / "urdf" / "ball.urdf"
RADIUS = 0.1
"""Radius of the ball [m]."""


def load(
    *, omega: float = 50.0, e_N: float = 0.0, mu: float = 0.2, e_F: float = 0.0, height: float = 1.0
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the ball above the plane z = 0; its contact is "ball_0" with "ground".

    Args:
        omega: initial angular velocity u_phi [rad/s]; the paper takes 50, 10, and 0 with e_N = 0.5.
        e_N: restitution in normal direction [-].
        mu: friction coefficient [-].
        e_F: restitution in tangential direction [-].
        height: initial height of the centre [m].

    Returns:
        The scene, q0 of shape (4,) [m, -] and v0 of shape (3,) [m/s, rad/s].
    """
    scene = nga.Scene.from_urdf(URDF)
    scene.model.name = "rotating_ball"
    scene.add_plane("ground")
    scene.add_contact("ball_0", "ground", mu=mu, e_N=e_N, e_F=e_F)
    return scene, np.array([0.0, height, 1.0, 0.0]), np.array([0.0, 0.0, omega])
