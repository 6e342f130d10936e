"""Derivatives of whole runs of ready systems against central differences at two steps that agree with each other."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from box_scenes import at, box
from central_differences import EXACT, agreed, by_start, end, random_directions
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin.system.system import System

# system: length of the run and step; a straight change of q0 leaves round surfaces, so that those are given one of v0
RUNS = {
    "arm": (0.2, 5e-3),
    "cradle": (0.3, 2e-3),
    "ball_in_corner": (0.4, 5e-3),
}
LONG = {
    "painleve_rod": (0.1, 2e-3),
    "andrews": (0.01, 2e-4),
    "belt": (0.05, 2e-3),
    "bricard": (0.1, 2e-3),
    "governor": (0.1, 2e-3),
    "n_four_bar": (0.05, 1e-3),
    "rocking_block": (0.3, 2e-3),
    "rolling_disc": (0.1, 2e-3),
    "slider_crank": (0.05, 1e-3),
}
VELOCITIES = {
    "ball_in_cylinder": (0.5, 5e-3),
    "tippe_top": (0.05, 1e-3),
    "turntable": (0.1, 2e-3),
    "wheel_in_shell": (0.1, 2e-3),
}


def same_as_differences(name, t_end, dt, only_v=False, turn=None, **how):
    scene, q0, v0 = nga.robots.load(name)
    if turn is not None:
        way = np.zeros(scene.model.nv)
        way[3:6] = turn
        q0 = System(scene).integrate(q0, way)
    return compare(scene, q0, v0, only_v=only_v, t_end=t_end, dt=dt, **how)


def compare(scene, q0, v0, only_v=False, tolerance=1e-6, steps=(1e-5, 1e-6), **how):
    """A run along a direction of its start: its derivative is that of differences."""
    how["method"] = EXACT
    dq, dv = random_directions(scene, q0, v0, 1, only_v=only_v)
    run = nga.simulate(scene, q0, v0, sensitivities=nga.Sensitivities(q0=dq, v0=dv), **how)
    expected, allowed = agreed(lambda h: by_start(scene, q0, v0, dq, dv, h, **how), tolerance, steps)
    np.testing.assert_allclose(end(run)[:, :1] + end(run)[:, 1:], expected, rtol=0, atol=allowed)
    return run


@pytest.mark.parametrize("name", RUNS)
@pytest.mark.filterwarnings("ignore:(no derivative|a derivative among several)")
def test_ready_systems(name):
    t_end, dt = RUNS[name]
    same_as_differences(name, t_end, dt)


@pytest.mark.long
@pytest.mark.parametrize("name", LONG)
@pytest.mark.filterwarnings("ignore:(no derivative|a derivative among several)")
def test_more_ready_systems(name):
    t_end, dt = LONG[name]
    same_as_differences(name, t_end, dt)


@pytest.mark.long
@pytest.mark.parametrize("name", VELOCITIES)
def test_ready_systems_on_round_surfaces(name):
    t_end, dt = VELOCITIES[name]
    same_as_differences(name, t_end, dt, only_v=True)


@pytest.mark.long
def test_a_robot_lands_tilted():
    run = same_as_differences("quadruped", 0.3, 2e-3, turn=(0.05, 0.12, 0.03), steps=(1e-6, 5e-7))
    assert "impact" in run.derivatives.status


@pytest.mark.long
def test_a_robot_lands_on_the_edges_of_its_feet():
    pytest.importorskip("example_robot_data")
    turn = (0.05, 0.12, 0.03)
    run = same_as_differences("solo12", 0.13, 2e-3, turn=turn, tolerance=1e-5, steps=(1e-6, 5e-7))
    assert "impact" in run.derivatives.status


@pytest.mark.long
def test_a_box_lands_on_a_corner():
    scene = box(mu=0.4, e_N=0.3)
    q0 = pin.integrate(scene.model, at(0.0, 0.0, 0.4), np.array([0.0, 0.0, 0.0, 0.3, 0.5, 0.2]))
    run = compare(scene, q0, np.array([1.0, 0.2, -1.0, 0.5, 1.0, 2.0]), t_end=0.2, dt=2e-3)
    assert "impact" in run.derivatives.status


@pytest.mark.parametrize("limited", [True, False])
def test_dry_friction_of_joints_that_stop(limited):
    """With motors that are far from their limits of effort as without such limits: friction alone cycles."""
    scene, q0, v0 = nga.robots.load("arm")
    model = scene.model
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = -1.5 * np.ones(7), 1.5 * np.ones(7)
    if not limited:
        model.upperEffortLimit = np.full(7, np.inf)
    run = compare(scene, q0, v0 + (1.0, 0.6, 0.8, 0.4, 0.5, 0.3, 0.2), t_end=0.05, dt=5e-3)
    assert "switch" in run.derivatives.status


def test_friction_that_falls_with_the_speed_of_slip():
    scene = balls(1, mu=nga.Stribeck(0.2, 0.4, 0.3), e_N=0.3)
    run = compare(scene, np.array([0.0, 0.0, 0.3]), np.array([2.0, 0.3, 0.0]), t_end=0.3, dt=1e-2)
    assert "impact" in run.derivatives.status


def test_an_impact_on_a_table_that_is_driven():
    """Its moment moves, and with it where the table is."""
    model = pin.Model()
    for name, joint in (("table", pin.JointModelPZ()), ("ball", pin.JointModelTranslation())):
        j = model.addJoint(0, joint, pin.SE3.Identity(), name)
        model.appendBodyToJoint(j, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        model.addJointFrame(j)
    scene = nga.Scene(model)
    scene.add_geometry("top", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), parent="table")
    scene.add_geometry("b", coal.Sphere(0.1), parent="ball")
    scene.add_contact("b", "top", mu=0.3, e_N=0.6)
    w = 12.0
    scene.add_constraint(
        nga.JointTrajectory(
            "table", lambda t: (0.05 * np.sin(w * t), 0.05 * w * np.cos(w * t), -0.05 * w * w * np.sin(w * t))
        )
    )
    run = compare(scene, np.array([0.0, 0.0, 0.0, 0.4]), np.array([0.6, 1.0, 0.2, 0.0]), t_end=0.3, dt=1e-2)
    assert "impact" in run.derivatives.status


def test_a_control_with_its_derivatives():
    scene = balls(1, mu=0.3, e_N=0.5)

    def law(t, q, v):
        return np.array([np.sin(20 * t) - 0.5 * v[0] ** 3, 0.0, 0.3 * np.cos(t * 30) - q[2]])

    scene.add_force(nga.Control(law, derivatives=True))
    compare(scene, np.array([0.0, 0.0, 0.3]), np.array([0.5, 0.3, 0.0]), t_end=0.3, dt=1e-2)
