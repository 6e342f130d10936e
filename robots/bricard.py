"""Bricard's mechanism: six revolute joints along the edges of a cube, overconstrained and yet it moves.

Problem A04 of the IFToMM library of multibody benchmarks: five rods of 1 m and 1 kg, and the ground as the sixth,
start at rest; gravity acts along -y. The joints are

    P0 (0, 0, 0) about y     P1 (1, 0, 0) about z      P2 (1, -1, 0) about x
    P3 (1, -1, 1) about y    P4 (0, -1, 1) about z     P5 (0, 0, 1) about x

and the one in P5 closes the loop with five rows for a mechanism with five coordinates: one of them is redundant.
By its threefold symmetry all odd joints turn by the same angle, and so do all even ones:
cos a + cos b + cos a cos b = 0, where a and b are the angles between successive rods.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

from ._mechanism import BLUE, ORANGE, STEEL, Tree, rod_inertia

AXES = (pin.JointModelRY, pin.JointModelRZ, pin.JointModelRX)
RODS = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0], [0, 1, 0]])
"""The rods from joint to joint at the start [m]."""


def load(*, mass: float = 1.0, gravity: float = 9.81) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the mechanism at rest; the joints of the tree are "P0" to "P4", the constraint is "P5".

    Args:
        mass: of a rod [kg].
        gravity: gravitational acceleration along -y [m/s^2].

    Returns:
        The scene, q0 = 0 of shape (5,) [rad] and v0 = 0 of shape (5,) [rad/s].
    """
    tree, parent, at, origin = Tree("bricard", (0.0, -gravity, 0.0)), "universe", np.zeros(3), np.zeros(3)
    for i, rod in enumerate(RODS):
        name = f"P{i}"
        tree.add(name, AXES[i % 3](), rod_inertia(mass, origin, rod), at, parent)
        tree.draw_rod(name, origin, rod, 0.03, (BLUE, STEEL)[i % 2])
        tree.draw_ball(name, origin, 0.05)
        parent, at = name, rod
    tree.frame("tip", "P4", RODS[4])
    tree.draw_ball("P4", RODS[4], 0.05, ORANGE)
    scene = tree.scene()
    pin_of_the_ground = pin.SE3(np.eye(3), RODS.sum(axis=0))
    scene.add_constraint(
        nga.RevoluteJoint("world", "tip", axis=(1.0, 0.0, 0.0), placement_a=pin_of_the_ground, name="P5")
    )
    return scene, np.zeros(5), np.zeros(5)
