"""Balls that fall into a box, come to rest on each other and on its walls: a packing with many contacts.

The walls are planes; between layers the balls are as far apart as within one.
"""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga


def load(
    *,
    side: int = 2,
    layers: int = 3,
    radius: float = 0.1,
    mass: float = 1.0,
    mu: float = 0.5,
    e_N: float = 0.0,
    gap: float = 0.02,
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the balls above the floor z = 0, at rest; contacts are "ball_0/floor", "ball_0/ball_1" and so on.

    Args:
        side: balls along each side of the box.
        layers: of side^2 balls each.
        radius: of a ball [m].
        mass: of a ball [kg].
        mu: friction coefficient of all contacts [-].
        e_N: restitution coefficient of all contacts [-].
        gap: between neighbours at the start, half of it at the walls, in parts of the radius [-].

    Returns:
        The scene, q0 of shape (7 n,) and v0 of shape (6 n,) for n balls.
    """
    n = side * side * layers
    model = pin.Model()
    model.name = "balls_in_box"
    for i in range(n):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"ball_{i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(mass, radius), pin.SE3.Identity())
        model.addJointFrame(joint)
    scene = nga.Scene(model)
    for i in range(n):
        scene.add_geometry(f"ball_{i}", coal.Sphere(radius), parent=f"ball_{i}")
    pitch = (2.0 + gap) * radius
    wall = side * pitch / 2
    scene.add_plane("floor")
    for axis, name in enumerate(("x", "y")):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = -sign
            scene.add_plane(
                f"wall_{'-' if sign < 0 else '+'}{name}", point=(-wall * normal).tolist(), normal=normal.tolist()
            )
    for other in ("floor", "wall_*", "ball_*"):
        scene.add_contact("ball_*", other, mu=mu, e_N=e_N)
    rng = np.random.default_rng(0)
    q0 = pin.neutral(model)
    for i in range(n):
        layer, place = divmod(i, side * side)
        x, y = divmod(place, side)
        centre = np.array([(x + 0.5) * pitch - wall, (y + 0.5) * pitch - wall, 1.5 * radius + layer * pitch])
        # what is arranged in perfect order touches everywhere at the same time
        q0[7 * i : 7 * i + 3] = centre + gap * radius * rng.uniform(-0.45, 0.45, 3)
    return scene, q0, np.zeros(model.nv)
