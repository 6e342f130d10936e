"""What a scene does not need is not computed: counted calls."""

import subprocess
import sys

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.contact.limit_rows import LimitedRows
from ngalpha_pin.contact.point_rows import Rows
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.system.system import System


def test_without_contact_no_contact_is_computed(count):
    scene, q0, v0 = robots.load("arm")
    scene.joints = nga.JointLaws(limits=False)
    places = [
        (Rows, "__init__"),
        (Rows, "move"),
        (kernel, "gaps"),
        (pin, "forwardKinematics"),
        (pin, "updateGeometryPlacements"),
    ]
    places += [(pin, "computeJointJacobiansTimeVariation"), (pin, "crba"), (pin, "computeAllTerms")]
    places += [(coal, name) for name in ("distance", "collide", "computeContactPatch")]
    calls = [count(owner, name) for owner, name in places]
    run = nga.simulate(scene, q0, v0, t_end=0.1, dt=1e-3)
    assert [len(c) for c in calls] == [0] * len(calls)
    assert run.contact_names == ()
    assert run.g_N.shape == run.P_N.shape == run.la_F.shape == (101, 0)


@pytest.mark.parametrize("name", ["arm", "rotating_ball", "tippe_top"])
def test_one_call_of_the_dynamics_for_each_evaluation(name, count):
    scene, q0, v0 = robots.load(name)
    simulator = nga.Simulator(scene, 1e-3)
    state = simulator.initial_state(q0, v0)
    state = simulator.step(state)
    calls = count(pin, "computeRNEADerivatives")
    steps, n_iter, plain = 50, 0, simulator.system.plain
    in_engine = plain.engine.evaluations if plain else 0
    for _ in range(steps):
        result = simulator.method.step(simulator.system, state, simulator.dt)
        state, n_iter = result.state, n_iter + result.n_iter
    if simulator.system.plain:
        in_engine = simulator.system.plain.engine.evaluations - in_engine
    # steps that turn out not to be plain are begun twice
    assert steps + n_iter <= len(calls) + in_engine <= steps + n_iter + 3


def test_nothing_else_of_pinocchios_dynamics_is_called(count):
    scene, q0, v0 = robots.load("tippe_top")
    simulator = nga.Simulator(scene, 1e-3)
    state = simulator.step(simulator.initial_state(q0, v0))
    names = ("crba", "rnea", "aba", "computeMinverse", "computeJointJacobians", "computeJointJacobiansTimeVariation")
    calls = [count(pin, name) for name in names]
    for _ in range(20):
        state = simulator.step(state)
    assert [len(c) for c in calls] == [0] * len(names)


def test_smooth_linear_scene_needs_no_newton_correction():
    scene, q0, v0 = robots.load("rotating_ball", height=2.0)
    ball = nga.simulate(scene, q0, v0, t_end=0.5, dt=1e-3)
    assert ball.g_N.min() > 0
    assert ball.n_iter.max() == 0
    # and at rest or rolling none either
    ball = nga.simulate(*robots.load("rotating_ball", height=0.1, omega=0.0), t_end=0.5, dt=1e-3)
    assert ball.n_iter.max() == 0


def test_open_contact_is_not_an_unknown():
    scene, q0, v0 = robots.load("rotating_ball", e_N=0.5)
    simulator = nga.Simulator(scene, 1e-3)
    state, unknowns = simulator.initial_state(q0, v0), []
    for _ in range(700):
        state = simulator.step(state)
        unknowns.append(len(state.contacts))
    assert not any(unknowns[:420])
    # between the bounces it is forgotten again
    assert sum(unknowns) < 30


def balls_in_the_air(n, height):
    return balls(n, mu=0.3), np.tile([0.0, 0.0, height], n)


def test_contacts_that_are_far_away_are_looked_at_now_and_then(count):
    scene, q0 = balls_in_the_air(50, 100.0)
    looks, gaps, moves = count(Rows, "__init__"), count(kernel, "gaps"), count(Rows, "move")
    run = nga.simulate(scene, q0, t_end=0.5, dt=1e-3)
    assert len(run.t) == 501
    assert 0 < len(looks) + len(gaps) < 25
    assert len(moves) == 0


def test_contacts_that_are_far_away_are_not_missed():
    scene, q0 = balls_in_the_air(5, 3.0)
    run = nga.simulate(scene, q0, np.tile([0.0, 0.0, -30.0], 5), t_end=0.2, dt=1e-3)
    assert run.audit().penetration < 1e-12
    assert (run.P_N > 0).any(axis=0).all()


def rows_of(scene):
    scene.joints = nga.JointLaws(limits=False)
    table = System(scene).contacts
    return table.n, table.n_F.tolist()


def test_no_friction_no_friction_rows():
    scene, q0, v0 = robots.load("rotating_ball", mu=0.0)
    assert rows_of(scene) == (1, [0])
    ball = nga.simulate(scene, q0, v0, t_end=0.6, dt=1e-3)
    assert ball.P_F.shape == (601, 0)
    # it spins on
    assert ball.v[-1, 2] == v0[2]
    scene = robots.load("quadruped", mu=0.0)[0]
    assert rows_of(scene) == (4, [0] * 4)


@pytest.mark.parametrize("name", ["rotating_ball", "ball_in_corner", "ball_in_cylinder", "painleve_rod"])
def test_planar_mechanism_has_one_friction_row_per_contact(name):
    n, n_F = rows_of(robots.load(name)[0])
    assert n_F == [1] * n


def test_body_in_space_has_two_and_with_drilling_three():
    assert rows_of(robots.load("quadruped")[0]) == (4, [2] * 4)
    assert rows_of(robots.load("tippe_top")[0]) == (2, [3, 3])
    assert rows_of(robots.load("tippe_top", contact_radius=0.0)[0]) == (2, [2, 2])


def test_ball_that_only_translates_does_not_drill():
    scene, _ = balls_in_the_air(1, 1.0)
    scene.contacts.clear()
    scene.add_contact("g0", "ground", mu=0.3, contact_radius=0.1)
    assert rows_of(scene) == (1, [2])


def test_package_imports_without_viewers(tmp_path):
    code = "import sys; sys.modules.update(meshcat=None, matplotlib=None); import ngalpha_pin, ngalpha_pin.robots"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path)


def solo12(limits, height, friction):
    """With dry friction in all of its joints [N m]."""
    scene, q0, v0 = robots.load("solo12", height=height)
    scene.model.upperDryFrictionLimit = np.repeat((0.0, friction), (6, 12))
    scene.model.lowerDryFrictionLimit = -scene.model.upperDryFrictionLimit
    scene.joints = nga.JointLaws(limits=limits)
    simulator = nga.Simulator(scene, 2e-3)
    return simulator, simulator.initial_state(q0, v0)


@pytest.mark.parametrize(("height", "friction", "unknowns"), [(0.0, 0.0, 14), (0.1, 0.02, 24)])
def test_limits_of_solo12_that_are_far_away_add_no_work(height, friction, unknowns, count):
    """The same unknowns, the same calls of Pinocchio, and the same motion to the bit; no row of a limit is computed."""
    pinocchio = ("computeRNEADerivatives", "integrate", "dIntegrate", "forwardKinematics")
    calls = [count(pin, name) for name in (*pinocchio, "computeJointJacobiansTimeVariation")]
    limited, works, states = count(LimitedRows, "move"), [], []
    for limits in (True, False):
        simulator, state = solo12(limits, height, friction)
        for c in calls:
            c.clear()
        looks, work = len(limited), []
        for _ in range(6):
            result = simulator.method.step(simulator.system, state, simulator.dt)
            state = result.state
            layout = simulator.system.layout(simulator.system.contacts.subset(state.contacts))
            work.append((layout.n, result.n_iter, result.solved_by))
        assert len(limited) == looks
        works.append((work, [len(c) for c in calls]))
        states.append(state)
    (work, calls_with), (expected, calls_without) = works
    assert work == expected
    assert calls_with[:3] == calls_without[:3]
    assert calls_with[3] <= calls_without[3]  # looks at all contacts
    assert (states[0].q == states[1].q).all()
    assert work[-1][0] >= unknowns
