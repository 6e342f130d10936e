"""A tree with every kind of constraint, and motions of it."""

import coal
import numpy as np
import pinocchio as pin
from contact_scenes import random_inertia
from scipy.interpolate import CubicSpline

import ngalpha_pin as nga


def tree():
    """Two chains on a moving base, with revolute, spherical, prismatic and translation joints."""
    model = pin.Model()
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    joints = {
        "a": pin.JointModelRX(),
        "b": pin.JointModelSpherical(),
        "c": pin.JointModelPZ(),
        "d": pin.JointModelRUBZ(),
    }
    rng = np.random.default_rng(5)
    for chain in ("left", "right"):
        parent = base
        for name, joint in joints.items():
            placement = pin.SE3(pin.exp3(rng.normal(size=3)), 0.3 * rng.normal(size=3))
            parent = model.addJoint(parent, joint, placement, f"{chain}_{name}")
            model.appendBodyToJoint(parent, random_inertia(rng), pin.SE3.Identity())
            frame = pin.SE3(pin.exp3(rng.normal(size=3)), 0.2 * rng.normal(size=3))
            model.addFrame(pin.Frame(f"{chain}_{name}_tip", parent, frame, pin.FrameType.OP_FRAME))
    model.appendBodyToJoint(base, random_inertia(rng), pin.SE3.Identity())
    return model


def moving_pose(t):
    return pin.SE3(pin.exp3(np.array([0.3 * t, np.sin(t), 0.2])), np.array([np.cos(2 * t), t * t, -0.5 * t]))


def with_geometries(scene):
    scene.add_plane("ground", (0.1, 0.2, -0.4), (0.2, -0.1, 1.0))
    scene.add_geometry("tilting", coal.Halfspace(np.array([0.0, 0.0, 1.0]), -0.7), parent="left_c")
    scene.add_geometry("shell", nga.Hollow(coal.Sphere(5.0)), parent="base")
    scene.add_geometry("globe", coal.Sphere(0.6), parent="left_b")
    scene.add_geometry("tube", nga.Hollow(coal.Cylinder(6.0, 40.0)))
    scene.add_geometry("ball", coal.Sphere(0.15), parent="right_d")
    scene.add_geometry("wheel", coal.Cylinder(0.25, 0.02), parent="right_d_tip")


def sine(t):
    return 0.4 * np.sin(3 * t)


def triple(t):
    return 0.2 * t**2, 0.4 * t, 0.4


def closing(t, q):
    return np.array([q[0] * q[7] - np.sin(t), q[1] ** 2 + np.cos(q[8]) * q[2]])


def mixing(t, q, v):
    return np.array([q[0] * v[1] - np.sin(q[7]) * v[6] + t])


L, R = "left_d_tip", "right_c_tip"
KINDS = {
    "point": lambda: nga.PointJoint(L, R),
    "point world": lambda: nga.PointJoint("world", R),
    "weld": lambda: nga.Weld(L, R),
    "revolute": lambda: nga.RevoluteJoint(L, R, axis=(0.2, 1.0, -0.3)),
    "universal": lambda: nga.UniversalJoint(L, R),
    "prismatic": lambda: nga.PrismaticJoint(L, R, axis=(1, 0, 0)),
    "cylindrical": lambda: nga.CylindricalJoint(L, R),
    "planar": lambda: nga.PlanarJoint(L, "world", axis=(0, 1, 1)),
    "ancestor": lambda: nga.Weld("left_a_tip", L),
    "distance": lambda: nga.Distance(L, R, 0.7),
    "knife": lambda: nga.KnifeEdge(R, (0, 1, 0)),
    "knife on a moving base": lambda: nga.KnifeEdge(R, (0, 1, 0), relative_to=L),
    "frame trajectory": lambda: nga.FrameTrajectory(R, moving_pose),
    "joint trajectory": lambda: nga.JointTrajectory("left_a", sine),
    "joint triple": lambda: nga.JointTrajectory("left_c", triple),
    "joint spline": lambda: nga.JointTrajectory("right_a", CubicSpline([0.0, 0.5, 1.0], [0.0, 1.0, 0.2])),
    "continuous": lambda: nga.JointTrajectory("right_d", sine),
    "coupling": lambda: nga.JointCoupling("left_a", "right_c", (0.1, 2.0, -0.7, 0.3)),
    "sphere on plane": lambda: nga.RollingSphere("ball", "ground"),
    "sphere on turntable": lambda: nga.RollingSphere("ball", "tilting"),
    "sphere in shell": lambda: nga.RollingSphere("ball", "shell"),
    "sphere in tube": lambda: nga.RollingSphere("ball", "tube"),
    "disc on plane": lambda: nga.RollingDisc("wheel", "ground"),
    "disc on turntable": lambda: nga.RollingDisc("wheel", "tilting"),
    "disc in shell": lambda: nga.RollingDisc("wheel", "shell"),
    "disc on globe": lambda: nga.RollingDisc("wheel", "globe"),
    "own g": lambda: nga.PositionConstraint(closing),
    "own gamma": lambda: nga.VelocityConstraint(mixing),
}


def motion_of(system, seed=1):
    rng, model = np.random.default_rng(seed), system.model
    q = pin.integrate(model, pin.neutral(model), 0.7 * rng.normal(size=model.nv))
    return q, rng.normal(size=model.nv), rng.normal(size=model.nv)
