"""Small angles of joints that store a cosine and a sine are not lost."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.system.system import System


@pytest.mark.parametrize("angle", [1e-12, 5e-9, 2e-8, 1e-3, 3.0, -3.0])
def test_differences_of_planar_and_continuous_joints(angle):
    model = pin.Model()
    for joint in (pin.JointModelPlanar(), pin.JointModelPX(), pin.JointModelRUBX()):
        body = model.addJoint(0, joint, pin.SE3.Identity(), f"joint_{model.njoints}")
        model.appendBodyToJoint(body, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    system, step = System(nga.Scene(model)), np.array([0.0, 0.0, angle, 0.3, angle])
    for turned in np.random.default_rng(0).uniform(-3.0, 3.0, 200):
        q0 = system.integrate(pin.neutral(model), np.array([0.5, 0.5, turned, 0.1, turned]))
        assert system.difference(q0, system.integrate(q0, step)) == pytest.approx(step, abs=1e-14, rel=1e-12)
