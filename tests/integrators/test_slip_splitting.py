"""Slip that ends or turns back within a step: closed forms, to the order of the method, and the work that it takes."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from work import work_of

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators import slip_splitting
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.integrators.slip_splitting import extrapolated_root, slips_that_may_end
from ngalpha_pin.system.state import SolvedBy
from ngalpha_pin.system.system import System

G, R = 9.81, 0.1


def on_ground(joint, inertia, shape, mu, slope=0.0):
    """A body on a plane; gravity is inclined, down along -x."""
    model = pin.Model()
    model.gravity.linear = G * np.array([-np.sin(slope), 0.0, -np.cos(slope)])
    j = model.addJoint(0, joint, pin.SE3.Identity(), "body")
    model.appendBodyToJoint(j, inertia, pin.SE3.Identity())
    model.addJointFrame(j)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("s", shape, "body")
    scene.add_contact("s", "ground", mu=mu)
    return scene


def block(mu, slope):
    return on_ground(
        pin.JointModelTranslation(), pin.Inertia(1.0, np.zeros(3), np.eye(3)), coal.Sphere(R), mu, np.radians(slope)
    )


def up_and_down(t, v0, mu, slope):
    """Way along a slope of a block that is thrown up it, and whether it stays above."""
    up, down = (G * (np.sin(slope) + s * mu * np.cos(slope)) for s in (1, -1))
    late = np.maximum(t - v0 / up, 0.0)
    t = np.minimum(t, v0 / up)
    return v0 * t - up * t**2 / 2 - max(down, 0.0) * late**2 / 2


def kinds(run):
    return [event.kind for event in run.events]


@pytest.mark.parametrize("dt", [2e-2, 7e-3, 1e-3])
@pytest.mark.parametrize(("slope", "event"), [(20.0, "slip"), (10.0, "stick")])
def test_block_thrown_up_a_slope(slope, event, dt):
    """All is quadratic in time: what is left is rounding, and what the last moment of the slip is not located to."""
    run = nga.simulate(block(0.3, slope), np.array([0, 0, R]), np.array([2.0, 0, 0]), t_end=0.6, dt=dt)
    assert run.q[:, 0] == pytest.approx(up_and_down(run.t, 2.0, 0.3, np.radians(slope)), abs=1e-11)
    assert kinds(run) == [event]
    assert run.audit().ok is True
    assert (run.solver_path == SolvedBy.SLIP.value).sum() == 1 and run.n_iter.max() <= 4


def test_box_that_stops_on_a_slope_sticks_in_both_modes():
    """Four corners stop at the same moment."""
    slope, mu = np.radians(15.0), 0.5
    side = np.full(3, 0.2)
    scene = on_ground(pin.JointModelFreeFlyer(), pin.Inertia.FromBox(1.0, *side), coal.Box(*side), mu, slope)
    q0, v0 = np.array([0, 0, 0.1, 0, 0, 0, 1.0]), np.array([-1.0, 0, 0, 0, 0, 0])
    brake = G * (mu * np.cos(slope) - np.sin(slope))
    for accuracy, tol in (({"dt": 1e-2}, 1e-10), ({"rtol": 1e-6}, 1e-6)):
        run = nga.simulate(scene, q0, v0, t_end=1.0, **accuracy)
        assert run.q[-1, 0] == pytest.approx(-1.0 / (2 * brake), abs=tol)
        assert set(kinds(run)) == {"stick"} and len(run.events) == 4
        assert [event.t for event in run.events] == pytest.approx(4 * [1.0 / brake], abs=1e-2)


def slope_of_errors(errors_of, steps):
    errors = [errors_of(dt) for dt in steps]
    return np.log(errors[0] / errors[-1]) / np.log(steps[0] / steps[-1])


@pytest.mark.parametrize("spin", [(0.0, 0.0, 0.0), (10.0, 6.0, 4.0)])
def test_ball_skids_until_it_rolls(spin):
    mu, v0 = 0.2, np.array([1.2, 0.9, 0.0])
    scene = on_ground(pin.JointModelFreeFlyer(), pin.Inertia.FromSphere(1.0, R), coal.Sphere(R), mu)
    slip = v0 + np.cross(spin, [0, 0, -R])
    rolls, force = 2 * np.linalg.norm(slip) / (7 * mu * G), -mu * G * slip / np.linalg.norm(slip)

    def error(dt):
        run = nga.simulate(scene, np.array([0, 0, R, 0, 0, 0, 1.0]), np.r_[v0, spin], t_end=0.5, dt=dt)
        t = np.minimum(run.t, rolls)[:, None]
        right = v0 * t + force * t**2 / 2 + (v0 + force * rolls) * (run.t[:, None] - t)
        assert kinds(run) == ["stick"]
        return np.abs(run.q[:, :2] - right[:, :2]).max()

    assert slope_of_errors(error, (1e-2, 2.5e-3)) > 1.9


def test_oscillator_with_dry_friction():
    """Half a swing after the other about +-f / k, each by 2 f / k smaller, until the spring is weaker."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    j = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = np.array([-0.5]), np.array([0.5])
    scene = nga.Scene(model)
    scene.add_force(nga.JointSpring("x", 4.0))
    swings, half = np.array([1.1, -0.85, 0.6, -0.35, 0.1]), np.pi / 2

    def right(t):
        i = min(int(t / half), 4)
        centre = 0.125 * (-1) ** i
        return swings[4] if i == 4 else centre + (swings[i] - centre) * np.cos(2.0 * (t - i * half))

    def error(dt):
        run = nga.simulate(scene, np.array([1.1]), t_end=7.0, dt=dt)
        assert (run.solver_path == SolvedBy.SLIP.value).sum() >= 3 and not run.v[-1].any()
        return np.abs(run.q[:, 0] - [right(t) for t in run.t]).max()

    assert slope_of_errors(error, (4e-2, 1e-2)) > 1.9


def test_brake():
    """A wheel that a torque of dry friction stops: 1 kg m^2, 3 rad/s, 2 N m, at t = 1.5 s after 2.25 rad."""
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "wheel")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = np.array([-2.0]), np.array([2.0])
    for dt in (7e-2, 7e-3):
        run = nga.simulate(nga.Scene(model), np.zeros(1), np.array([3.0]), t_end=2.1, dt=dt)
        assert run.q[-1, 0] == pytest.approx(2.25, abs=1e-10) and not run.v[-1].any()
        assert run.P_f.sum() == pytest.approx(-3.0, abs=1e-9)


@pytest.mark.parametrize("name", ["tippe_top", "rotating_ball", "solo12"])
def test_steps_without_an_end_of_slip_cost_nothing(name, monkeypatch):
    """Slip that goes on and feet that stick: forces are compared, nothing is computed."""
    options, before = ({"height": 0.0}, 100) if name == "solo12" else ({}, 0)
    scene, q0, v0 = robots.load(name, **options)
    system, method, calls = System(scene), nga.GeneralizedAlpha(), []
    state = initial_state(system, q0, v0)
    for _ in range(before):
        state = method.step(system, state, 1e-3).state
    monkeypatch.setattr(slip_splitting, "_speeds", lambda *given: calls.append(given))
    work = work_of(system, state, 1e-3, 100, method)
    assert SolvedBy.SLIP not in work.solved_by and not calls


def test_first_root_of_polynomials():
    times = np.array([0.0, 0.4, 0.7])
    functions = [lambda t: 1.0 - t, lambda t: 2.0 - t**2, lambda t: 1.0 + t]
    speeds, rates = np.array([[f(t) for f in functions] for t in times]), np.array([-1.0, 0.0, 1.0])
    for n in (1, 2, 3):
        assert extrapolated_root(times[:n], speeds[:n], rates) == pytest.approx(1.0, abs=1e-14)
    assert extrapolated_root(times[:2], speeds[:2, 1:], rates[1:]) == pytest.approx(np.sqrt(2.0), abs=1e-12)
    assert extrapolated_root(times, speeds[:, 2:], rates[2:]) == np.inf


def test_a_slip_that_turns_ends_at_its_moment_on_the_corners_of_a_box():
    """Its direction turns without end as it stops: no solver of last resort is asked, and the order is the second."""
    scene = nga.Scene()
    scene.add_body("body", coal.Box(0.2, 0.2, 0.05), mass=1.0)
    scene.add_plane("plane")
    scene.add_contact("body", "plane", mu=0.3)
    q0, v0 = scene.place_on("plane", scene.reference()), np.array([0.3, 0.0, 0.0, 0.0, 0.0, 1.5])
    runs = [nga.simulate(scene, q0, v0, t_end=0.12, dt=dt) for dt in (1e-2, 5e-3, 2.5e-3)]
    assert all("slip" in run.solver_path and run.n_iter.max() < 100 for run in runs)
    assert all(not run.v[-1].any() or np.abs(run.v[-1]).max() < 1e-12 for run in runs)
    turned = np.array([run.q[-1, 5] for run in runs])
    assert np.log2((turned[0] - turned[1]) / (turned[1] - turned[2])) > 1.8


@pytest.mark.parametrize(("steps", "soon"), [(0.5, True), (1.3, True), (1.7, False)])
def test_which_slips_may_end_in_a_step(steps, soon):
    """Speed and deceleration at the start say when: those that end a little behind the step are among them."""
    mu, dt = 0.3, 1e-3
    system, method = System(block(mu, 0.0)), nga.GeneralizedAlpha()
    state = initial_state(system, np.array([0.0, 0.0, R]), np.array([steps * dt * mu * G, 0.0, 0.0]))
    assert (slips_that_may_end(Piece(method.parameters, system, state, dt)) is not None) == soon
