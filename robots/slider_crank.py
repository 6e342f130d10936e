"""A slider-crank under gravity that turns freely or is driven at a given angle: a URDF tree, closed by one constraint.

The plane is x-z; the joints are "crank" and "rod", with (cos, sin) of their angles as coordinates, and "slide".
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import ngalpha_pin as nga

URDF = Path(__file__).parent / "urdf" / "slider_crank.urdf"


def load(
    *, angle: float = 0.5, speed: float = 30.0, drive: Callable[[float], Any] | None = None
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the mechanism; its constraint is "pin", and "drive" where it is driven.

    Args:
        angle: of the crank at the start [rad].
        speed: of the crank at the start [rad/s].
        drive: drive(t) -> angle of the crank [rad], see `JointTrajectory`; angle and speed are then those at t = 0.

    Returns:
        The scene, q0 of shape (5,) [-, m] and v0 of shape (3,) [rad/s, m/s].
    """
    scene = nga.Scene.from_urdf(URDF)
    scene.add_constraint(nga.RevoluteJoint("rod_tip", "slider", axis=(0.0, 1.0, 0.0), name="pin"))
    if drive is not None:
        scene.add_constraint(nga.JointTrajectory("crank", drive, name="drive"))
        angle, speed = float(np.ravel(drive(0.0))[0]), 0.0
    rough = np.array([np.cos(angle), np.sin(angle), np.cos(angle), -np.sin(angle), 0.3])
    closed = nga.assemble(scene, rough, np.array([speed, -speed, 0.0]), hold=[] if drive else ["crank"])
    return scene, closed.q, closed.v
