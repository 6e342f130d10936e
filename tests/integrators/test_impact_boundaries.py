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
@pytest.mark.parametrize("dt", [2e-2, 1e-2, 1e-3, pytest.param(1e-4, marks=pytest.mark.long)])
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


@pytest.mark.parametrize("dt", [2e-2, 1e-2, *(pytest.param(dt, marks=pytest.mark.long) for dt in (1e-3, 1e-4))])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_row_of_balls_hits_beside_the_ends_of_steps(e, dt):
    """Each of four balls hits the next one after 0.02 s of its motion, a whole number of steps for e = 1 and 0.5."""
    scene, q0 = cradle(4, 0.02, e)
    for offset in [*OFFSETS, np.spacing(0.02)][:: 2 if dt == 2e-2 else 1]:
        start = q0 + offset * np.array([0, 1, 2, 3])
        run = nga.simulate(scene, start, np.array([1.0, 0, 0, 0]), t_end=0.18, dt=dt)
        v, t, q = np.array([1.0, 0, 0, 0]), 0.0, start.copy()
        while True:  # from impact to impact
            gaps, rates = np.diff(q) - 0.06, np.diff(v)
            left = np.where(rates < -1e-14, np.maximum(gaps, 0.0) / -np.minimum(rates, -1e-14), np.inf)
            i = int(np.argmin(left))
            if t + left[i] > 0.18:
                break
            t, q = t + left[i], q + left[i] * v
            v[i : i + 2] = v[i : i + 2].mean() + 0.5 * e * (v[i] - v[i + 1]) * np.array([-1.0, 1.0])
        assert run.q[-1] == pytest.approx(q + (0.18 - t) * v, abs=1e-12), offset
        assert run.v[-1] == pytest.approx(v, abs=1e-12)


@pytest.mark.parametrize("rtol", [None, 1e-8])
@pytest.mark.parametrize("e_N", [0.5, 1.0])
def test_start_in_contact_with_a_velocity_into_it(e_N, rtol):
    scene = ball(pin.JointModelPZ())
    scene.add_contact("ball", "ground", e_N=e_N)
    how = {"dt": 1e-2} if rtol is None else {"rtol": rtol}
    run = nga.simulate(scene, np.array([RADIUS]), np.array([-1.0]), t_end=0.05, **how)
    assert run.q[-1, 0] == pytest.approx(RADIUS + e_N * 0.05 - G / 2 * 0.05**2, abs=1e-7)
    assert [event.kind for event in run.events] == ["impact"]


BESIDE = [0.0, 1e-16, -1e-16, np.spacing(0.3), 1e-13, -1e-13, 1e-11, -1e-9]
STEPS = [2e-2, *(pytest.param(dt, marks=pytest.mark.long) for dt in (5e-3, 1e-3, 1e-4))]


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("mu", [0.0, 0.2])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_superball_with_impacts_beside_the_end_of_a_step(e, mu, dt):
    """It falls from 0.2 m with slip, which friction turns back by e at the impact as far as its cone goes."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -G])
    x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    z = model.addJoint(x, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    joint = model.addJoint(z, pin.JointModelRY(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, RADIUS), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(RADIUS), parent="ball")
    scene.add_contact("ball", "ground", e_N=e, mu=mu, e_F=e)
    inertia = model.inertias[joint].inertia[1, 1]
    for offset in BESIDE[:: 2 if dt == 2e-2 else 1]:
        for slip in (0.8, 5.0):  # it sticks within the cone, and does not
            hit, spin = np.sqrt(2 * (0.2 + offset) / G), -2.0
            q0, v0 = np.array([0.0, RADIUS + 0.2 + offset, 0.0]), np.array([slip + RADIUS * spin, 0.0, spin])
            run = nga.simulate(scene, q0, v0, t_end=0.3, dt=dt)
            P = -min(mu * (1 + e) * G * hit, (1 + e) * slip / (1 + RADIUS**2 / inertia))
            v_x, omega = v0[0] + P, spin - RADIUS * P / inertia
            if e == 0.0 and slip == 5.0:  # it slips on where it lies
                v_x, omega = v_x - mu * G * (0.3 - hit), omega + RADIUS * mu * G * (0.3 - hit) / inertia
            after = 0.3 - hit
            fall = (e * G * hit * after - G / 2 * after**2) * (e > 0.0)
            assert run.v[-1, [0, 2]] == pytest.approx([v_x, omega], abs=1e-9)
            way = v_x * after + (mu * G / 2 * after**2 if e == 0.0 and slip == 5.0 else 0.0)
            assert run.q[-1, :2] == pytest.approx([v0[0] * hit + way, RADIUS + fall], abs=1e-10)


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("mu", [0.0, 0.2])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_ball_on_a_shaker_with_impacts_beside_the_end_of_a_step(e, mu, dt):
    """A plate shakes as A sin(w t); a ball meets it at 0.2 s, with 3 m/s sideways, and flies on as its law says."""
    A, w, slip = 0.02, 20.0, 3.0
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -G])
    plate = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "plate")
    model.appendBodyToJoint(plate, pin.Inertia.FromBox(5.0, 1.0, 1.0, 0.1), pin.SE3.Identity())
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, RADIUS), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry("plate", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), parent="plate")
    scene.add_geometry("ball", coal.Sphere(RADIUS), parent="ball")
    scene.add_contact("ball", "plate", e_N=e, mu=mu)
    scene.add_constraint(nga.JointTrajectory("plate", lambda t: A * np.sin(w * t)))
    hit = 0.2
    up, height = A * w * np.cos(w * hit), A * np.sin(w * hit)
    approach = G * hit + up
    for offset in BESIDE[:: 2 if dt == 2e-2 else 1]:  # of the time by offset / approach
        q0 = np.array([0.0, 0.0, 0.0, RADIUS + height + G / 2 * hit**2 + offset])
        run = nga.simulate(scene, q0, np.array([A * w, slip, 0.0, 0.0]), t_end=0.24, dt=dt)
        fly = run.t[-1] - hit
        z = RADIUS + height + (up + e * approach) * fly - G / 2 * fly**2
        x = slip * run.t[-1] - mu * (1 + e) * approach * fly
        order = 0.0
        if e == 0.0:  # it stays on the plate, whose acceleration changes its normal force
            now = w * run.t[-1]
            z = RADIUS + A * np.sin(now)
            x -= mu * (G / 2 * fly**2 + A * np.sin(now) - height - up * fly)
            order = 0.05 * dt**2
        assert run.q[-1, [1, 3]] == pytest.approx([x, z], abs=1e-9 + 10.0 * abs(offset) + order)
