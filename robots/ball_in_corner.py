"""Ball in corner, section 10.2: the ball of 10.1 comes to rest between two inclined planes, touching both.

Coordinates as in `rotating_ball`. The planes meet in the origin; the paper's contact 1 is "right", which rises
towards +x, its contact 2 is "left":

    g_N = (-x sin alpha + z cos alpha - R,  x sin beta + z cos beta - R)        (149)
"""

from __future__ import annotations

import numpy as np

import ngalpha_pin as nga

from .rotating_ball import URDF


def load(
    *,
    alpha: float = np.pi / 4,
    beta: float = np.pi / 4,
    e_N_right: float = 0.5,
    e_N_left: float = 0.0,
    mu: float = 0.3,
    x: float = -0.5,
    height: float = 1.0,
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the ball at rest above the corner; its contacts are "ball_0" with "right" and with "left".

    Args:
        alpha: inclination of the right plane [rad].
        beta: inclination of the left plane [rad].
        e_N_right: restitution at the right plane [-].
        e_N_left: restitution at the left plane [-].
        mu: friction coefficient of both [-].
        x: initial position of the centre [m].
        height: initial height of the centre [m].

    Returns:
        The scene, q0 of shape (4,) [m, -] and v0 of shape (3,) [m/s, rad/s].
    """
    scene = nga.Scene.from_urdf(URDF)
    scene.model.name = "ball_in_corner"
    scene.add_plane("right", normal=(-np.sin(alpha), 0.0, np.cos(alpha)))
    scene.add_plane("left", normal=(np.sin(beta), 0.0, np.cos(beta)))
    scene.add_contact("ball_0", "right", mu=mu, e_N=e_N_right)
    scene.add_contact("ball_0", "left", mu=mu, e_N=e_N_left)
    return scene, np.array([x, height, 1.0, 0.0]), np.zeros(3)
