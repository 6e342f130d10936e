"""What motors do beside the controls: a torque that is held, and limits that they are taken to be at."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.system.actuation import NO_ACTUATION, Actuation
from ngalpha_pin.system.system import System


def motor():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "motor")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.upperEffortLimit[:] = 2.0
    model.lowerEffortLimit[:] = -2.0
    scene = nga.Scene(model)
    scene.add_force(nga.JointPD(np.array([1.0]), kp=1.5, kd=0.0))
    return System(scene)


@pytest.mark.parametrize(
    "actuation, tau, slope",
    [
        (NO_ACTUATION, 1.5, -1.5),
        (Actuation(tau=np.array([0.2])), 1.7, -1.5),
        (Actuation(tau=np.array([5.0])), 2.0, 0.0),  # within the limits of the motor
        (Actuation(held=np.array([1])), 2.0, 0.0),
        (Actuation(held=np.array([-1])), -2.0, 0.0),
        (Actuation(tau=np.array([5.0]), held=np.array([0])), 6.5, -1.5),  # taken to be on its slope
    ],
)
def test_torque_and_slope(actuation, tau, slope):
    found, K, _ = motor().loads(0.0, np.zeros(1), np.zeros(1), actuation)
    assert found[0] == pytest.approx(tau) and K[0, 0] == pytest.approx(slope)
