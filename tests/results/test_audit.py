"""The judge itself: a good run passes, and every law that is broken in its arrays is found."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.results.audit import FORCE
from ngalpha_pin.results.law_audit import judge_contacts

LINES = {
    "penetration": "largest penetration",
    "cone": "friction outside its cone",
    "sign": "contact that pulls",
    "open": "force at an open contact",
    "impact": "impact against its laws",
    "quaternion": "unit quaternions off by",
    "slip": "friction against the slip",
    "forces": "equations of motion",
    "impulses": "momentum over a step",
    "displacements": "displacement over a step",
    "balance": "energy that no work explains",
    "rise": "rise of energy",
    "gain": "energy that an impact adds",
    "end": "end",
    "finite": "all numbers are finite",
}


@pytest.fixture(scope="module")
def ball():
    scene, q0, v0 = robots.load("rotating_ball", e_N=0.5)
    return nga.simulate(scene, q0, v0, t_end=1.5, dt=2e-3)


@pytest.fixture(scope="module")
def top():
    scene, q0, v0 = robots.load("tippe_top")
    return nga.simulate(scene, q0, v0, t_end=0.05, dt=1e-3)


def verdicts(run):
    return {row.name: row.ok for row in run.audit().rows()}


def tampered(run, array, i, change):
    values = getattr(run, array).copy()
    values[i] = change(values[i])
    return replace(run, **{array: values})


def only(run, line):
    """The audit finds this line, and beside it at most that the motion does not follow from the forces."""
    wrong = {name for name, ok in verdicts(run).items() if ok is False}
    of_motion = {LINES[name] for name in ("forces", "impulses", "displacements", "slip", "balance", "rise")}
    return LINES[line] in wrong and wrong <= {LINES[line], *of_motion} and not run.audit().ok


def resting(run):
    """A step in which the first contact is closed for good."""
    return np.flatnonzero((run.g_N[:, 0] < 1e-12) & (run.la_N[:, 0] > 0))[-3]


def flying(run):
    return np.flatnonzero(run.g_N[1:, 0] > 1e-2)[0] + 1


@pytest.mark.parametrize("fixture", ["ball", "top"])
def test_good_run_is_ok(fixture, request):
    run = request.getfixturevalue(fixture)
    audit = run.audit()
    assert audit.ok, str(audit)
    assert all(row.ok is True or row.ok is None for row in audit.rows())
    assert type(audit.ok) is bool
    assert sum(row.ok is True for row in audit.rows()) == len(LINES)
    assert audit.energy_rise < 1e-6
    assert (audit.success, audit.n_steps, audit.n_iter_max) == (True, len(run.t) - 1, run.n_iter.max())
    assert sum(audit.rungs.values()) == audit.n_steps


def test_nothing_is_printed_without_a_minus(ball):
    """Every contact presses, so that the largest pull is the negative of zero."""
    assert not [line for line in str(ball.audit()).splitlines() if " -0 " in line]


def test_audit_does_not_depend_on_who_computed_the_run(ball, tmp_path):
    ball.save(tmp_path / "run.npz")
    assert str(nga.Trajectory.load(tmp_path / "run.npz").audit()) == str(ball.audit())


@pytest.mark.parametrize("array", ["la_N", "P_N"])
def test_contact_that_pulls_is_found(ball, array):
    # rolling, without friction
    assert only(tampered(ball, array, (resting(ball), 0), lambda x: -1e-3), "sign")
    assert verdicts(tampered(ball, array, (flying(ball), 0), lambda x: -1e-3))[LINES["sign"]] is False


@pytest.mark.parametrize("array", ["la_F", "P_F"])
def test_friction_outside_its_cone_is_found(ball, top, array):
    i = resting(ball)
    assert only(tampered(ball, array, (i, 0), lambda x: 0.2 * getattr(ball, array[0:-1] + "N")[i, 0] * 1.01), "cone")
    assert only(tampered(top, array, (resting(top), slice(0, 3)), lambda x: 1.01 * x), "cone")


@pytest.mark.parametrize("array", ["la_N", "P_N"])
def test_force_at_an_open_contact_is_found(ball, array):
    assert only(tampered(ball, array, (flying(ball), 0), lambda x: 1e-3), "open")


def test_friction_at_an_open_contact_is_found(ball):
    assert not tampered(ball, "la_F", (flying(ball), 0), lambda x: 1e-3).audit().ok


def test_penetration_is_found(ball, top):
    assert only(tampered(ball, "q", (resting(ball), 1), lambda z: z - 1e-6), "penetration")
    deep = tampered(top, "q", (resting(top), 2), lambda z: z - 1e-6).audit()
    assert deep.penetration == pytest.approx(1e-6, rel=1e-3)
    assert not deep.ok


def test_quaternion_that_is_not_a_unit_one_is_found(ball, top):
    assert verdicts(tampered(top, "q", (5, slice(3, 7)), lambda x: 1.000001 * x))[LINES["quaternion"]] is False
    assert only(tampered(ball, "q", (5, slice(2, 4)), lambda x: 1.000001 * x), "quaternion")


def test_run_that_ended_early_is_found(ball):
    assert only(replace(ball, success=False, message="stopped"), "end")


@pytest.mark.parametrize("array", ["q", "v", "la_N", "P_N", "la_F", "P_F"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_found(ball, array, value):
    run = tampered(ball, array, (resting(ball), 0), lambda x: value)
    with np.errstate(invalid="ignore"):
        assert not run.audit().ok


def test_energy_from_nowhere_is_found(ball):
    i = resting(ball)
    pushed = tampered(ball, "v", (slice(i, None), 0), lambda x: x + 3.0)
    assert pushed.audit().energy_rise > 0.01
    assert verdicts(pushed)[LINES["rise"]] is False
    assert verdicts(pushed)[LINES["balance"]] is False


def test_table_says_it_in_words(ball):
    text = str(ball.audit())
    assert "NOT OK" not in text
    assert all(line in text for line in LINES.values())
    assert all(row.ok is None or type(row.ok) is bool for row in ball.audit().rows())
    bad = str(tampered(ball, "la_N", (0, 0), lambda x: -1.0).audit())
    assert any(line.startswith("contact that pulls") and line.endswith("NOT OK") for line in bad.splitlines())


def test_audit_of_a_scene_without_contact():
    scene, q0, v0 = robots.load("arm")
    audit = nga.simulate(scene, q0, v0, t_end=0.05, dt=1e-3).audit()
    assert audit.ok
    assert audit.penetration == audit.cone_violation == audit.complementarity == 0.0


def test_force_that_can_feed_energy_in_is_named():
    scene, q0, v0 = robots.load("arm")
    scene.add_force(nga.Control(lambda t, q, v: np.ones(7)))
    audit = nga.simulate(scene, q0, v0, t_end=0.01, dt=1e-3).audit()
    assert audit.energy_rise is None
    assert "can feed energy in" in str(audit)


def test_two_impacts_in_one_step_keep_the_momentum():
    """A dumbbell that falls nearly flat turns fast from the impact of one end to that of the other, 20 us later."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "rod")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.diag([0.002, 0.02, 0.021])), pin.SE3.Identity())
    scene = nga.Scene(model)
    for name, x in (("left", -0.2), ("right", 0.2)):
        placement = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        scene.add_geometry(name, coal.Sphere(0.02), parent="rod", placement=placement)
    scene.add_plane("ground")
    scene.add_contact("*", "ground", mu=0.0)
    q0, tilt = scene.reference(), 1e-4
    q0[2:7] = 0.12, 0.0, np.sin(tilt / 2), 0.0, np.cos(tilt / 2)
    run = nga.simulate(scene, q0, np.array([0.5, 0.0, 0.0, 0.0, 0.0, 2.0]), t_end=0.16, dt=2e-3)
    (step,) = set(run.impacts.step.tolist())
    assert len(run.impacts.t) == 2 and np.diff(run.impacts.t)[0] < 3e-5
    assert run.audit().ok is True
    # and a velocity along which nothing has acted is found there, 1e-5 of the largest one
    v = run.v.copy()
    v[step:, 1] += 1e-5 * np.abs(v).max()
    assert replace(run, v=v).audit().impulses > 1.0


def test_whole_turns_of_a_wheel_in_a_step_are_not_taken_for_a_jump():
    scene, q0, v0 = robots.load("rotating_ball", omega=1e5)
    run = nga.simulate(scene, q0, v0, t_end=0.1, dt=2e-3)
    assert run.v[-1, 2] == pytest.approx(1e5, rel=1e-3) and run.audit().ok


def test_a_start_without_forces_that_agree_with_its_slip_is_not_judged_by_them():
    """Painleve's paradox at t = 0: no force agrees, and the first step has an impact without collision."""
    run = nga.simulate(*robots.load("painleve_rod", mu=2.5), t_end=0.01, dt=8e-4)
    assert run.P_N[1] > 0.0 and abs(run.la_F[0]) < 2.5 * run.la_N[0] and run.audit().ok


@pytest.mark.parametrize(("pull", "ok"), [(1e-15, True), (1e-6, False)])
def test_forces_of_rounding_are_none(pull, ok):
    """A box that nothing presses down slides along the ground; its contact forces are what rounding leaves."""
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("box", coal.Box(0.2, 0.2, 0.2), mass=1.3)
    scene.add_contact("box", "ground", mu=0.4)
    scene.model.gravity.linear = np.array([-0.7, 4.0, 0.0])
    run = nga.simulate(
        scene, scene.place_on("ground", scene.q_ref, root="box"), [0.3, 0.1, 0, 0, 0, 0.4], t_end=0.02, dt=2e-3
    )
    forces = run.la_N.copy()
    forces[5] -= pull
    assert (judge_contacts(replace(run, la_N=forces)).sign < FORCE) == ok
