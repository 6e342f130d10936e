"""Constraints and contact in one step: both stand among the multipliers, in blocks that do not follow each other."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_two_joined_bodies_land_on_one_ball(mu):
    model = pin.Model()
    for name in "ab":
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        model.addBodyFrame(f"frame {name}", joint, pin.SE3.Identity(), 0)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="frame a")
    scene.add_contact("ball", "ground", mu=mu)
    scene.add_constraint(nga.PointJoint("frame a", "frame b", name="joint"))
    q0 = pin.neutral(model)
    q0[[2, 9]] = 0.15
    run = nga.simulate(scene, q0, np.zeros(12), t_end=0.3, dt=1e-2)
    np.testing.assert_allclose(run.q[-1, [2, 9]], 0.1, atol=1e-10)
    assert run.la_N[-1, 0] == pytest.approx(2 * 9.81)  # the ground carries both
    assert np.linalg.norm(run.la_g[-1]) == pytest.approx(9.81)  # the joint carries one of them
