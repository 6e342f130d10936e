"""Box on an incline: it sticks without creep below the angle of friction and slides as Coulomb says above it."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import references, robots

HALF = 0.1
"""Half of the edge of the box [m]."""


def box_on_incline(angle, mu, planar=False, shape=None):
    """A box of 1 kg flat on a plane that falls towards +x; the first coordinate of its joint is along it."""
    model = pin.Model()
    tilt = pin.SE3(pin.exp3(np.array([0.0, angle, 0.0])), np.zeros(3))
    joint = pin.JointModelPlanar() if planar else pin.JointModelFreeFlyer()
    # the axes of a planar joint are turned, so that its plane is x-z
    upright = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3)) if planar else pin.SE3.Identity()
    model.addJoint(0, joint, tilt * upright, "box")
    model.appendBodyToJoint(1, pin.Inertia.FromBox(1.0, 2 * HALF, 2 * HALF, 2 * HALF), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    normal = tilt.rotation[:, 2]
    scene.add_plane("incline", normal=normal)
    scene.add_geometry("box", shape or coal.Box(2 * HALF, 2 * HALF, 2 * HALF), parent="box")
    scene.add_contact("box", "incline", mu=mu)
    q0 = pin.neutral(model)
    q0[1 if planar else 2] = HALF
    return scene, q0


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("dt", [1e-2, 2e-3])
def test_box_at_20_degrees_does_not_creep(dt, planar):
    scene, q0 = box_on_incline(np.radians(20), 0.7, planar)
    box = nga.simulate(scene, q0, t_end=1.0, dt=dt)
    assert np.abs(box.v).max() < 1e-9
    half = len(box.t) // 2
    assert np.abs(box.q[-1] - box.q[half]).max() < 1e-9 * (box.t[-1] - box.t[half])
    assert box.la_N[-1].sum() == pytest.approx(9.81 * np.cos(np.radians(20)), rel=1e-8)


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("dt", [1e-2, 1e-3])
def test_box_that_sticks_from_the_start_stays_where_it_was_put(dt, planar):
    scene, q0 = box_on_incline(np.radians(20), 0.7, planar)
    assert np.abs(nga.simulate(scene, q0, t_end=0.1, dt=dt).q - q0).max() < 1e-12


def test_box_that_is_dropped_on_the_incline_comes_to_rest():
    scene, q0 = box_on_incline(np.radians(20), 0.7)
    q0[2] += 0.01
    box = nga.simulate(scene, q0, t_end=1.0, dt=2e-3)
    assert box.success
    assert np.abs(box.v[-100:]).max() < 1e-9
    assert box.audit().penetration < 1e-9


@pytest.mark.parametrize("angle", np.radians([10, 20, 35]))
@pytest.mark.parametrize("margin", [-0.01, 0.01])
def test_sticks_or_slides_on_either_side_of_the_angle_of_friction(angle, margin):
    mu = np.tan(angle) + margin
    scene, q0 = box_on_incline(angle, mu)
    box = nga.simulate(scene, q0, t_end=0.5, dt=2e-3)
    _, expected = references.box_on_incline(box.t, angle, mu, speed=0.0)
    if margin > 0:
        assert np.abs(box.v).max() < 1e-9
    else:
        assert expected[-1, 0] > 0.04
    assert box.v[:, 0] == pytest.approx(expected[:, 0], abs=1e-6)


@pytest.mark.parametrize("planar", [False, True])
def test_box_sent_uphill_stops_and_stays_or_comes_back(planar):
    for mu, comes_back in ((0.5, False), (0.2, True)):
        angle = np.radians(20)
        scene, q0 = box_on_incline(angle, mu, planar)
        v0 = np.zeros(scene.model.nv)
        v0[0] = -1.0
        box = nga.simulate(scene, q0, v0, t_end=0.5, dt=1e-3)
        s, speed = references.box_on_incline(box.t, angle, mu, speed=-1.0)
        # the moment at which friction turns round is known to a step
        slack = 2 * mu * 9.81 * 1e-3
        assert box.v[:, 0] == pytest.approx(speed[:, 0], abs=slack)
        assert (box.q[:, 0] - q0[0]) == pytest.approx(s[:, 0], abs=slack * box.t[-1])
        assert (box.v[-1, 0] > 0.1) == comes_back


def test_corners_that_take_over_load_when_a_slide_ends_meet_no_impact():
    scene, q0, v0 = robots.load("box_on_incline")
    assert {event.kind for event in nga.simulate(scene, q0, v0, t_end=0.2, dt=2e-3).events} == {"stick"}


def test_sphere_rolls_down():
    angle = np.radians(20)
    scene, q0 = box_on_incline(angle, 0.7, shape=coal.Sphere(HALF))
    scene.model.inertias[1] = pin.Inertia.FromSphere(1.0, HALF)
    ball = nga.simulate(scene, q0, t_end=0.5, dt=1e-3)
    rotation = [pin.XYZQUATToSE3(q).rotation for q in ball.q]
    speed = [(R @ v[:3])[0] for R, v in zip(rotation, ball.v, strict=True)]
    assert speed == pytest.approx(5 / 7 * 9.81 * np.sin(angle) * ball.t, abs=1e-4)
    assert np.abs(ball.gamma_F).max() < 1e-9
