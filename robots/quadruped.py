"""A quadruped of 12 kg with twelve joints and spherical feet, made of primitive shapes: it drops, lands and stands.

A free flyer and per leg hip roll, hip pitch and knee; the legs are FL, FR, HL, HR (front, hind; left, right).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

from . import _legged

URDF = Path(__file__).parent / "urdf" / "quadruped.urdf"


def load(
    *, height: float = 0.1, mu: float = 0.8, kp: float = 100.0, kd: float = 3.0
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the robot above the plane z = 0, at rest; the contacts are "FL_foot_0" and so on with "ground".

    Args:
        height: of the feet above the plane [m].
        mu: friction coefficient [-].
        kp: stiffness of the joints [N m / rad].
        kd: damping of the joints [N m s / rad].

    Returns:
        The scene, q0 of shape (19,) and v0 of shape (18,).
    """
    scene = nga.Scene.from_urdf(URDF, root_joint=pin.JointModelFreeFlyer())
    posture = pin.neutral(scene.model)
    posture[7:] = np.tile([0.0, 0.75, -1.5], 4)
    return _legged.drop(scene, posture, "*_foot_0", height, mu, kp, kd)
