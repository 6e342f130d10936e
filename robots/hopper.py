"""Guided hopper, section 10.5: a body guided vertically, a rod with a prescribed angle, and a beam as its shin.

The plane of motion is x-z with gravity along -z and counter-clockwise angles. The paper's coordinates map as

    y, alpha, q_b  ->  q = (z, cos alpha, sin alpha, q_b)

The knee at hip + L (sin alpha, -cos alpha) is the start of the beam, the foot its end. The constraints are that alpha
follows alpha(t), and (153): knee and start of the beam stay together, with the angle beta(t) from the rod (knee to hip)
to the beam.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

URDF = Path(__file__).parent / "urdf" / "hopper.urdf"
LENGTH = 0.2
"""L, of the rod and of the beam [m]."""
EA, EI, LINE_DENSITY = 1.89e7, 14.2, 0.71
"""Of the beam [N], [N m^2], [kg/m]."""
MASS = 3.0 + 1.56 + LINE_DENSITY * LENGTH
"""Of body, rod and beam [kg]."""
KNEE = pin.SE3(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]), np.array([0.0, 0.0, -LENGTH]))
"""The knee in the frame of the rod: x towards the hip, z normal to the plane of the beam."""


def alpha(t: float) -> tuple[float, float, float]:
    """Angle of the rod (155) with its derivatives [rad], [rad/s], [rad/s^2]."""
    w, size = 4 * np.pi, np.pi / 30
    return np.pi / 3 - size * (1 - np.cos(w * t)), -size * w * np.sin(w * t), -size * w * w * np.cos(w * t)


def beta(t: float) -> tuple[float, float, float]:
    """Angle of the knee (155), pi - 2 alpha, with its derivatives."""
    angle, rate, acceleration = alpha(t)
    return np.pi - 2 * angle, -2 * rate, -2 * acceleration


def load(
    *,
    height: float = 0.31,
    mu: float = 0.2,
    moves: bool = True,
    elements: int = 2,
    degree: int = 2,
    gauss: int = 5,
    damping: float = 0.0,
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the hopper at rest above the plane z = 0; its contact is "foot" with "ground".

    Args:
        height: of the hip at the start, y(0) [m].
        mu: friction coefficient [-].
        moves: False holds the angles of the start.
        elements: of the beam.
        degree: of its shape functions.
        gauss: Gauss points per element.
        damping: retardation time of the beam [s].

    Returns:
        The scene, q0 of shape (3 + 2 (elements + degree),) [m, -, -, m ...] and v0.
    """
    scene = nga.Scene.from_urdf(URDF)
    scene.model.gravity.linear = np.array([0.0, 0.0, -9.81])
    scene.add_plane("ground")
    beam = scene.add_beam(
        nga.PlanarBeam(
            LENGTH, EA=EA, EI=EI, line_density=LINE_DENSITY,
            degree=degree, elements=elements, gauss=gauss, damping=damping,
        ),
        "shin",
    )  # fmt: skip
    scene.add_beam_point("knee", "shin", 0.0)
    scene.add_beam_point("foot", "shin", 1.0)
    scene.add_constraint(nga.JointTrajectory("hip", _held(alpha, moves)))
    scene.add_constraint(nga.PointJoint("rod", "knee", placement_a=KNEE))
    scene.add_constraint(nga.DrivenAngle("rod", "knee", _held(beta, moves), placement_a=KNEE))
    scene.add_contact("foot", "ground", mu=mu)
    start = alpha(0.0)[0]
    knee = np.array([LENGTH * np.sin(start), height - LENGTH * np.cos(start)])
    shin = beam.configuration(knee, angle=1.5 * np.pi - start)
    q0 = np.concatenate(([height, np.cos(start), np.sin(start)], shin))
    return scene, q0, np.zeros(scene.model.nv + beam.nv)


def _held(angle: Callable[[float], tuple[float, float, float]], moves: bool) -> Callable[[float], tuple[float, ...]]:
    return angle if moves else lambda t: (angle(0.0)[0], 0.0, 0.0)
