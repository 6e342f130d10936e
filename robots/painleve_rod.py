"""Painleve rod, section 10.4: a rod slides on its tip until the contact force blows up and throws it off the ground.

The plane of motion is x-z with gravity along -z. The paper's coordinates of the centre of mass map as

    x, y, phi  ->  q = (x, z, cos phi, sin phi)        u_x, u_y, u_phi  ->  v = (v_x, v_z, phi_dot)

phi turns clockwise, about +y: the tip is at (x + l cos phi, z - l sin phi), and (152) is g_N = z - l sin phi,
gamma_F = v_x - l phi_dot sin phi.
"""

from __future__ import annotations

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

URDF = Path(__file__).parent / "urdf" / "painleve_rod.urdf"
HALF_LENGTH = 1.0
"""l, half of the length of the rod [m]."""


def load(
    *, phi: float = np.radians(31.0), speed: float = 30.0, mu: float = 5 / 3, e_N: float = 0.0, gravity: float = 10.0
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the rod, sliding with its tip on the plane z = 0; its contact is "tip" with "ground".

    Args:
        phi: initial inclination [rad].
        speed: initial speed along x [m/s].
        mu: friction coefficient [-].
        e_N: restitution in normal direction [-].
        gravity: gravitational acceleration [m/s^2].

    Returns:
        The scene, q0 of shape (4,) [m, -] and v0 of shape (3,) [m/s, rad/s].
    """
    scene = nga.Scene.from_urdf(URDF)
    scene.model.gravity.linear = np.array([0.0, 0.0, -gravity])
    scene.add_plane("ground")
    # a point, which URDF has no word for
    at_tip = pin.SE3(np.eye(3), np.array([HALF_LENGTH, 0.0, 0.0]))
    scene.add_geometry("tip", coal.Sphere(0.0), parent="rod", placement=at_tip)
    scene.add_contact("tip", "ground", mu=mu, e_N=e_N)
    q0 = np.array([0.0, HALF_LENGTH * np.sin(phi), np.cos(phi), np.sin(phi)])
    return scene, q0, np.array([speed, 0.0, 0.0])
