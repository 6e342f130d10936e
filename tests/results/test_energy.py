"""Energies of motions that are known."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.results.energy import energy


def slider(stiffness):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slider")
    model.appendBodyToJoint(joint, pin.Inertia(2.0, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_force(nga.JointSpring("slider", stiffness, rest=0.1))
    return scene


def test_spring_and_weight():
    run = nga.simulate(slider(50.0), np.array([0.3]), np.array([0.4]), t_end=1e-2, dt=1e-3)
    found = energy(run)
    assert found.conserved
    assert (found.kinetic[0], found.potential[0], found.elastic[0]) == pytest.approx(
        (0.5 * 2.0 * 0.4**2, 2.0 * 9.81 * 0.3, 0.5 * 50.0 * 0.2**2)
    )
    assert found.total == pytest.approx(found.kinetic + found.potential + found.elastic)
    assert np.ptp(found.total) < 1e-5


def test_controls_may_feed_energy_in():
    scene = slider(50.0)
    scene.add_force(nga.Control(lambda t, q, v: np.array([1.0])))
    assert not energy(nga.simulate(scene, np.zeros(1), t_end=2e-3, dt=1e-3)).conserved


def test_ball_that_falls():
    run = nga.simulate(*robots.load("rotating_ball"), t_end=0.2, dt=1e-2)
    found = run.energy
    assert found.total == pytest.approx(found.total[0], rel=1e-12) and found.elastic == pytest.approx(0.0)
