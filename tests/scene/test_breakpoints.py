"""Moments at which something given jumps: declared, read from splines, looked for; runs that go across them."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator, UnivariateSpline, make_interp_spline

import ngalpha_pin as nga
from ngalpha_pin.numerics.finite_differences import two_derivatives
from ngalpha_pin.scene.breakpoints import found_breakpoints, knots

G = 9.81
KINKS = np.array([0.0, 0.1, 0.25, 0.5])
HEIGHTS = np.array([0.0, 0.0, 0.12, 0.12])
LINEAR = make_interp_spline(KINKS, HEIGHTS, k=1)
# the first kink is 1e-5 of a step before the end of one: what is left of it has 1e-7 s
SHORTLY_BEFORE = {"dt": 0.1 / (10 - 1e-5)}


def height(t):
    return float(np.clip(0.8 * (t - 0.1), 0.0, 0.12))


def with_derivatives(t):
    return height(t), 0.8 if 0.1 <= t < 0.25 else 0.0, 0.0


def ball_on_table(angle, **declared):
    """The table stands, rises with 0.8 m/s from 0.1 to 0.25 s, stands again; the ball (e = 0) flies off then."""
    model = pin.Model()
    for name, mass in (("table", 1.0), ("ball", 0.1)):
        j = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(j, pin.Inertia(mass, np.zeros(3), np.eye(3)), pin.SE3.Identity())
        model.addJointFrame(j)
    scene = nga.Scene(model)
    scene.add_geometry("t", coal.Halfspace(np.array([0, 0, 1.0]), 0.0), "table")
    scene.add_geometry("s", coal.Sphere(0.05), "ball")
    scene.add_contact("s", "t")
    scene.add_constraint(nga.JointTrajectory("table", angle, **declared))
    return scene


def error(scene, **options):
    run = nga.simulate(scene, np.array([0, 0.05]), np.zeros(2), t_end=0.35, **options)
    late = np.maximum(run.t - 0.25, 0.0)
    z = 0.05 + np.clip(0.8 * (run.t - 0.1), 0, 0.12) + np.maximum(0.8 * late - G * late**2 / 2, 0)
    # the table takes the ball along, and stops without it
    assert run.impacts.t == pytest.approx([0.1, 0.25], abs=1e-9)
    assert run.impacts.P_N[:, 0] == pytest.approx([0.08, 0.0], abs=1e-9)
    return np.abs(run.q[:, 1] - z).max()


@pytest.mark.parametrize("options", [{"rtol": 1e-6}, {"dt": 1e-3}, {"dt": 7e-3}, {"dt": 1e-2}, SHORTLY_BEFORE])
@pytest.mark.parametrize("angle", [height, with_derivatives, LINEAR])
def test_kinks_of_a_given_motion_are_met(angle, options):
    declared = {} if angle is LINEAR else {"breakpoints": (0.1, 0.25)}
    assert error(ball_on_table(angle, **declared), **options) < 1e-11


@pytest.mark.parametrize("angle", [height, with_derivatives])
def test_kinks_that_are_not_declared_are_found_with_rtol(angle):
    scene = ball_on_table(angle)
    assert error(scene, rtol=1e-6) < 1e-11
    assert not len(scene.constraints[0].breakpoints)  # the scene of the user stays as it is


@pytest.mark.parametrize(
    ("declared", "options"),
    [(False, {"rtol": 1e-6}), (True, {"rtol": 1e-6}), (True, {"dt": 1e-2}), (True, {"dt": 7e-3})],
)
@pytest.mark.parametrize("kind", ["wrench", "control", "gravity"])
def test_short_pulse_of_force(kind, declared, options):
    """500 N for 2 ms on 1 kg: 1 m/s."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    j = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(j)
    scene, times = nga.Scene(model), {"breakpoints": (3.0, 3.002)} if declared else {}

    def force(t):
        return 500.0 if 3.0 <= t < 3.002 else 0.0

    scene.add_force({
        "wrench": lambda: nga.Wrench("x", lambda t: (force(t), 0, 0), **times),
        "control": lambda: nga.Control(lambda t, q, v: np.array([force(t)]), **times),
        "gravity": lambda: nga.Gravity(lambda t: (force(t), 0, 0), **times),
    }[kind]())  # fmt: skip
    run = nga.simulate(scene, np.zeros(1), t_end=5.0, **options)
    assert run.v[-1, 0] == pytest.approx(1.0, abs=1e-9)
    assert run.q[-1, 0] == pytest.approx(500 * 0.002**2 / 2 + run.t[-1] - 3.002, abs=1e-8)


def test_stepping_by_hand_meets_them_as_well():
    scene = ball_on_table(height, breakpoints=(0.1, 0.25))
    simulator, run = nga.Simulator(scene, 7e-3), None
    run = nga.simulate(scene, np.array([0, 0.05]), np.zeros(2), t_end=0.35, dt=7e-3)
    state = simulator.initial_state(np.array([0, 0.05]), np.zeros(2))
    for q in run.q[1:]:
        state = simulator.step(state)
        assert np.array_equal(state.q, q)


@pytest.mark.parametrize("jump", ["0.1", "1e-06"])
def test_motion_that_jumps_is_refused(jump):
    scene = ball_on_table(lambda t: float(jump) * (t >= 0.2), breakpoints=(0.2,))
    for options in ({"rtol": 1e-6}, {"dt": 1e-3}):
        with pytest.raises(
            nga.SceneError, match=rf"JointTrajectory table: the given motion jumps by {jump} at t = 0\.2"
        ):
            nga.simulate(scene, np.array([0, 0.05]), np.zeros(2), t_end=0.35, **options)


@pytest.mark.parametrize("given", [(0.2, 0.1), (np.nan,), "soon", ((1.0, 2.0),)])
def test_breakpoints_that_cannot_be_used_are_refused(given):
    with pytest.raises(nga.SceneError, match="breakpoints"):
        nga.JointTrajectory("table", height, breakpoints=given)


def test_knots_of_splines_count_where_an_acceleration_jumps():
    assert knots(LINEAR) == pytest.approx([0.1, 0.25])
    assert knots(PchipInterpolator(KINKS, HEIGHTS)) == pytest.approx([0.1, 0.25])
    assert not len(knots(CubicSpline(KINKS, HEIGHTS)))
    assert not len(knots(make_interp_spline(KINKS, HEIGHTS, k=3)))


def test_spline_without_a_second_derivative_is_refused():
    scene = ball_on_table(UnivariateSpline(KINKS, HEIGHTS, k=1, s=0))
    with pytest.raises(nga.SceneError, match="no second derivative"):
        nga.simulate(scene, np.array([0, 0.05]), np.zeros(2), t_end=0.35, dt=1e-3)


@pytest.mark.parametrize(
    ("function", "right"),
    [
        (height, [0.1, 0.25]),
        (lambda t: float(t >= 1 / 3), [1 / 3]),
        (lambda t: abs(np.sin(7 * t)), np.arange(1, 12) * np.pi / 7),
        (lambda t: 1e4 * t + (t > np.pi), [np.pi]),
        (np.sin, []),
        (lambda t: np.sin(3000.0 * t), []),
        (lambda t: np.exp(-1e4 * (t - 2.0) ** 2), []),
        (lambda t: np.tanh(1e3 * (t - 1.0)), []),
        (lambda t: 3.0, []),
    ],
)
def test_jumps_and_kinks_of_a_function_are_found_and_nothing_else(function, right):
    found = found_breakpoints(lambda t: np.ravel(function(t)), 0.0, 5.0)
    assert found == pytest.approx(right, abs=1e-9)


@pytest.mark.parametrize("room", [(-np.inf, np.inf), (0.0, np.inf), (-1e-3, 5e-3), (-2e-3, 0.0), (-1e-3, 1e-3)])
def test_differences_stay_within_their_room(room):
    asked = []

    def function(s):
        asked.append(s)
        return np.array([np.exp(2.0 * s)])

    found = two_derivatives(function, 1e-3, room)
    assert np.ravel(found) == pytest.approx([1.0, 2.0, 4.0], abs=1e-6)
    assert min(asked) >= room[0] - 1e-15
    assert max(asked) <= room[1] + 1e-15
