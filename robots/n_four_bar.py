"""A chain of four-bars that falls through flat positions, in which it could change its shape.

Problem A02 of the IFToMM library of multibody benchmarks: N windows of 2 N + 1 rods of 1 m and 1 kg; all of them start
upright, and B0, the end of the first one, with 1 m/s along x. When the rods lie flat, the constraints lose N of their
2 N independent directions. The windows stay parallelograms: with the angle phi of the upright rods from the vertical,

    (4 N + 1) / 3 phi_dot^2 + (3 N + 1) g cos phi = constant

The plane of motion is x-z with gravity along -z.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

from ._mechanism import BLUE, STEEL, Tree, by_joint, rod_inertia


def load(*, windows: int = 2, speed: float = 1.0, mass: float = 1.0) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the upright chain; the joints are "up0" ... and "across1" ..., the constraints "B1" ...

    Args:
        windows: N; the library has 40.
        speed: of B0 along x [m/s].
        mass: of a rod [kg].

    Returns:
        The scene, q0 = 0 of shape (2 N + 1,) [rad] and v0 of shape (2 N + 1,) [rad/s].
    """
    tree, origin, up, across = Tree("n_four_bar"), np.zeros(3), np.array([0.0, 0, 1]), np.array([1.0, 0, 0])
    velocities = {}
    for i in range(windows + 1):
        name = f"up{i}"
        tree.add(name, pin.JointModelRY(), rod_inertia(mass, origin, up), i * across)
        tree.draw_rod(name, origin, up, 0.02, BLUE)
        tree.frame(f"B{i}", name, up)
        velocities[name] = speed
        if i < windows:
            name = f"across{i + 1}"
            tree.add(name, pin.JointModelRY(), rod_inertia(mass, origin, across), up, f"up{i}")
            tree.draw_rod(name, origin, across, 0.02, STEEL)
            tree.frame(f"end of {name}", name, across)
            velocities[name] = -speed
    scene = tree.scene()
    for i in range(1, windows + 1):
        scene.add_constraint(nga.RevoluteJoint(f"B{i}", f"end of across{i}", axis=(0.0, 1.0, 0.0), name=f"B{i}"))
    return scene, np.zeros(scene.model.nq), by_joint(scene.model, velocities)
