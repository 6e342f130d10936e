"""Rows of constraints as wrenches on bodies do the work that their directions in coordinates say."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.contact.reach import moved_by
from ngalpha_pin.system.system import System


def two_bodies():
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("a", coal.Sphere(0.2), mass=1.0)
    scene.add_body("b", coal.Cylinder(0.3, 0.01), mass=2.0)
    return scene


KINDS = {
    "weld": nga.Weld("a", "b"),
    "universal": nga.UniversalJoint("b", "a"),
    "distance": nga.Distance("world", "b", 1.0),
    "blade": nga.KnifeEdge("a", (1.0, 0.0, 0.0)),
    "trajectory": nga.FrameTrajectory("a", lambda t: pin.SE3.Identity()),
    "angle": nga.DrivenAngle("a", "b", lambda t: 0.3 * t),
    "sphere": nga.RollingSphere("a", "ground"),
    "disc": nga.RollingDisc("b", "ground"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_wrenches_do_the_work_of_the_rows(kind):
    scene = two_bodies()
    scene.add_constraint(KINDS[kind])
    system, rng = System(scene), np.random.default_rng(1)
    q = pin.integrate(system.model, pin.neutral(system.model), rng.normal(size=12))
    v, a = rng.normal(size=(2, 12))
    system.dynamics(0.0, q, v, a)
    rows, J = system.constraint_rows(0.0, q, v, a), system.motion(v, a).J
    la = rng.normal(size=len(rows.rate))
    total = np.zeros((3, 6))
    rows.add_wrenches(la, total)
    generalized = sum(total[j] @ (J * moved_by(system.model, j)) for j in (1, 2))
    assert np.abs(generalized).max() > 1e-2
    assert generalized == pytest.approx(la @ rows.W, abs=1e-12)


def test_rows_of_coordinates_act_in_joints():
    model = pin.Model()
    for name in ("x", "y"):
        joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_constraint(nga.JointCoupling("x", "y", (0.0, 2.0)))
    scene.add_constraint(nga.JointTrajectory("y", lambda t: t))
    scene.add_constraint(nga.PositionConstraint(lambda t, q: q[0] - 1.0))
    system, v = System(scene), np.zeros(2)
    system.dynamics(0.0, np.zeros(2), v, v)
    total = np.zeros((3, 6))
    system.constraint_rows(0.0, np.zeros(2), v, v).add_wrenches(np.ones(3), total)
    assert not total.any()
