"""An angle between two frames that follows a function of time."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.constraints.driven_angle import DrivenAngle


def pendulum():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
    model.appendBodyToJoint(joint, pin.Inertia(2.0, np.array([0.3, 0.0, 0.0]), 0.05 * np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("arm", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    return nga.Scene(model)


def test_motion_and_torque():
    """The torque of the drive is I angle_ddot + m g l cos(angle)."""
    scene = pendulum()
    scene.add_constraint(DrivenAngle("world", "arm", lambda t: 0.5 * np.sin(2 * t)))
    run = nga.simulate(scene, np.zeros(1), np.ones(1), t_end=1.0, dt=1e-3)
    angle = 0.5 * np.sin(2 * run.t)
    np.testing.assert_allclose(run.q[:, 0], angle, atol=1e-9)
    torque = (0.05 + 2.0 * 0.3**2) * -4 * angle + 2.0 * 9.81 * 0.3 * np.cos(angle)
    np.testing.assert_allclose(run.la_g[1:, 0], torque[1:], atol=1e-4)


def test_more_than_a_turn():
    scene = pendulum()
    scene.add_constraint(DrivenAngle("world", "arm", lambda t: 20.0 * t))
    run = nga.simulate(scene, np.zeros(1), np.array([20.0]), t_end=1.0, dt=1e-3)
    assert run.q[-1, 0] == pytest.approx(20.0, abs=1e-9)


def test_only_functions():
    with pytest.raises(nga.SceneError, match="expected a function of time"):
        DrivenAngle("world", "arm", 0.3)
