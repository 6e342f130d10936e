"""A disc that rolls upright on a plane goes in a circle: closed form."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.constraints.rolling_disc import Discs

RADIUS, MASS = 0.2, 1.5


def disc():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "disc")
    inertia = MASS * RADIUS**2 * np.diag([0.25, 0.25, 0.5])
    model.appendBodyToJoint(joint, pin.Inertia(MASS, np.zeros(3), inertia), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry("disc", coal.Cylinder(RADIUS, 0.01), parent="disc")
    scene.add_plane("ground")
    scene.add_constraint(nga.RollingDisc("disc", "ground"))
    return scene


def test_upright_it_rolls_straight():
    scene = disc()
    q0 = np.concatenate(([0.0, 0.0, RADIUS], pin.Quaternion(pin.exp3(np.array([np.pi / 2, 0.0, 0.0]))).coeffs()))
    # the axis z of the disc lies along -y of the world: a spin of -10 rad/s about it goes along x
    v0 = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -10.0])
    v0[:3] = pin.XYZQUATToSE3(q0).rotation.T @ [10.0 * RADIUS, 0.0, 0.0]
    error = []
    for dt in (4e-3, 2e-3):  # the velocity turns in the frame of the body, so that the way is not exact
        run = nga.simulate(scene, q0, v0, t_end=0.5, dt=dt)
        error.append(10.0 * RADIUS * 0.5 - run.q[-1, 0])
        assert run.q[-1, 1:3] == pytest.approx([0.0, RADIUS], abs=1e-9)
        assert run.la_g[-1, 0] == pytest.approx(MASS * 9.81, rel=1e-3)
    assert abs(error[1]) < 1e-4 and 3.5 < error[0] / error[1] < 4.5


def test_one_gap_and_two_directions():
    assert Discs([]).names_g == () and Discs([]).names_gamma == ()
    rows = nga.simulate(disc(), *_lying(), t_end=1e-3, dt=1e-3).constraint_names
    assert len(rows) == 3


def _lying():
    tilt = pin.exp3(np.array([0.9, 0.0, 0.0]))
    height = RADIUS * np.sin(0.9)
    return np.concatenate(([0.0, 0.0, height], pin.Quaternion(tilt).coeffs())), np.zeros(6)
