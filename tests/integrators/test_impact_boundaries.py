"""Impacts on, just before and just after the end of a step: as exact as within one, at their own time."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga

G, RADIUS = 10.0, 0.1
# of the gap at the end of a step, from exactly on it to what counts as open
OFFSETS = [0.0, 1e-16, -1e-16, 1e-13, -1e-13, 1e-11, -1e-11, 1e-9, -1e-9]


def ball(joint, mass=1.0):
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -G])
    model.appendBodyToJoint(
        model.addJoint(0, joint, pin.SE3.Identity(), "ball"), pin.Inertia.FromSphere(mass, RADIUS), pin.SE3.Identity()
    )
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(RADIUS), parent="ball")
    return scene


@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize("dt", [2e-2, 1e-2, 1e-3])
@pytest.mark.parametrize("e_N", [0.0, 0.5, 1.0])
def test_ball_that_is_dropped(e_N, dt, offset):
    """From 0.2 m, an impact at 0.2 s, a whole number of steps: largest error of the height until the next one."""
    scene = ball(pin.JointModelPZ())
    scene.add_contact("ball", "ground", e_N=e_N)
    run = nga.simulate(scene, np.array([RADIUS + 0.2 + offset]), t_end=0.36, dt=dt)
    t, hit = run.t, np.sqrt(2 * (0.2 + offset) / G)
    after = RADIUS + e_N * G * hit * (t - hit) - G / 2 * (t - hit) ** 2 * (e_N > 0.0)
    exact = np.where(t <= hit, RADIUS + 0.2 + offset - G / 2 * t**2, after)
    assert np.abs(run.q[:, 0] - exact).max() < 1e-12
    assert len(run.events) == 1


@pytest.mark.parametrize("offset", [0.0, 1e-16, -1e-16, 1e-13, -1e-13, 1e-11])
def test_slipping_impact_on_the_end_of_a_step_is_as_exact_as_within(offset):
    """3 m/s sideways, mu = 0.2: P_F = mu P_N slows the ball down at the impact, and sets it spinning."""

    def error(offset):
        scene, mu, e_N = ball(pin.JointModelFreeFlyer(), 0.1), 0.2, 0.8
        scene.add_contact("ball", "ground", mu=mu, e_N=e_N)
        q0, v0 = np.array([0.0, 0, RADIUS + 0.2 + offset, 0, 0, 0, 1]), np.array([3.0, 0, 0, 0, 0, 0])
        run = nga.simulate(scene, q0, v0, t_end=0.3, dt=1e-2)
        hit = np.sqrt(2 * (0.2 + offset) / G)
        return abs(run.q[-1, 0] - 3.0 * hit - (3.0 - mu * (1 + e_N) * G * hit) * (0.3 - hit))

    within = max(error(2e-3), error(5e-3))
    assert error(offset) < 1.3 * within


def cradle(n, gap, e_N):
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    for i in range(n):
        joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), f"ball_{i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(0.2, 0.03), pin.SE3.Identity())
    scene = nga.Scene(model)
    for i in range(n):
        scene.add_geometry(f"ball_{i}", coal.Sphere(0.03), parent=f"ball_{i}")
    for i in range(n - 1):
        scene.add_contact(f"ball_{i}", f"ball_{i + 1}", e_N=e_N)
    q0 = (0.06 + gap) * np.arange(n)
    return scene, q0


@pytest.mark.parametrize("dt", [1e-2, 2e-3])
def test_balls_that_touch_at_the_start_exchange_their_velocities(dt):
    scene, q0 = cradle(2, 0.0, 1.0)
    run = nga.simulate(scene, q0, np.array([1.0, 0.0]), t_end=0.1, dt=dt)
    assert run.q[-1] == pytest.approx([0.0, 0.16], abs=1e-12)
    assert run.events[0].t == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("dt", [1e-2, 2e-3])
def test_row_of_balls_hits_on_step_after_step(dt):
    """Gaps of 1 cm at 1 m/s, whole numbers of steps: the last one leaves when the others have been met."""
    scene, q0 = cradle(4, 0.01, 1.0)
    run = nga.simulate(scene, q0, np.array([1.0, 0, 0, 0]), t_end=0.06, dt=dt)
    assert run.q[-1] == pytest.approx(q0 + np.array([0.01, 0.01, 0.01, 0.03]), abs=1e-12)
    assert run.v[-1] == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-12)


@pytest.mark.parametrize("rtol", [None, 1e-8])
@pytest.mark.parametrize("e_N", [0.5, 1.0])
def test_start_in_contact_with_a_velocity_into_it(e_N, rtol):
    scene = ball(pin.JointModelPZ())
    scene.add_contact("ball", "ground", e_N=e_N)
    how = {"dt": 1e-2} if rtol is None else {"rtol": rtol}
    run = nga.simulate(scene, np.array([RADIUS]), np.array([-1.0]), t_end=0.05, **how)
    assert run.q[-1, 0] == pytest.approx(RADIUS + e_N * 0.05 - G / 2 * 0.05**2, abs=1e-7)
    assert [event.kind for event in run.events] == ["impact"]
