"""The balance of energy: it closes to the order of the method, and every share is what mechanics says."""

import dataclasses

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.results.energy_balance import balance


def run(name, dt, t_end, method=None, **parameters):
    return nga.simulate(*robots.load(name, **parameters), t_end=t_end, dt=dt, method=method)


@pytest.mark.parametrize("laws", ["second-order", "paper"])
def test_ball_that_falls_slips_and_rolls_closes_to_rounding(laws):
    account = balance(run("rotating_ball", 5e-3, 1.5, nga.GeneralizedAlpha(laws=laws)))
    assert account.error < 1e-12
    # the impact takes the normal speed v and mu v of the slip, of which rolling has not come yet
    v, mu, spin = np.sqrt(2 * 9.81 * 0.9), 0.2, 50.0
    slip = 0.1 * spin
    taken = v**2 / 2 + mu * v * slip - (mu * v) ** 2 * (1 + 2.5) / 2
    assert account.impact[-1] == pytest.approx(-taken, rel=1e-9)
    # what slides on after that: the kinetic energy of the slip that is left, m_red s^2 / 2 with m_red = 2 m / 7
    left = slip - mu * v * (1 + 2.5)
    assert account.friction[-1] == pytest.approx(-(2 / 7) * left**2 / 2, rel=2e-3)
    assert np.abs(account.normal).max() < 1e-12
    assert not account.joints.any() and not account.controls.any()


def test_moreaus_scheme_has_no_impulsive_parts_and_closes_too():
    account = balance(run("rotating_ball", 5e-3, 1.0, nga.MoreauJean()))
    assert account.error < 1e-12
    assert not account.impact.any()


@pytest.mark.parametrize(
    ("name", "t_end", "sizes", "parameters"),
    [
        ("ball_in_cylinder", 0.6, (1e-2, 5e-3), {}),
        ("tippe_top", 0.1, (2e-3, 1e-3), {}),
        ("arm", 0.5, (4e-3, 2e-3), {"kp": 100.0, "kd": 5.0}),
    ],
)
def test_smooth_friction_and_damping_close_to_second_order(name, t_end, sizes, parameters):
    errors = [balance(run(name, dt, t_end, **parameters)).error for dt in sizes]
    assert errors[1] < errors[0] / 3.4
    assert errors[1] < 5e-3


def test_bounces_close_as_well_as_the_method_knows_their_time():
    bounces = {"omega": 0.0, "e_N": 0.5}
    located = balance(run("rotating_ball", 1e-2, 1.2, **bounces))
    assert located.error < 1e-10
    captured = nga.GeneralizedAlpha(laws="paper")
    errors = [balance(run("rotating_ball", dt, 1.2, captured, **bounces)).error for dt in (1e-2, 1e-3)]
    assert errors[1] < errors[0] / 3
    assert errors[0] < 2e-2


def test_dampers_take_and_controls_give():
    scene, q0, v0 = robots.load("arm", kp=50.0, kd=5.0)
    account = balance(nga.simulate(scene, q0, v0, t_end=0.5, dt=2e-3))
    assert account.joints[-1] < -0.1
    assert np.diff(account.joints).max() <= 0.0
    assert not account.controls.any()

    scene, q0, v0 = robots.load("arm")
    scene.joints = nga.JointLaws(limits=False)
    scene.add_force(nga.Control(lambda t, q, v: 0.5 * np.cos(t) * np.ones(7)))
    run = nga.simulate(scene, q0, v0, t_end=0.3, dt=2e-3)
    account = balance(run)
    power = 0.5 * np.cos(run.t) * run.v.sum(axis=1)
    assert account.controls[-1] == pytest.approx(np.trapezoid(power, run.t), rel=1e-12)
    assert account.controls[-1] > 0.01
    assert account.error < 1e-4
    assert not account.joints.any()


def test_dry_friction_and_damping_of_the_model_count_as_joints():
    scene, q0, v0 = robots.load("arm")
    scene.model.damping = np.full(7, 0.3)
    scene.model.lowerDryFrictionLimit, scene.model.upperDryFrictionLimit = np.full(7, -0.5), np.full(7, 0.5)
    account = balance(nga.simulate(scene, q0, v0, t_end=0.25, dt=1e-3))
    assert account.joints[-1] < -0.1
    assert account.error < 5e-3


def test_work_that_is_not_there_is_left_over():
    ball = run("rotating_ball", 5e-3, 0.3)
    kicked = dataclasses.replace(ball, v=ball.v + np.outer(ball.t > 0.15, [1.0, 0.0, 0.0]))
    account = balance(kicked)
    assert account.left_over[-1] == pytest.approx(0.5, rel=1e-9)


def everything():
    """A two-joint leg on a cart, with every law: impacts on a moving belt and at a limit, springs, a control."""
    model, lower, upper = pin.Model(), np.full(4, -1e308), np.full(4, 1e308)
    parts = (("cart", pin.JointModelPX(), 0.0, 1.0, 0.0), ("hip", pin.JointModelRY(), 0.6, 1.0, -0.2),
             ("knee", pin.JointModelRY(), -0.4, 0.5, -0.15))  # fmt: skip
    joint = 0
    for name, kind, height, mass, centre in parts:
        joint = model.addJoint(joint, kind, pin.SE3(np.eye(3), np.array([0.0, 0.0, height])), name)
        inertia = pin.Inertia(mass, np.array([0.0, 0.0, centre]), 0.01 * mass * np.eye(3))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    belt = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "belt")
    model.appendBodyToJoint(belt, pin.Inertia.FromBox(1.0, 1.0, 0.3, 0.02), pin.SE3.Identity())
    lower[2], upper[2] = -0.2, 1.2
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    model.damping, dry = np.array([0.3, 0.02, 0.01, 0.0]), np.array([0.2, 0.0, 0.05, 0.0])
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = -dry, dry
    scene = nga.Scene(model)
    scene.add_geometry("surface", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), parent="belt")
    foot = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.3]))
    scene.add_geometry("foot", coal.Sphere(0.03), parent="knee", placement=foot)
    scene.add_contact("foot", "surface", mu=0.4, e_N=0.3)
    scene.add_force(nga.JointSpring("cart", 20.0, rest=0.1))
    scene.add_force(nga.JointSpring("hip", 3.0, damping=0.05))
    scene.add_force(nga.Control(lambda t, q, v: np.array([np.sin(5 * t), 0.5 * np.cos(4 * t), 0.0, 0.0])))
    scene.add_constraint(nga.JointTrajectory("belt", lambda t: (0.2 * t, 0.2, 0.0)))
    return scene, np.array([0.0, 1.2, 0.4, 0.0]), np.array([0.0, 0.0, 0.0, 0.2])


def test_balance_of_a_scene_with_everything_closes_and_names_every_part():
    errors = []
    for dt in (4e-3, 1e-3):
        run = nga.simulate(*everything(), t_end=0.3, dt=dt)
        account = balance(run)
        errors.append(account.error)
    hit = set(event.contact for event in run.events if event.kind == "impact")
    assert hit == {"foot/surface", "knee upper limit"}
    # slip that ends and limits that close inside a step: first order
    assert errors[1] < errors[0] / 2.0 and errors[1] < 1e-3
    assert account.impact[-1] < -1.0
    assert np.abs(account.normal).max() < 1e-12
    # what dampers, dry friction, the belt and the control do, from the arrays of the run alone
    v, t = run.v, run.t
    damping = -np.trapezoid(v**2 @ [0.3, 0.02 + 0.05, 0.01, 0.0], t)
    dry = -np.trapezoid(np.abs(v) @ [0.2, 0.0, 0.05, 0.0], t)
    assert account.joints[-1] == pytest.approx(damping + dry, rel=0.02)
    driven = np.trapezoid(np.sin(5 * t) * v[:, 0] + 0.5 * np.cos(4 * t) * v[:, 1], t)
    pushed = 0.2 * run.P_F[:, 0].sum()  # the belt gives what friction takes from it; the friction direction is -x
    assert account.controls[-1] == pytest.approx(driven + pushed, rel=0.05)
    slid = account.friction[-1] + account.impact[-1] + account.joints[-1] + account.controls[-1]
    assert account.change[-1] == pytest.approx(slid, abs=2e-3 * account.scale)
    assert list(account.shares())[-1] == "left over"


def slider(stiffness):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slider")
    model.appendBodyToJoint(joint, pin.Inertia(2.0, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_force(nga.JointSpring("slider", stiffness, rest=0.1))
    return scene


def test_spring_and_weight():
    run = nga.simulate(slider(50.0), np.array([0.3]), np.array([0.4]), t_end=1e-2, dt=1e-3)
    found = run.energy
    assert found.conserved
    assert (found.kinetic[0], found.potential[0], found.elastic[0]) == pytest.approx(
        (0.5 * 2.0 * 0.4**2, 2.0 * 9.81 * 0.3, 0.5 * 50.0 * 0.2**2)
    )
    assert found.total == pytest.approx(found.kinetic + found.potential + found.elastic)
    assert np.ptp(found.total) < 1e-5


def test_controls_may_feed_energy_in():
    scene = slider(50.0)
    scene.add_force(nga.Control(lambda t, q, v: np.array([1.0])))
    assert not nga.simulate(scene, np.zeros(1), t_end=2e-3, dt=1e-3).energy.conserved


def test_ball_that_falls():
    run = nga.simulate(*robots.load("rotating_ball"), t_end=0.2, dt=1e-2)
    found = run.energy
    assert found.total == pytest.approx(found.total[0], rel=1e-12) and found.elastic == pytest.approx(0.0)


def test_what_stores_nothing_is_saved_without_a_pass_over_the_run(tmp_path):
    run = nga.simulate(*robots.load("rotating_ball"), t_end=0.05, dt=1e-3)
    run.save(tmp_path / "run.npz")
    assert "replay" not in vars(run)
    again = nga.Trajectory.load(tmp_path / "run.npz")
    for loaded, own in ((again.energy, run.energy), (again.constraint_motion, run.replay.constraints)):
        assert all(np.array_equal(x, y) for x, y in zip(loaded, own, strict=True))
