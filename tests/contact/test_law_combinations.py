"""Laws together: rolling resistance on a belt, in closed form."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga

G, R, ARM = 9.81, 0.1, 1e-2


@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-6}])
def test_ball_with_rolling_resistance_on_a_belt(accuracy):
    """It rolls on the spot while the belt passes below it, but for the resistance, which carries it along."""
    model = pin.Model()
    first = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    second = model.addJoint(first, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    ball = model.addJoint(second, pin.JointModelRY(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(ball, pin.Inertia(1.0, np.zeros(3), 0.4 * R**2 * np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(ball)
    scene, speed = nga.Scene(model), 0.1
    scene.add_plane("belt")
    scene.add_geometry("ball", coal.Sphere(R), parent="ball")
    scene.add_contact("ball", "belt", mu=0.5, rolling_resistance=ARM, surface_velocity=(speed, 0.0, 0.0))
    run = nga.simulate(scene, [0.0, R, 0.0], [0.0, 0.0, -speed / R], t_end=0.2, **accuracy)
    a = G * ARM / R / 1.4
    stop = speed / a  # then it goes with the belt and does not roll any more
    way = a * stop**2 / 2 + speed * (0.2 - stop)
    assert run.q[-1, 0] == pytest.approx(way, abs=1e-9 if "dt" in accuracy else 1e-6)
    assert run.v[-1] == pytest.approx([speed, 0.0, 0.0], abs=1e-13)
    assert run.audit().ok, str(run.audit())
