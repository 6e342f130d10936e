"""Scenes of one pair of shapes each, in every arrangement: surface fixed, on a second body, on a link of a humanoid."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga
from ngalpha_pin.system.system import System

UP = np.array([0.0, 0.0, 1.0])
PAIRS = {
    "sphere-plane": (coal.Sphere(0.3), coal.Halfspace(UP, 0.1)),
    "vertex-plane": (coal.Box(0.4, 0.6, 0.8), coal.Halfspace(UP, 0.1)),
    "sphere-sphere": (coal.Sphere(0.3), coal.Sphere(0.7)),
    "sphere-hollow cylinder": (coal.Sphere(0.3), nga.Hollow(coal.Cylinder(4.0, 200.0))),
    "sphere-hollow sphere": (coal.Sphere(0.3), nga.Hollow(coal.Sphere(6.0))),
}
ARRANGEMENTS = ("fixed", "moving", "humanoid")
POSE_A = pin.SE3(pin.exp3(np.array([0.4, -0.7, 0.2])), np.array([0.3, -0.2, 0.1]))
POSE_B = pin.SE3(pin.exp3(np.array([-0.3, 0.5, 0.9])), np.array([-0.1, 0.25, 0.2]))
"""Placements of surface and body on their joints, in no special position."""


def random_inertia(rng: np.random.Generator) -> pin.Inertia:
    """Of a body of 0.5 to 1.5 kg with its centre of mass beside the origin and no principal axis along an axis."""
    turned = pin.exp3(rng.normal(size=3))
    a, b, c = rng.uniform(0.1, 1.0, size=3)  # three positive sums of which no one exceeds the two others
    principal = np.diag([b + c, c + a, a + b])
    return pin.Inertia(rng.uniform(0.5, 1.5), 0.3 * rng.normal(size=3), turned @ principal @ turned.T)


def free_flyers(n: int) -> pin.Model:
    """Bodies "body_0", ... with different inertias and their centres of mass beside the origin."""
    model = pin.Model()
    for i in range(n):
        j = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"body_{i}")
        inertia = pin.Inertia(1.0 + i, np.array([0.02, -0.03, 0.01]), np.diag([0.3, 0.4, 0.5 + 0.02 * i]))
        model.appendBodyToJoint(j, inertia, pin.SE3.Identity())
        model.addJointFrame(j)
    return model


def balls(n: int, joint=pin.JointModelTranslation, **properties) -> nga.Scene:
    """n balls of 1 kg with radius 0.1 m that move without turning above one plane; contacts have these properties."""
    model = pin.Model()
    for i in range(n):
        j = model.addJoint(0, joint(), pin.SE3.Identity(), f"ball_{i}")
        model.appendBodyToJoint(j, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        model.addJointFrame(j)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    for i in range(n):
        scene.add_geometry(f"g{i}", coal.Sphere(0.1), parent=f"ball_{i}")
    scene.add_contact("g*", "ground", **properties)
    return scene


def pair_scene(pair: str, arrangement: str, **law) -> nga.Scene:
    """Geometry "b" with contact points against geometry "a" with the surface."""
    if arrangement == "humanoid":
        model = pin.buildSampleModelHumanoid()
        parent_a: str | None = "rleg_shoulder3_joint"
        parent_b = "larm_wrist2_joint"
    else:
        model = free_flyers(1 if arrangement == "fixed" else 2)
        parent_a, parent_b = (None if arrangement == "fixed" else "body_1"), "body_0"
    scene = nga.Scene(model)
    body, surface = PAIRS[pair]
    scene.add_geometry("a", surface, parent=parent_a, placement=POSE_A)
    scene.add_geometry("b", body, parent=parent_b, placement=POSE_B)
    scene.add_contact("b", "a", **{"mu": 0.4, "contact_radius": 0.2, **law})
    return scene


def random_state(model: pin.Model, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, v and a of size one."""
    rng = np.random.default_rng(seed)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    return q, rng.normal(size=model.nv), rng.normal(size=model.nv)


def all_rows(system: System, q: np.ndarray, v: np.ndarray, a: np.ndarray, t: float = 0.0):
    """Kinematic rows of every contact of a scene."""
    system.dynamics(t, q, v, a)
    return system.contact_rows(system.contacts.subset(np.arange(system.contacts.n_points)), q, v, a, t)


def chain(n=4, gap=0.3):
    """Bodies "link_0", ... on hinges, each with a ball; the balls of neighbours overlap for a small gap."""
    model, parent = pin.Model(), 0
    for i in range(n):
        offset = pin.SE3(np.eye(3), np.array([gap if i else 0.0, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRY(), offset, f"hinge_{i}")
        model.appendBodyToJoint(parent, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        model.addJointFrame(parent)
    scene = nga.Scene(model)
    for i in range(n):
        scene.add_geometry(f"link_{i}", coal.Capsule(0.1, 0.1), parent=f"hinge_{i}")
    return scene
