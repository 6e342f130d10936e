"""The verdict on energy: a rise that nothing feeds is found and its cause named, and the ground does no work."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.results.energy_balance import balance


def verdicts(run):
    return {row.name: row.ok for row in run.audit().rows()}


def spinning(omega):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.diag([0.01, 0.02, 0.03])), pin.SE3.Identity())
    model.gravity.linear = np.zeros(3)
    v0 = np.array([0.0, 0.0, 0.0, 0.7 * omega, 0.1 * omega, 0.7 * omega])
    return nga.simulate(nga.Scene(model), pin.neutral(model), v0, t_end=0.2, dt=1e-3)


def test_rotation_that_is_not_resolved_is_named():
    run = spinning(4000.0)
    assert run.energy.total.max() > 1.05 * run.energy.total[0]
    assert verdicts(run)["rise of energy"] is False
    assert "not resolved, omega dt" in run.audit().energy.cause
    resolved = spinning(4.0).audit()
    assert resolved.ok, str(resolved)


@pytest.mark.parametrize(("shape", "dt"), [(coal.Box(0.1, 0.1, 0.1), 1e-3), (coal.Capsule(0.05, 0.1), 1e-2)])
def test_the_only_step_of_a_run_is_judged_though_an_impact_is_in_it(shape, dt):
    """Two bodies fly at 1000 m/s and turn by several rad in the one step: its large forces are no unit of energy.

    The axes of the capsules have become parallel, so that nothing tells their normal.
    """
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    for name in "ab":
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.05), pin.SE3.Identity())
    scene = nga.Scene(model)
    for name in "ab":
        scene.add_geometry(f"box_{name}", shape, name)
    scene.add_contact("box_a", "box_b", e_N=1.0)
    q0 = np.array([-0.5, 0, 0, 0, 0, 0, 1.0, 0.5, 0.003, 0.002, 0, 0, 0, 1.0])
    run = nga.simulate(scene, q0, np.array([1e3, 0, 0, 0, 0, 0, -1e3, 0, 0, 0, 0, 0]), t_end=dt, dt=dt)
    assert abs(run.energy.total[1] / run.energy.total[0] - 1.0) > 0.05
    assert verdicts(run)["energy that no work explains"] is False
    assert "not resolved, omega dt" in str(run.audit())


def test_gain_of_newtons_law_at_an_impact_is_named():
    """Two rods land on rough ground; the change of energy is that of the laws (43)-(49), which add some."""
    angles, rates = np.array([-0.982539907659306, -0.5904168430379776]), np.array([0.9729142217136126, 1.4165522393565])
    rod, model = pin.Inertia(1.0, np.array([0.0, 0.0, -0.5]), np.diag([1 / 12, 1 / 12, 0.0])), pin.Model()
    upper = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "upper")
    down = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
    lower = model.addJoint(upper, pin.JointModelRY(), down, "lower")
    for joint in (upper, lower):
        model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_plane("ground", point=(0.0, 0.0, -np.cos(angles).sum() - 1e-9))
    scene.add_geometry("tip", coal.Sphere(0.0), parent="lower", placement=down)
    scene.add_contact("tip", "ground", mu=0.5, e_N=0.7)
    run = nga.simulate(scene, np.array([angles[0], angles[1] - angles[0]]), np.array([rates[0], rates[1] - rates[0]]),
                       t_end=2e-3, dt=1e-4)  # fmt: skip
    audit, laws = run.audit(), run.impact_laws
    assert verdicts(run)["energy that an impact adds"] is False
    assert "Newton's law of impact" in audit.energy.cause
    # the gain of the arrays is the one of the energies, and within what the laws allow
    assert laws.gain.sum() == pytest.approx(np.diff(run.energy.kinetic).max(), rel=0.05)
    assert (laws.gain <= laws.allowed + 1e-12).all() and laws.gain.max() > 0.0


def ball(n, radius):
    """A mesh of n points on a sphere."""
    k = np.arange(n) + 0.5
    up, around = np.arccos(1 - 2 * k / n), np.pi * (1 + 5**0.5) * k
    points = coal.StdVec_Vec3s()
    for p in radius * np.c_[np.cos(around) * np.sin(up), np.sin(around) * np.sin(up), np.cos(up)]:
        points.append(p)
    return coal.Convex.convexHull(points, True, "Qt")


def test_ground_does_no_work_on_a_mesh_foot_that_rolls():
    """The features of the foot change in most steps: each step has those that it was computed with."""
    radius, model = 0.03, pin.Model()
    trunk = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "trunk")
    hip = model.addJoint(trunk, pin.JointModelRY(), pin.SE3.Identity(), "hip")
    end = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.2]))
    knee = model.addJoint(hip, pin.JointModelRY(), end, "knee")
    for joint, mass, size in (
        (trunk, 4.0, (0.1, 0.1, 0.1)),
        (hip, 0.3, (0.02, 0.02, 0.2)),
        (knee, 0.2, (0.02, 0.02, 0.2)),
    ):
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(mass, *size), pin.SE3.Identity())
    scene = nga.Scene(model)
    below = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.05]))
    scene.add_geometry("ground", coal.Box(1.0, 1.0, 0.1), placement=below)
    scene.add_geometry("foot", ball(100, radius), parent="knee", placement=end)
    scene.add_contact("foot", "ground", mu=0.8)
    q0 = np.array([0.4 * np.cos(0.5) + radius + 1e-3, 0.5, -1.0])
    scene.add_force(nga.JointPD(q0, np.array([0.0, 20.0, 20.0]), np.array([0.0, 1.0, 1.0])))
    run = nga.simulate(scene, q0, t_end=0.2, dt=1e-3)
    account = balance(run)
    assert run.slot_ends[-1] > 0
    assert np.abs(account.normal).max() < 1e-3 * account.scale
    assert account.error < 5e-3
    assert run.audit().ok, str(run.audit())


def test_runs_of_sampled_times_are_not_accused_and_their_rise_is_judged():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "cube")
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(0.4, 0.1, 0.1, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("cube", coal.Box(0.1, 0.1, 0.1), parent="cube")
    scene.add_contact("cube", "ground", mu=0.2, e_N=0.3)
    q0 = np.concatenate(([0.0, 0.0, 0.15], pin.Quaternion(pin.exp3(np.array([0.4, 0.9, 0.2]))).coeffs()))
    v0 = np.array([0.5, 0.0, 0.0, 1.0, 3.0, 0.0])
    run = nga.simulate(scene, q0, v0, t_end=0.4, rtol=1e-4, t_eval=np.linspace(0.0, 0.4, 21))
    assert run.audit().ok, str(run.audit())
    assert verdicts(run)["rise of energy"] is True


def dropped(**contact):
    """A ball that falls on a table on a vertical joint."""
    model = pin.Model()
    table = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "table")
    model.appendBodyToJoint(table, pin.Inertia.FromBox(5.0, 1.0, 1.0, 0.1), pin.SE3.Identity())
    ball = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(ball, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry("top", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), parent="table")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="ball")
    scene.add_contact("ball", "top", **contact)
    q0 = pin.neutral(model)
    q0[3] = 0.2
    return scene, q0


@pytest.mark.parametrize("accuracy", [{"dt": 2e-3}, {"rtol": 1e-6}])
@pytest.mark.parametrize("drive", ["table", "belt"])
def test_what_a_drive_does_in_an_impact_is_no_gain_of_the_impact(drive, accuracy):
    """A table that comes up throws the ball higher than it fell from; a belt takes it along. Their drives do that."""
    moves = drive == "belt"
    scene, q0 = dropped(mu=0.4, e_N=0.8, surface_velocity=(2.0, 0.0, 0.0) if moves else None)
    v = 0.0 if moves else 1.0
    scene.add_constraint(nga.JointTrajectory("table", lambda t: (v * (t - 0.12), v, 0.0)))
    q0[0] = -0.12 * v
    run = nga.simulate(scene, q0, np.array([v, *np.zeros(6)]), t_end=0.25, **accuracy)
    assert len(run.impacts.t) == 1 and run.energy.total[-1] > run.energy.total[0] + 0.1
    assert run.audit().ok, str(run.audit())
    impacts = run.impacts._replace(v_after=run.impacts.v_after * 1.5)
    assert verdicts(replace(run, impacts=impacts))["energy that an impact adds"] is False


@pytest.mark.parametrize("dt", [4e-3, 2e-3, 1e-3, 5e-4])
def test_the_end_of_a_range_without_force_is_no_fault_of_a_run(dt):
    """A body falls onto a spring that has a range without force: where its rate jumps, steps are of the first order."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "up")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(2.0, 0.05), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_force(nga.JointSpring("up", 400.0, rest=(-1.0, 5.0)))
    run = nga.simulate(scene, np.array([-0.5]), t_end=1.5, dt=dt)
    assert run.audit().ok, str(run.audit())
    # what the falling body gains in its first 0.2 s is not explained by half of its velocity
    damaged = replace(run, v=np.where(run.t[:, None] < 0.2, 0.5 * run.v, run.v), kept=None)
    assert verdicts(damaged)["energy that no work explains"] is False
