"""The centre of mass of everything, and of a part of it."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots


def test_against_pinocchio_and_by_parts():
    run = nga.simulate(*robots.load("quadruped", height=0.02), t_end=0.02, dt=2e-3)
    model = run.scene.model
    data, found = model.createData(), run.centre_of_mass()
    for i in (0, 5, 10):
        pin.centerOfMass(model, data, run.q[i], run.v[i], run.a[i])
        for mine, theirs in zip(found, (data.com[0], data.vcom[0], data.acom[0]), strict=True):
            assert mine[i] == pytest.approx(theirs, abs=1e-10 * max(1.0, np.abs(theirs).max()))
    # of a leg alone: a part of the sum
    leg = run.centre_of_mass("FL_knee").position[0]
    data.oMi[1]
    knee = model.getJointId("FL_knee")
    pin.forwardKinematics(model, data, run.q[0])
    assert leg == pytest.approx(data.oMi[knee].act(model.inertias[knee].lever), abs=1e-12)


def test_what_has_none():
    scene, q0, v0 = robots.load("cantilever")
    with pytest.raises(nga.SceneError, match="this scene has beams"):
        nga.simulate(scene, q0, v0, t_end=2e-4, dt=1e-4).centre_of_mass()
