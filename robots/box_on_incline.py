"""A box that lies flat on an incline: it sticks, slides, or is sent uphill and stops."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

HALF = 0.1
"""Half of the edge of the box [m]."""


def load(
    *, angle: float = np.radians(20.0), mu: float = 0.5, speed: float = -1.0
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the box of 1 kg, a free flyer whose first coordinate runs down the incline.

    Args:
        angle: of the incline, which falls towards +x [rad].
        mu: friction coefficient [-].
        speed: at the start, down the incline [m/s].

    Returns:
        The scene, q0 of shape (7,) and v0 of shape (6,).
    """
    model = pin.Model()
    model.name = "box_on_incline"
    tilt = pin.SE3(pin.exp3(np.array([0.0, angle, 0.0])), np.zeros(3))
    model.addJoint(0, pin.JointModelFreeFlyer(), tilt, "box")
    model.appendBodyToJoint(1, pin.Inertia.FromBox(1.0, 2 * HALF, 2 * HALF, 2 * HALF), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("incline", normal=tilt.rotation[:, 2])
    scene.add_geometry("box", coal.Box(2 * HALF, 2 * HALF, 2 * HALF), parent="box")
    scene.add_contact("box", "incline", mu=mu)
    v0 = np.zeros(6)
    v0[0] = speed
    return scene, np.array([0.0, 0.0, HALF, 0.0, 0.0, 0.0, 1.0]), v0
