"""Boxes on planes, on other boxes and on inclines, and tables with many feet."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

SIZE = np.array([0.3, 0.4, 0.5])
GRAVITY = 9.81


def boxes(sizes: list[np.ndarray], ground: str, tilt: float = 0.0, **law: float) -> nga.Scene:
    """Free boxes "box_0", ... of 1 kg above a ground that falls towards +x.

    Args:
        sizes: edges of the boxes [m].
        ground: "plane", a half-space with the corners of the boxes as contact points, or "slab", a wide box, whose
            face touches whatever corner, edge or face comes near.
        tilt: angle of the ground [rad].
        law: mu and e_N of all contacts with the ground.
    """
    model = pin.Model()
    for i, size in enumerate(sizes):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"box_{i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, *size), pin.SE3.Identity())
        model.addJointFrame(joint)
    scene = nga.Scene(model)
    R = pin.exp3(np.array([0.0, tilt, 0.0]))
    if ground == "plane":
        scene.add_plane("ground", normal=R[:, 2])
    else:
        scene.add_geometry("ground", coal.Box(6.0, 6.0, 0.4), placement=pin.SE3(R, -0.2 * R[:, 2]))
    for i, size in enumerate(sizes):
        scene.add_geometry(f"shape_{i}", coal.Box(*size), parent=f"box_{i}")
    scene.add_contact("shape_*", "ground", **law)
    return scene


def dropped(side: str, seed: int, height: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """A box that comes down on its face, an edge or a corner, turned and thrown at random: q0 and v0."""
    rng, half = np.random.default_rng(seed), SIZE / 2
    turned = pin.exp3(np.array([0.0, 0.0, rng.uniform(-3.0, 3.0)]))
    if side == "edge":
        turned = turned @ pin.exp3(np.array([0.0, np.arctan2(half[0], half[2]), 0.0]))
    if side == "corner":
        down = np.array([0.0, 0.0, -1.0])
        turned = turned @ pin.Quaternion.FromTwoVectors(-half, down).toRotationMatrix()
    v0 = np.concatenate((0.3 * rng.normal(size=2), [0.0], 0.5 * rng.normal(size=3)))
    if side == "flat":
        v0[3:5] = 0.0
    q0 = np.concatenate(([0.0, 0.0, height + np.abs(turned[2]) @ half], pin.Quaternion(turned).coeffs()))
    return q0, v0


def on_incline(tilt: float, mu: float) -> tuple[nga.Scene, np.ndarray]:
    """A box at rest on a slab, and its q0."""
    R = pin.exp3(np.array([0.0, tilt, 0.0]))
    q0 = np.concatenate((SIZE[2] / 2 * R[:, 2], pin.Quaternion(R).coeffs()))
    return boxes([SIZE], "slab", tilt, mu=mu), q0


def stack(n: int, edge: float = 0.2, mu: float = 0.5) -> tuple[nga.Scene, np.ndarray]:
    """Equal boxes on each other, face on face, and their q0."""
    scene = boxes(n * [np.full(3, edge)], "plane", mu=mu)
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
