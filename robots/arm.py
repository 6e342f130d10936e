"""An arm with seven joints that hangs from a gantry and swings under gravity: no contact, and the energy stays."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import ngalpha_pin as nga

URDF = Path(__file__).parent / "urdf" / "arm.urdf"


def load(*, kp: float = 0.0, kd: float = 0.0) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the arm at rest, almost stretched, to the side.

    Args:
        kp: stiffness that holds the joints where they start [N m / rad]; with kp = kd = 0 nothing holds them.
        kd: damping of the joints [N m s / rad].

    Returns:
        The scene, q0 of shape (7,) [rad] and v0 of shape (7,) [rad/s].
    """
    scene = nga.Scene.from_urdf(URDF)
    # from here it swings wide, and for 3 s it keeps away from the limits of its joints
    q0 = np.array([0.8, 0.7, 0.2, 0.1, -0.2, 0.0, 0.0])
    if kp or kd:
        scene.add_force(nga.JointPD(q0, kp, kd))
    return scene, q0, np.zeros(scene.model.nv)
