"""Solo12, a quadruped of 2.5 kg with twelve joints: it drops, lands and stands.

Model, geometries and posture come from the package example-robot-data (pip install example-robot-data-loaders).
"""

from __future__ import annotations

import numpy as np

import ngalpha_pin as nga

from . import _legged


def load(
    *, height: float = 0.1, mu: float = 0.8, kp: float = 10.0, kd: float = 0.2
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the robot above the plane z = 0, at rest; the contacts are "FL_FOOT_0" and so on with "ground".

    Args:
        height: of the feet above the plane [m].
        mu: friction coefficient [-].
        kp: stiffness of the joints [N m / rad].
        kd: damping of the joints [N m s / rad].

    Returns:
        The scene, q0 of shape (19,) and v0 of shape (18,).

    Raises:
        nga.SceneError: example-robot-data is not installed.
    """
    scene, posture = _legged.example_robot("solo12")
    return _legged.drop(scene, posture, "*_FOOT_0", height, mu, kp, kd)
