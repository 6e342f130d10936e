"""A four-bar under gravity whose crank goes round: a URDF tree, closed by one constraint.

The plane is x-z; the joints are "crank", "coupler" and "rocker", with (cos, sin) of their angles as coordinates.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import ngalpha_pin as nga

URDF = Path(__file__).parent / "urdf" / "four_bar.urdf"


def load(*, angle: float = 0.5, speed: float = 12.0) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the mechanism; its constraint is "pin".

    Args:
        angle: of the crank at the start [rad].
        speed: of the crank at the start [rad/s].

    Returns:
        The scene, q0 of shape (6,) [-] and v0 of shape (3,) [rad/s].
    """
    scene = nga.Scene.from_urdf(URDF)
    scene.add_constraint(nga.RevoluteJoint("coupler_tip", "rocker_tip", axis=(0.0, 1.0, 0.0), name="pin"))
    # roughly: coupler level, rocker upright; assembly finds the rest and keeps the crank
    angles = {"crank": angle, "coupler": -angle, "rocker": np.pi / 2}
    rough = np.concatenate([(np.cos(angles[name]), np.sin(angles[name])) for name in list(scene.model.names)[1:]])
    closed = nga.assemble(scene, rough, np.array([speed, 0.0, 0.0]), hold=["crank"])
    return scene, closed.q, closed.v
