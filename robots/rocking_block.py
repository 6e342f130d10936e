"""Rocking block: a slender block that stands on one of its lower corners falls over to the other one, and back.

Housner's block: the corners do not slip, and an impact on one corner keeps the angular momentum about it, which here
follows from e_N = 0 and the other corner's letting go. The plane is x-z, q = (x, z, angle).
"""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

HALF_WIDTH, HALF_HEIGHT = 0.1, 0.4
"""Of the block [m]."""


def load(*, tilt: float = 0.15, mu: float = 0.8) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the block of 2 kg at rest on one corner; its contacts are "right" and "left" with "ground".

    Args:
        tilt: angle at the start, positive on the right corner [rad].
        mu: friction coefficient [-].

    Returns:
        The scene, q0 of shape (3,) [m, rad] and v0 of shape (3,).
    """
    model = pin.Model()
    model.name = "rocking_block"
    joint = 0
    for kind, name in ((pin.JointModelPX(), "x"), (pin.JointModelPZ(), "z"), (pin.JointModelRY(), "tilt")):
        joint = model.addJoint(joint, kind, pin.SE3.Identity(), name)
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(2.0, 2 * HALF_WIDTH, 0.1, 2 * HALF_HEIGHT), pin.SE3.Identity())
    model.addJointFrame(joint)
    visual = pin.GeometryModel()
    shape = coal.Box(2 * HALF_WIDTH, 0.1, 2 * HALF_HEIGHT)
    visual.addGeometryObject(pin.GeometryObject("block", joint, pin.SE3.Identity(), shape))
    scene = nga.Scene(model, visual_model=visual)
    scene.add_plane("ground")
    for side, name in ((1, "right"), (-1, "left")):
        corner = pin.SE3(np.eye(3), np.array([side * HALF_WIDTH, 0.0, -HALF_HEIGHT]))
        scene.add_geometry(name, coal.Sphere(0.0), parent="tilt", placement=corner)
    scene.add_contact("*t", "ground", mu=mu)
    return scene, pose(np.array([tilt]))[0], np.zeros(3)


def pose(tilt: np.ndarray) -> np.ndarray:
    """(x, z, angle), shape (n, 3), of the block whose lower corner stays where it is at tilt 0.

    Args:
        tilt: angles [rad], shape (n,).
    """
    side = np.where(tilt >= 0.0, 1.0, -1.0)
    c, s = np.cos(tilt), np.sin(tilt)
    x = side * HALF_WIDTH - (side * HALF_WIDTH * c - HALF_HEIGHT * s)
    return np.column_stack([x, side * HALF_WIDTH * s + HALF_HEIGHT * c, tilt])
