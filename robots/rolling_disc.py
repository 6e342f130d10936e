"""Rolling disc: a thin disc, as a coin, rolls on a plane without slip, in steady precession along a circle.

With the radius r, mass m and moments of inertia A across and C along the axis of the disc, which stands at the angle
theta to the vertical, the centre runs along a circle of radius rho with

    Omega^2 = m g r cos theta / (sin theta ((m r + C / r) rho + A cos theta))

The surface enters only in that its rim point has to touch it, so the same holds inside a shell, see `wheel_in_shell`.
"""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

from ._bodies import free_model, mark

RADIUS = 0.1
"""r [m]."""
GRAVITY = 9.81
"""g [m/s^2]."""


def load(*, theta: float = 1.0, rho: float = 0.5) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the disc on the plane z = 0 in steady precession; its constraint is "RollingDisc rim/ground".

    Args:
        theta: angle between the axis of the disc and the vertical, in (0, pi / 2) [rad].
        rho: radius of the circle of the centre [m].

    Returns:
        The scene, q0 of shape (7,) and v0 of shape (6,); see `_bodies.free_body` for the coordinates.
    """
    scene = disc("rolling_disc")
    scene.add_plane("ground")
    scene.add_constraint(nga.RollingDisc("rim", "ground"))
    return scene, *steady(theta, rho, RADIUS * np.sin(theta))


def disc(name: str) -> nga.Scene:
    """A scene with the disc of 1 kg, "rim", and nothing to roll on."""
    r2 = RADIUS**2
    model, joint = free_model(name, pin.Inertia(1.0, np.zeros(3), np.diag([r2 / 4, r2 / 4, r2 / 2])))
    spoke = mark(joint, coal.Box(1.8 * RADIUS, 0.1 * RADIUS, 0.15 * RADIUS), np.zeros(3))
    scene = nga.Scene(model, visual_model=spoke)
    scene.add_geometry("rim", coal.Cylinder(RADIUS, 0.1 * RADIUS), parent=name)
    return scene


def angular_rate(theta: float, rho: float) -> float:
    """Omega of the steady precession [rad/s]; arguments as in `load`."""
    s, c = np.sin(theta), np.cos(theta)
    # divided by the mass: C / (m r) = r / 2, A / m = r^2 / 4
    return float(np.sqrt(GRAVITY * RADIUS * c / (s * (1.5 * RADIUS * rho + RADIUS**2 / 4 * c))))


def steady(theta: float, rho: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Configuration (7,) and velocity (6,) of the steady precession about the z-axis, the centre at x = rho."""
    rate, tilt = angular_rate(theta, rho), pin.utils.rotate("y", theta)
    spin = -rate * (rho / RADIUS + np.cos(theta))
    omega = np.array([0.0, 0.0, rate]) + spin * tilt[:, 2]
    q = np.concatenate(([rho, 0.0, height], pin.Quaternion(tilt).coeffs()))
    return q, np.concatenate(([0.0, rate * rho, 0.0], tilt.T @ omega))
