"""A flyball governor whose lower arms are very stiff springs with strong dampers.

Problem A05 of the IFToMM library of multibody benchmarks. A shaft of 1 m turns about z, a slider moves along it, two
arms of 1 m with balls at their ends hang from its head, 30 degrees below the horizontal; a spring of 0.5 m ties the
middle of each arm to the slider at half height. One eigenvalue of the slider is near -27,000 1/s, that of the shaft
is zero.
"""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

from ._mechanism import BLUE, STEEL, Tree, by_joint

DENSITY = 3000.0
"""Of all bodies [kg/m^3]."""
HEAD, ARM, THICKNESS, SLIDER, BALL = 0.05, 1.0, 0.01, 0.1, 5.0
"""Distance of the joints of the arms from the axis [m], length and thickness of the arms [m], edge of the slider [m],
mass of a ball [kg]."""


def load(
    *,
    speed: float = 2 * np.pi,
    stiffness: float = 8e5,
    damping: float = 4e4,
    angle: float = np.radians(30.0),
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the governor, turning as one body; its joints are "shaft", "slider", "left" and "right".

    Args:
        speed: initial angular velocity of the shaft [rad/s].
        stiffness: of a spring [N/m].
        damping: of a spring [N s/m].
        angle: of the arms below the horizontal [rad]; the springs are without force at 30 degrees.

    Returns:
        The scene, q0 of shape (4,) [rad, m] and v0 of shape (4,) [rad/s, m/s].
    """
    tree, volume = Tree("governor"), ARM * THICKNESS**2
    shaft = pin.Inertia.FromBox(DENSITY * volume, THICKNESS, THICKNESS, ARM)
    centre = pin.SE3(np.eye(3), np.array([0.0, 0.0, ARM / 2]))
    tree.add("shaft", pin.JointModelRZ(), centre.act(shaft), (0, 0, 0))
    tree.draw_rod("shaft", (0, 0, 0), (0, 0, ARM), THICKNESS)
    tree.draw_rod("shaft", (-HEAD, 0, ARM), (HEAD, 0, ARM), 2 * THICKNESS)
    slider = pin.Inertia.FromBox(DENSITY * SLIDER**3, SLIDER, SLIDER, SLIDER)
    tree.add("slider", pin.JointModelPZ(), slider, (0, 0, 0), "shaft")
    tree.draw("slider", coal.Box(SLIDER, SLIDER, SLIDER), pin.SE3.Identity(), STEEL)
    for name, side in (("left", -1.0), ("right", 1.0)):
        middle, end = np.array([side * ARM / 2, 0, 0]), np.array([side * ARM, 0, 0])
        rod = pin.Inertia.FromBox(DENSITY * volume, ARM, THICKNESS, THICKNESS)
        arm = pin.SE3(np.eye(3), middle).act(rod) + pin.Inertia(BALL, end, np.zeros((3, 3)))
        # a positive angle lowers both of them
        joint = pin.JointModelRevoluteUnaligned(0.0, side, 0.0)
        tree.add(name, joint, arm, (side * HEAD, 0, ARM), "shaft")
        tree.frame(f"{name} middle", name, middle)
        tree.frame(f"{name} eye", "slider", (side * SLIDER / 2, 0, 0))
        tree.draw_rod(name, (0, 0, 0), end, THICKNESS, BLUE)
        tree.draw_ball(name, end, 0.08)
    scene = tree.scene()
    for name in ("left", "right"):
        scene.add_force(nga.Spring(f"{name} eye", f"{name} middle", stiffness, 0.5, damping))
    q0 = by_joint(scene.model, {"slider": ARM / 2, "left": angle, "right": angle})
    return scene, q0, by_joint(scene.model, {"shaft": speed})
