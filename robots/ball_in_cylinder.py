"""Ball in cylinder, section 10.3: the ball of 10.1 slips and rolls inside a tube, and must not sink into its wall.

Coordinates as in `rotating_ball`. The axis of the tube is parallel to y and passes through P = (0, 0, 1);
the gap is (150).
"""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

from .rotating_ball import RADIUS, URDF

CENTRE = np.array([0.0, 0.0, 1.0])
"""P, a point of the axis of the tube [m]."""


def load(*, tube_radius: float = 1.0, mu: float = 0.1, e_N: float = 0.0) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the ball at rest at the height of the axis, touching the wall at -x; its contact is "ball_0" with "tube".

    Args:
        tube_radius: inner radius of the tube [m].
        mu: friction coefficient [-].
        e_N: restitution in normal direction [-].

    Returns:
        The scene, q0 of shape (4,) [m, -] and v0 of shape (3,) [m/s, rad/s].
    """
    scene = nga.Scene.from_urdf(URDF)
    scene.model.name = "ball_in_cylinder"
    # a coal cylinder stands along its own z
    pose = pin.SE3(pin.utils.rotate("x", np.pi / 2), CENTRE)
    tube = nga.Hollow(coal.Cylinder(tube_radius, 6 * RADIUS))
    scene.add_geometry("tube", tube, placement=pose, color=(0.55, 0.65, 0.75, 0.35))
    scene.add_contact("ball_0", "tube", mu=mu, e_N=e_N)
    return scene, np.array([RADIUS - tube_radius, CENTRE[2], 1.0, 0.0]), np.zeros(3)
