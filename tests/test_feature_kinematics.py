"""Gaps, slip velocities and their accelerations of rolling features, against finite differences and closed forms."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import ARRANGEMENTS, POSE_A, POSE_B, all_rows, free_flyers, random_state
from test_contact_kinematics import (
    test_accelerations_are_the_derivatives_of_the_rates as _accelerations,
)
from test_contact_kinematics import (
    test_derivative_of_the_accelerations_by_the_velocity as _derivative_by_v,
)
from test_contact_kinematics import (
    test_derivative_of_the_rates_by_the_configuration as _derivative_by_q,
)
from test_contact_kinematics import (
    test_gap_rate_is_the_derivative_of_the_gap as _gap_rate,
)

import ngalpha_pin as nga
from ngalpha_pin.features import Feature, face, line, pack, rim
from ngalpha_pin.system import System

U, W = np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.28, 0.96])
C, D = np.array([0.1, -0.2, 0.3]), np.array([-0.2, 0.1, 0.15])
FEATURES = {
    "corner": (Feature(C), Feature(D)),
    "ball": (Feature(C, r=0.3), Feature(D, r=0.2)),
    "edge": (line(C, U), line(D, W)),
    "side": (line(C, U, 0.25), line(D, W, 0.15)),
    "rim": (rim(C, U, 0.4), rim(D, W, 0.3, 0.05)),
    "ellipsoid": (Feature(C, Q=np.diag([0.04, 0.09, 0.16])), Feature(D, Q=np.diag([0.09, 0.05, 0.02]), r=0.1)),
    "face": (face(C, U, 0.02), face(D, W)),
}
PAIRS = [(a, b) for a in FEATURES for b in FEATURES if not (a == "face" and b in ("edge", "side", "face"))]
PAIRS = [(a, b) for a, b in PAIRS if not (b == "face" and a in ("edge", "side"))]


def feature_system(pair, arrangement):
    """A scene whose one pair of solids has the given features in its first place, and its state."""
    if arrangement == "humanoid":
        model = pin.buildSampleModelHumanoid()
        parents = "rleg_shoulder3_joint", "larm_wrist2_joint"
    else:
        model = free_flyers(1 if arrangement == "fixed" else 2)
        parents = (None if arrangement == "fixed" else "body_1"), "body_0"
    scene = nga.Scene(model)
    scene.add_geometry("a", coal.Box(1, 1, 1), parent=parents[0], placement=POSE_A)
    scene.add_geometry("b", coal.Box(1, 1, 1), parent=parents[1], placement=POSE_B)
    scene.add_contact("b", "a", mu=0.4, contact_radius=0.2)
    system = System(scene)
    return system
