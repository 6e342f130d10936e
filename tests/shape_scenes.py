"""Two bodies of every shape."""

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga


def cloud(n, seed):
    points = coal.StdVec_Vec3s()
    for p in np.random.default_rng(seed).normal(size=(n, 3)):
        points.append(0.3 * p / np.linalg.norm(p))
    return coal.Convex.convexHull(points, True, "")


SHAPES = {
    "sphere": coal.Sphere(0.2),
    "capsule": coal.Capsule(0.15, 0.4),
    "box": coal.Box(0.3, 0.4, 0.5),
    "cylinder": coal.Cylinder(0.2, 0.5),
    "cone": coal.Cone(0.2, 0.5),
    "ellipsoid": coal.Ellipsoid(0.2, 0.3, 0.25),
    "convex": cloud(30, 0),
    "triangle": coal.TriangleP(np.array([-0.3, -0.2, 0]), np.array([0.3, -0.2, 0]), np.array([0, 0.4, 0.0])),
}


def two_bodies(a, b):
    """A fixed shape "a" and a free one "b"; 1 kg with the inertia of a cube of 0.4 m."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, 0.4, 0.4, 0.4), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_geometry("a", a, placement=pin.SE3(pin.exp3(np.array([0.3, -0.5, 0.2])), np.array([0.1, 0.2, -0.1])))
    scene.add_geometry("b", b, parent="body", placement=pin.SE3(pin.exp3(np.array([0.2, 0.1, 0.4])), np.zeros(3)))
    scene.add_contact("a", "b")
    return scene


def random_pose(rng, scale):
    q = np.concatenate((scale * rng.normal(size=3), rng.normal(size=4)))
    q[3:] /= np.linalg.norm(q[3:])
    return q
