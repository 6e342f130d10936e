"""Belt: a block on a moving belt, held by a spring, sticks and slips for ever, because friction falls with slip.

The friction force on the block is at most mu m g where it sticks, and mu m g - falling (belt speed - v) where it slips:
Coulomb friction with a force linear in the slip velocity. While it slips the block is a linear oscillator with negative
damping; a period ends where it has caught up with the belt and the belt has carried it to mu m g = stiffness x.
"""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

GRAVITY = 9.81
"""g [m/s^2]."""
SIZE = 0.1
"""Edge of the block [m]."""


def load(
    *, speed: float = 0.3, mass: float = 1.0, stiffness: float = 100.0, mu: float = 0.4, falling: float = 2.0
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the block at x = 0, carried along by the belt; its contact is "block" with "surface".

    Args:
        speed: of the belt [m/s].
        mass: of the block [kg].
        stiffness: of the spring, which is relaxed at x = 0 [N/m].
        mu: friction coefficient of sticking [-].
        falling: decrease of friction with the slip velocity [N s/m].

    Returns:
        The scene, q0 of shape (3,) [m] and v0 of shape (3,) [m/s]: belt, block along x, block along z.
    """
    model = pin.Model()
    model.name = "belt"
    belt = _add(model, 0, pin.JointModelPX(), "belt", pin.Inertia.FromBox(1.0, 1.0, 0.3, 0.02))
    along = _add(model, 0, pin.JointModelPX(), "along", pin.Inertia.Zero())
    _add(model, along, pin.JointModelPZ(), "block", pin.Inertia.FromBox(mass, SIZE, SIZE, SIZE))
    visual = pin.GeometryModel()
    for i, x in enumerate(np.linspace(-1.0, 0.8, 10)):
        stripe = pin.GeometryObject(f"stripe_{i}", belt, pin.SE3(np.eye(3), np.array([x, 0.0, 0.0])), _STRIPE)
        stripe.meshColor = np.array([0.2, 0.2, 0.2, 1.0])
        visual.addGeometryObject(stripe)
    scene = nga.Scene(model, visual_model=visual)
    scene.add_geometry("surface", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), parent="belt")
    scene.add_geometry("block_0", coal.Box(SIZE, SIZE, SIZE), parent="block", color=(0.9, 0.3, 0.1, 1.0))
    scene.add_contact("block_0", "surface", mu=mu)
    scene.add_constraint(nga.JointTrajectory("belt", lambda t: (speed * t, speed, 0.0)))
    scene.add_force(nga.JointSpring("along", stiffness))
    scene.add_force(nga.Control(lambda t, q, v: np.array([0.0, falling * (v[1] - v[0]), 0.0]), derivatives=True))
    return scene, np.array([0.0, 0.0, SIZE / 2]), np.array([speed, speed, 0.0])


_STRIPE = coal.Box(0.05, 0.3, 0.002)


def _add(model: pin.Model, parent: int, joint: pin.JointModel, name: str, inertia: pin.Inertia) -> int:
    added = model.addJoint(parent, joint, pin.SE3.Identity(), name)
    model.appendBodyToJoint(added, inertia, pin.SE3.Identity())
    model.addJointFrame(added)
    return int(added)
