"""An actuator of a joint against its formula, its bounds and differences of its force."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga


@pytest.fixture
def scene():
    model = pin.buildSampleModelManipulator()
    return nga.Scene(model)


def applied(scene, actuator, q, v):
    scene.add_force(actuator)
    n = scene.model.nv
    tau, K, D = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
    actuator.add_to(0.2, q, v, tau, K, D)
    return tau, K, D


def test_affine_force_and_its_derivatives(scene):
    rng = np.random.default_rng(0)
    names = list(scene.model.names)[1:3]
    gears = {names[0]: 2.0, names[1]: -0.5}
    servo = nga.JointActuator("servo", gears, gain=(3.0, 1.0, 0.2), bias=(0.5, -4.0, -0.7), ctrl=lambda t, q, v: 5 * t)
    q, v = rng.normal(size=scene.model.nq), rng.normal(size=scene.model.nv)
    tau, K, D = applied(scene, servo, q, v)
    length, rate = 2 * q[0] - 0.5 * q[1], 2 * v[0] - 0.5 * v[1]
    force = (3 + length + 0.2 * rate) * 1.0 + 0.5 - 4 * length - 0.7 * rate
    np.testing.assert_allclose(tau[:3], [2 * force, -0.5 * force, 0], atol=1e-14)
    for i, matrix in enumerate((K, D)):
        for j in range(len(v)):
            ends = []
            for h in (1e-6, -1e-6):
                args, there = [q.copy(), v.copy()], np.zeros(len(v))
                args[i][j] += h
                servo.add_to(0.2, *args, there, np.zeros_like(K), np.zeros_like(D))
                ends.append(there)
            np.testing.assert_allclose(matrix[:, j], (ends[0] - ends[1]) / 2e-6, atol=1e-8)


@pytest.mark.parametrize(("ctrl", "force"), [(0.5, 0.5), (3.0, 2.0), (-9.0, -1.0)])
def test_control_and_force_stay_in_their_ranges(scene, ctrl, force):
    joint = scene.model.names[1]
    motor = nga.JointActuator("motor", joint, ctrl=ctrl, ctrl_range=(-1, 2), force_range=(-5, 5))
    q, v = pin.neutral(scene.model), np.zeros(scene.model.nv)
    assert applied(scene, motor, q, v)[0][0] == force


def test_a_force_at_its_bound_has_no_stiffness(scene):
    servo = nga.JointActuator("servo", scene.model.names[1], bias=(0, -100, 0), force_range=(-1, 1))
    q, v = np.full(scene.model.nq, 0.3), np.zeros(scene.model.nv)
    tau, K, _ = applied(scene, servo, q, v)
    assert tau[0] == -1 and not K.any()


@pytest.mark.parametrize("wrong", [{"gain": (1, 2)}, {"bias": (0, np.nan, 0)}, {"ctrl_range": (1, 0)}])
def test_wrong_numbers_are_refused_by_name(wrong):
    with pytest.raises(nga.SceneError, match="actuator 'motor'"):
        nga.JointActuator("motor", "hip", **wrong)
