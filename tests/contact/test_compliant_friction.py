"""Compliant contact with rolling resistance and with friction that differs by direction, against closed forms."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga

G, R, ARM, K = 9.81, 0.1, 4e-3, 2e4
SOFT = nga.KelvinVoigt(K, 50.0)
ELLIPSE = nga.FrictionEllipse(0.2, 0.5)


def ball(slope=0.0, **law):
    """A ball of 1 kg in space on a plane, at rest as deep as its weight presses it; gravity leans towards x."""
    scene = nga.Scene()
    scene.model.gravity.linear = G * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    scene.add_plane("ground")
    depth = G * np.cos(slope) / K
    scene.add_body("ball", coal.Sphere(R), mass=1.0, placement=pin.SE3(np.eye(3), np.array([0.0, 0.0, R - depth])))
    scene.add_contact("ball", "ground", **{"mu": 0.5, "rolling_resistance": ARM, "compliance": SOFT, **law})
    return scene, R - depth


@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"dt": 5e-3}, {"rtol": 1e-6}])
def test_ball_comes_to_rest(accuracy):
    """It turns about where the surface was before it gave way; the moment is the arm times the elastic force."""
    scene, radius = ball()
    run = nga.simulate(scene, scene.q_ref, [0.05, 0.0, 0.0, 0.0, 0.05 / radius, 0.0], t_end=0.2, **accuracy)
    slows = G * ARM * radius / (0.4 * R**2 + radius**2)
    assert run.q[-1, 0] == pytest.approx(0.05**2 / (2 * slows), abs=1e-6 if "dt" in accuracy else 1e-8)
    assert np.abs(run.v[-1, 3:]).max() < 1e-14
    assert np.abs(run.v[-1, :3]).max() < 1e-6  # of its vibration
    assert run.audit().ok, str(run.audit())


@pytest.mark.parametrize("side", [-0.01, 0.01])
def test_angle_of_rolling_resistance(side):
    slope = np.arctan((1 + side) * ARM / R)
    for _ in range(3):  # the depth depends a little on the slope
        slope = np.arctan((1 + side) * ARM / (R - G * np.cos(slope) / K))
    scene, radius = ball(slope)
    run = nga.simulate(scene, scene.q_ref, t_end=0.1, dt=1e-2)
    a = G * (np.sin(slope) - ARM / radius * np.cos(slope)) / (1.0 + 0.4 * R**2 / radius**2)
    assert run.q[-1, 0] == pytest.approx(max(0.5 * a * 0.1**2, 0.0), abs=1e-10)
    assert (np.abs(run.v[-1]).max() < 1e-10) == (side < 0)


def slider(load):
    """A mass of 1 kg that does not turn, on a soft plane, under a force along the plane."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "mass")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, R), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("mass", coal.Sphere(R), parent="mass")
    scene.add_contact("mass", "ground", mu=ELLIPSE, compliance=SOFT)
    scene.add_force(nga.Control(lambda t, q, v: np.array([*load, 0.0])))
    return scene, np.array([0.0, 0.0, R - G / K])


@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi / 2])
@pytest.mark.parametrize("side", [-0.01, 0.01])
def test_sticks_within_the_ellipse_of_the_elastic_force(angle, side):
    load = (1 + side) * G * np.array([0.2 * np.cos(angle), 0.5 * np.sin(angle)])
    scene, q0 = slider(load)
    run = nga.simulate(scene, q0, t_end=0.1, dt=1e-2)
    moved = np.abs(run.q[-1, :2]).max()
    assert moved < 1e-14 if side < 0 else moved > 1e-6
    assert run.audit().ok, str(run.audit())


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-6}])
def test_slip_along_an_axis_stops(axis, accuracy):
    scene, q0 = slider((0.0, 0.0))
    run = nga.simulate(scene, q0, 0.3 * np.eye(3)[axis], t_end=0.2, **accuracy)
    mu = (ELLIPSE.along, ELLIPSE.across)[axis]
    t = min(0.2, 0.3 / (mu * G))
    assert run.q[-1, axis] == pytest.approx(0.3 * t - 0.5 * mu * G * t**2, abs=1e-9)
    assert run.audit().ok
