"""Loads that come and go within a step, while all rests: they end a phase as those at its ends do."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import ngalpha_pin as nga
from ngalpha_pin.event_driven.sign_dips import first_dip, first_end

M, G, AT, WIDTH = 1.0, 9.81, 1.0, 5e-3
TOLERANCES = pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])


def bell(t):
    """One at its top, five milliseconds wide, after a second of rest."""
    return float(np.exp(-0.5 * ((t - AT) / WIDTH) ** 2))


def way(acceleration, start, end):
    """From rest, with its velocity."""
    # the bell is narrow: where it ends is an end of a part
    parts = [start, *(t for t in (AT, AT + 8 * WIDTH) if start < t < end), end]
    both = [
        sum(quad(f, a, b, epsabs=1e-14, epsrel=1e-13)[0] for a, b in zip(parts[:-1], parts[1:], strict=True))
        for f in (lambda t: (end - t) * acceleration(t), acceleration)
    ]
    return both[0], both[1]


def point_on_plane(mu=0.8, **options):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(M, 0.05), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry("foot", coal.Sphere(0.05), parent="body")
    scene.add_plane("plane")
    scene.add_contact("foot", "plane", mu=mu, **options)
    return scene, np.array([0.0, 0.0, 0.05])


@TOLERANCES
def test_second_slip_under_a_force_that_swings(rtol):
    """12 sin(10 t) N on a body that friction holds up to 7.8 N: it slips, sticks for a while and slips back."""
    hold, w, force = 0.8 * M * G, 10.0, 12.0
    scene, q0 = point_on_plane()
    scene.add_force(nga.Wrench("body", force=lambda t: (force * np.sin(w * t), 0.0, 0.0)))
    run = nga.simulate(scene, q0, t_end=0.6, rtol=rtol)

    def from_rest(side, start, t):
        v = force / w * (np.cos(w * start) - np.cos(w * t)) - side * hold * (t - start)
        x = force / w * (np.cos(w * start) * (t - start) - (np.sin(w * t) - np.sin(w * start)) / w)
        return x - side * hold * (t - start) ** 2 / 2, v

    slip = np.arcsin(hold / force) / w
    stick = brentq(lambda t: from_rest(1, slip, t)[1], slip + 0.1, 0.4)
    back = (np.pi + np.arcsin(hold / force)) / w
    x = from_rest(1, slip, stick)[0] + from_rest(-1, back, 0.6)[0]
    assert abs(run.q[-1, 0] - x) <= 10 * rtol
    assert [event.kind for event in run.events] == ["slip", "stick", "slip"]
    assert [event.t for event in run.events] == pytest.approx([slip, stick, back], abs=10 * rtol)


@pytest.mark.parametrize("t_end", [1.05, 10.0])
@TOLERANCES
def test_short_pull_lifts_a_body_at_rest(rtol, t_end):
    top = 50.0
    scene, q0 = point_on_plane(e_N=0.0)
    scene.add_force(nga.Wrench("body", force=lambda t: (0.0, 0.0, top * bell(t))))
    run = nga.simulate(scene, q0, t_end=t_end, rtol=rtol, t_eval=[0.9, 1.05] if t_end == 1.05 else [0.9, 1.05, t_end])
    lifts = AT - WIDTH * np.sqrt(2 * np.log(top / (M * G)))
    height, _ = way(lambda t: top * bell(t) / M - G, lifts, 1.05)
    assert run.q[1:3, 2] - 0.05 == pytest.approx([0.0, height], abs=10 * rtol)
    assert [event.kind for event in run.events][:1] == ["lift-off"]
    assert run.events[0].t == pytest.approx(lifts, abs=1e-6)
    if t_end > 1.05:
        assert run.q[-1, 2] == pytest.approx(0.05, abs=1e-12)
        assert len(run.events) == 2


@TOLERANCES
def test_joint_with_dry_friction_pushed_over_its_limit_for_a_moment(rtol):
    top, holds = 20.0, 5.0
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.appendBodyToJoint(j, pin.Inertia(M, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = np.array([-holds]), np.array([holds])
    scene = nga.Scene(model)
    scene.add_force(nga.Control(lambda t, q, v: np.array([top * bell(t)])))
    run = nga.simulate(scene, np.zeros(1), t_end=3.0, rtol=rtol)
    starts = AT - WIDTH * np.sqrt(2 * np.log(top / holds))

    def acceleration(t):
        return (top * bell(t) - holds) / M

    ends = brentq(lambda t: way(acceleration, starts, t)[1], AT + WIDTH, 2.0, xtol=1e-14)
    assert run.q[-1, 0] == pytest.approx(way(acceleration, starts, ends)[0], abs=10 * rtol)
    assert run.v[-1, 0] == 0.0


@TOLERANCES
def test_belt_that_jerks_leaves_what_rests_on_it(rtol):
    """Friction cannot follow the jerk: forward with mu g until the speeds are equal, and back with mu g to rest."""
    mu, top = 0.5, 0.1
    scene, q0 = point_on_plane(
        mu=mu, surface_velocity=nga.SurfaceVelocity(linear=(1.0, 0.0, 0.0), speed=lambda t: top * bell(t))
    )
    run = nga.simulate(scene, q0, t_end=3.0, rtol=rtol)

    def jerk(t):
        return -top * (t - AT) / WIDTH**2 * bell(t)

    a = mu * G
    begins = brentq(lambda t: jerk(t) - a, AT - 8 * WIDTH, AT - WIDTH, xtol=1e-15)
    v_0, x_0 = top * bell(begins), quad(lambda t: top * bell(t), AT - 12 * WIDTH, begins, epsabs=1e-15)[0]
    meets = brentq(lambda t: v_0 + a * (t - begins) - top * bell(t), AT, AT + 5 * WIDTH, xtol=1e-15)
    v_1, T = v_0 + a * (meets - begins), meets - begins
    x_1 = x_0 + v_0 * T + a * T**2 / 2
    # it brakes with mu g while the belt falls faster, and sticks again where both are equal
    rests = brentq(lambda t: v_1 - a * (t - meets) - top * bell(t), meets + 1e-4, meets + 0.1, xtol=1e-15)
    x_2 = x_1 + v_1 * (rests - meets) - a * (rests - meets) ** 2 / 2
    x = x_2 + quad(lambda t: top * bell(t), rests, AT + 12 * WIDTH, epsabs=1e-15)[0]
    assert run.q[-1, 0] == pytest.approx(x, abs=10 * rtol)


def held_by(spring_force, holds, m, t_end):
    """Place of a joint of mass m with dry friction, on a spring to a mass that swings, by phases of its own."""

    def rate(side, t, y):
        pull = y[2] - y[0]
        return [y[1], (pull - side * holds) / m if side else 0.0, y[3], -pull]

    t, y, side = 0.0, np.array([0.0, 0.0, 0.0, spring_force]), 0
    while t < t_end:
        changes = (lambda t, y: y[1]) if side else (lambda t, y: abs(y[2] - y[0]) - holds)
        changes.terminal, changes.direction = True, -side if side else 1
        options = {"rtol": 1e-12, "atol": 1e-14, "max_step": 0.02, "events": changes}
        part = solve_ivp(lambda t, y, side=side: rate(side, t, y), (t, t_end), y, method="DOP853", **options)
        t, y = part.t[-1], part.y[:, -1]
        side = 0 if side else int(np.sign(y[2] - y[0]))
        y[1] = 0.0 if side == 0 else y[1]
    return y[0]


@pytest.mark.parametrize("rtol", [1e-4, 1e-5, 1e-6])
def test_motion_itself_pulls_over_the_limit_for_a_part_of_a_step(rtol):
    """A mass swings beside a joint and pulls it by a spring at most 4 % over its limit."""
    force, holds, m = 5.2, 5.0, 0.2
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    for name, mass in (("held", m), ("swings", 1.0)):
        j = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(j, pin.Inertia(mass, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = np.array([-holds, 0.0]), np.array([holds, 0.0])
    scene = nga.Scene(model)
    scene.add_force(nga.JointSpring({"held": -1.0, "swings": 1.0}, 1.0))
    run = nga.simulate(scene, np.zeros(2), np.array([0.0, force]), t_end=8.0, rtol=rtol)
    assert len(run.t) < 60
    assert run.q[-1, 0] == pytest.approx(held_by(force, holds, m, 8.0), abs=10 * rtol)


def test_what_does_not_change_with_time_costs_nothing():
    """Parabolas that stay positive are not looked at, nor what begins at zero or ends there."""

    def never(t):
        raise AssertionError("looked at")

    for function in (
        lambda t: np.array([1.0, 2.0 - t, 1.0 + (t - 0.5) ** 2, 5.0 - np.sin(3 * t)]),
        lambda t: np.array([t**3, t**2, (1.0 - t) ** 2]),
    ):
        points = [(t, function(t)) for t in (0.0, 0.12, 0.33, 0.6, 0.86, 1.0)]
        assert first_dip(never, points) is None


@pytest.mark.parametrize("where", [0.06, 0.2, 0.47, 0.7, 0.93])
@pytest.mark.parametrize(("bottom", "falls"), [(-1e-3, True), (1e-3, False)])
def test_dip_between_the_points_is_found(where, bottom, falls):
    def signs(t):
        return np.array([3.0, bottom + 4.0 * (t - where) ** 2 * (1.0 + 0.3 * t)])

    looks = []

    def at(t):
        looks.append(t)
        return signs(t)

    found = first_dip(at, [(t, signs(t)) for t in (0.0, 0.12, 0.33, 0.6, 0.86, 1.0)])
    assert (found is not None) == falls
    assert len(looks) <= 6
    if falls:
        assert found[1][1] <= 0.0
        assert found[0] == pytest.approx(where, abs=0.02)


@pytest.mark.parametrize("roots", [(0.3, 0.5, 0.9), (0.05, 0.4, 0.95), (0.55, 0.65, 0.7)])
def test_first_of_three_changes(roots):
    """One sign changes three times; another one falls between two points and comes back."""

    def signs(t):
        return np.array([-np.prod([t - root for root in roots]), 1.0 + t])

    def both(t):
        return np.array([signs(t)[0], (t - 0.2) ** 2 - 1e-4])

    points = (0.0, 0.12, 0.33, 0.6, 0.86, 1.0)
    assert first_end(signs, [(t, signs(t)) for t in points]) == pytest.approx(roots[0], abs=1e-12)
    assert first_end(both, [(t, both(t)) for t in points]) == pytest.approx(min(roots[0], 0.19), abs=1e-12)
