"""How fast what is given changes, against functions whose way is known."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.scene.given_pace import GivenPace


def pace(function, end=4.0):
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = nga.Scene(model)
    if function is not None:
        force = nga.Control(lambda t, q, v: np.array([function(t)]) - q)
        scene.add_force(force)
    return GivenPace(scene, np.zeros(1), np.zeros(1), 0.0, end)


def test_steps_are_free_where_nothing_changes():
    assert pace(None).longest(0.0) == np.inf
    assert pace(lambda t: 3.0).longest(0.0) == np.inf


def test_a_quarter_of_the_range():
    ramp = pace(lambda t: 7.0 * t)
    assert ramp.longest(0.0) == pytest.approx(1.0, abs=2e-3)
    assert ramp.longest(1.5) == pytest.approx(1.0, abs=2e-3)
    assert ramp.longest(3.5) == np.inf


def test_pulse_bounds_the_steps_up_to_it():
    pulse = pace(lambda t: np.exp(-0.5 * ((t - 2.0) / 0.01) ** 2))
    assert 1.97 < pulse.longest(0.0) < 2.0
    assert pulse.longest(1.0) == pytest.approx(pulse.longest(0.0) - 1.0)
    assert 4.0 / 4096 <= pulse.longest(2.0) < 0.02
    assert pulse.longest(2.1) == np.inf


def test_function_that_ends_before_the_run_is_no_error():
    """What the run does not come to is not to be given; what is known bounds the steps."""
    known = pace(lambda t: 7.0 * t if t <= 2.0 else np.nan)
    assert known.longest(0.0) == pytest.approx(0.5, abs=2e-3)
    assert known.longest(3.0) == np.inf


def test_servo_that_holds_is_not_sampled(monkeypatch):
    """A force that stores energy is one of the configuration."""

    def sample(*_, **__):
        raise AssertionError("sampled")

    monkeypatch.setattr(nga.JointPD, "sample", sample)
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_force(nga.JointPD(q_ref=np.zeros(1), kp=10.0, kd=1.0))
    assert GivenPace(scene, np.zeros(1), np.zeros(1), 0.0, 1.0).longest(0.0) == np.inf
