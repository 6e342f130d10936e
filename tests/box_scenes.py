"""Boxes on inclines and on each other, tables with many feet, and the falls of benchmarks/boxes.py."""

from __future__ import annotations

import sys
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
import boxes as falls

sys.path.pop(0)


def box(mu: float = 0.3, e_N: float = 0.0) -> nga.Scene:
    """A free box of 2 kg, 0.4 x 0.3 x 0.2 m, above the ground."""
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("box", coal.Box(0.4, 0.3, 0.2), mass=2.0)
    scene.add_contact("box", "ground", mu=mu, e_N=e_N)
    return scene


def at(*p: float) -> np.ndarray:
    """Where a free body is, upright, shape (7,)."""
    return np.array([*p, 0.0, 0.0, 0.0, 1.0])


def on_incline(tilt: float, mu: float) -> tuple[nga.Scene, np.ndarray]:
    """A box at rest on a slab, and its q0."""
    R = pin.exp3(np.array([0.0, tilt, 0.0]))
    q0 = np.concatenate((falls.SIZE[2] / 2 * R[:, 2], pin.Quaternion(R).coeffs()))
    return falls.boxes([falls.SIZE], "slab", tilt, mu=mu), q0


def stack(n: int, edge: float = 0.2, mu: float = 0.5) -> tuple[nga.Scene, np.ndarray]:
    """Equal boxes on each other, face on face, and their q0."""
    scene = falls.boxes(n * [np.full(3, edge)], "plane", mu=mu)
    scene.contacts.clear()
    q0 = pin.neutral(scene.model)
    for i in range(n):
        q0[7 * i + 2] = (i + 0.5) * edge
        scene.add_contact(f"shape_{i}", f"shape_{i - 1}" if i else "ground", mu=mu)
    return scene, q0


def table(feet: int, mass: float = 12.0, mu: float = 0.5) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """A table on four legs with so many points of contact, its centre of mass in x and y, and the points."""
    model, centre = pin.Model(), np.array([0.05, -0.08, 0.6])
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "table")
    model.appendBodyToJoint(joint, pin.Inertia(mass, centre, np.diag([2.0, 3.0, 3.5])), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene, points = nga.Scene(model), []
    scene.add_plane("ground")
    side = int(np.ceil(np.sqrt(feet // 4)))
    for x, y in ((-0.5, -0.3), (0.5, -0.3), (-0.5, 0.3), (0.5, 0.3)):
        for k in range(feet // 4):
            points.append(np.array([x + 0.02 * (k % side), y + 0.02 * (k // side), 0.0]))
            placement = pin.SE3(np.eye(3), points[-1])
            scene.add_geometry(f"foot_{len(points):03d}", coal.Sphere(0.0), parent="table", placement=placement)
    scene.add_contact("foot_*", "ground", mu=mu)
    return scene, centre, np.array(points)
