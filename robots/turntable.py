"""Turntable: a ball rolls without slip on a table that turns steadily, and runs circles in the frame of the world.

With the moment of inertia j m r^2 the centre turns with j / (1 + j) of the rate of the table, 2/7 for a homogeneous
ball, along a circle of radius speed (1 + j) / (j rate), wherever it starts.
"""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

from ._bodies import free_body, mark

RADIUS = 0.1
"""Radius of the ball [m]."""


def load(
    *, rate: float = 3.0, speed: float = 0.1, x: float = 0.15, j: float = 0.4
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the ball on the table, which turns about the z-axis; its constraint is "RollingSphere ball/table".

    Args:
        rate: angular velocity of the table [rad/s].
        speed: initial speed of the centre, along y [m/s].
        x: initial distance of the centre from the axis of the table [m].
        j: moment of inertia in units of m r^2: 2/5 homogeneous, 2/3 hollow [-].

    Returns:
        The scene, q0 of shape (8,) and v0 of shape (7,): ball (see `_bodies.free_body`), then the angle of the table.
    """
    model = pin.Model()
    model.name = "turntable"
    ball = free_body(model, "rolling_ball", pin.Inertia(1.0, np.zeros(3), j * RADIUS**2 * np.eye(3)))
    pivot = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "pivot")
    model.appendBodyToJoint(pivot, pin.Inertia.FromCylinder(5.0, 1.0, 0.02), pin.SE3.Identity())
    model.addJointFrame(pivot)
    visual = mark(ball, coal.Sphere(0.2 * RADIUS), np.array([0.9 * RADIUS, 0.0, 0.0]))
    line = pin.GeometryObject("line", pivot, pin.SE3.Identity(), coal.Box(1.0, 0.02, 0.002))
    line.meshColor = np.array([0.2, 0.2, 0.2, 1.0])
    visual.addGeometryObject(line)
    scene = nga.Scene(model, visual_model=visual)
    scene.add_geometry("table", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), parent="pivot")
    scene.add_geometry("ball", coal.Sphere(RADIUS), parent="rolling_ball")
    scene.add_constraint(nga.RollingSphere("ball", "table"))
    scene.add_constraint(nga.JointTrajectory("pivot", lambda t: (rate * t, rate, 0.0), name="turning table"))
    q0 = pin.neutral(model)
    q0[:3] = x, 0.0, RADIUS
    # the lowest point of the ball goes with the table: speed + omega_x r = rate x
    return scene, q0, np.array([0.0, speed, 0.0, (rate * x - speed) / RADIUS, 0.0, 0.0, rate])


def circle(rate: float, speed: float, j: float = 0.4) -> tuple[float, float]:
    """Radius [m] and angular velocity [rad/s] of the circle of the centre; arguments as in `load`."""
    turning = j / (1.0 + j) * rate
    return speed / turning, turning
