"""Wheel in a shell: a wheel rolls without slip inside a spherical shell, along a level circle, as on a wall of death.

The wheel is the disc of `rolling_disc`, where the closed form stands.
"""

from __future__ import annotations

import coal
import numpy as np

import ngalpha_pin as nga

from .rolling_disc import RADIUS, disc, steady


def load(
    *, theta: float = 0.2, rho: float = 0.8, shell_radius: float = 1.0
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the wheel in a shell around the origin, in steady motion; its constraint is "RollingDisc rim/shell".

    Args:
        theta: angle between the axis of the wheel and the vertical, in (0, pi / 2) [rad].
        rho: radius of the circle of the centre [m].
        shell_radius: of the inside of the shell, larger than rho + 0.1 cos theta [m].

    Returns:
        The scene, q0 of shape (7,) and v0 of shape (6,); see `_bodies.free_body` for the coordinates.
    """
    scene = disc("wheel_in_shell")
    scene.add_geometry("shell", nga.Hollow(coal.Sphere(shell_radius)), color=(0.55, 0.65, 0.75, 0.35))
    scene.add_constraint(nga.RollingDisc("rim", "shell"))
    distance = rho + RADIUS * np.cos(theta)  # of the rim point from the axis of the circle
    if not distance < shell_radius:
        raise nga.SceneError(f"shell_radius = {shell_radius} must be larger than rho + 0.1 cos theta = {distance:g}")
    height = RADIUS * np.sin(theta) - np.sqrt(shell_radius**2 - distance**2)
    return scene, *steady(theta, rho, height)
