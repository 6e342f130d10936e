"""Runs of the oracle: closed forms of the paper, equations at any x, several solutions, what is refused."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest
from oracle_twin import Twin

import ngalpha_pin as nga
from ngalpha_pin import oracle, robots
from ngalpha_pin.oracle.impact import force_of
from ngalpha_pin.oracle.kinematics import Motion
from ngalpha_pin.oracle.laws import Sets
from ngalpha_pin.oracle.solvers import Scales, newton
from ngalpha_pin.oracle.steps import rescaled

LAWS = ("second-order", "paper")
FALL = np.sqrt(2 * 9.81 * 0.9)
"""Velocity with which the ball of 10.1 meets the plane [m/s]."""


@pytest.mark.parametrize(("omega", "friction"), [(50.0, -0.2 * FALL), (10.0, -2 / 7 * 0.1 * 10.0)])
def test_located_impact_has_the_percussions_of_the_paper(omega, friction):
    """Section 10.1: Lambda_N = m sqrt(2 g h), and Lambda_F = -mu Lambda_N where it slips, -2/7 m R omega where not."""
    scene, q0, v0 = robots.load("rotating_ball", omega=omega)
    run = oracle.simulate(scene, q0, v0, t_end=0.45, dt=1e-2)
    hit = int(np.argmax(run.La_N[:, 0]))
    # the steps up to there are exact, gravity is constant
    assert run.La_N[hit, 0] == pytest.approx(FALL, rel=1e-12)
    assert run.La_F[hit, 0] == pytest.approx(friction, rel=1e-12)


@pytest.mark.parametrize("laws", LAWS)
def test_gap_of_a_ball_that_rests_vanishes(laws):
    scene, q0, v0 = robots.load("rotating_ball", omega=10.0, height=0.12)
    run = oracle.simulate(scene, q0, v0, t_end=0.3, dt=1e-2, laws=laws)
    assert abs(run.q[-1, 1] - 0.1) <= 1e-15
    assert run.la_N[-1, 0] == pytest.approx(9.81, rel=1e-12)
    assert abs(run.v[-1] @ [1.0, 0.0, 0.1]) <= 1e-14  # it rolls (148)


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("name", ["ball_in_corner", "tippe_top", "hopper"])
def test_jacobian_is_the_derivative_of_the_residual(name, laws):
    """Against central differences in random directions, at a random x, on the index sets of that x."""
    twin, rng, dt = Twin(name), np.random.default_rng(0), 5e-5 if name == "hopper" else 1e-2
    p, v, a = twin.problem, 0.1 * rng.normal(size=twin.problem.nv), rng.normal(size=twin.problem.nv)
    N, F, la_g = np.zeros(p.n_N), np.zeros(p.n_F), np.zeros(len(p.rows))
    start = oracle.State(0.0, twin.q0, v, a, a, N + 1.0, N + 0.9, F + 0.1, F, la_g, dt, N, F, N, F)
    step = oracle.make_step(p, oracle.Parameters(), start, dt, np.ones(p.n_N, dtype=bool), laws)
    scale = Scales(step).x
    x = step.first + 0.3 * scale * rng.normal(size=len(scale))
    sets = oracle.contact_sets(step, oracle.end_of_step(step, x))
    J = oracle.jacobian(step, x, sets)
    for _ in range(3):
        dx = 1e-3 * scale * rng.normal(size=len(scale))
        change = (oracle.residual(step, x + dx, sets) - oracle.residual(step, x - dx, sets)) / 2
        assert (np.abs(J @ dx - change) <= 1e-4 * (np.abs(J) @ np.abs(dx)) + 1e-13).all()


def test_evaluation_is_a_function_of_its_arguments_alone():
    twin = Twin("tippe_top")
    run = oracle.simulate(twin.problem, twin.q0, twin.v0, t_end=3e-3, dt=1e-3)
    step = oracle.make_step(twin.problem, oracle.Parameters(), run.states[2], 1e-3, np.ones(2, dtype=bool), "paper")
    x, other = step.first, step.first + 1.0
    before = oracle.residual(step, x)
    oracle.jacobian(step, other)
    assert np.array_equal(oracle.residual(step, x), before)
    assert np.array_equal(x, step.first)


def test_catastrophe_has_the_same_solution_by_either_law(monkeypatch):
    """The Painleve rod at its singular time: its tip has carried, so that friction displaces as in (80) by both laws.

    From the start of the step Newton's method comes to it by none of them. From a percussion that has acted all the
    step long (kappa_hat_N >= dt P_N) it takes few corrections by the laws of second order.
    """
    # up to there and in that step the package goes the way of the oracle, see test_oracle_agreement
    monkeypatch.setattr("ngalpha_pin.integrators.division.ending_slips", lambda *args: None)
    twin, dt, parameters, every = Twin("painleve_rod"), 8e-3, oracle.Parameters(0.9), np.ones(1, dtype=bool)
    p, step = twin.problem, {"dt": dt, "method": nga.GeneralizedAlpha(0.9, tol=1e-13)}
    before = nga.simulate(twin.scene, twin.q0, twin.v0, t_end=101 * dt, **step).final_state
    run = nga.simulate(twin.scene, state=before, t_end=102 * dt, **step)
    start = rescaled(twin.state(before), dt)
    paper, second = (oracle.make_step(p, parameters, start, dt, every, laws) for laws in ("paper", "second-order"))
    assert not newton(second, second.first, 30).converged
    by_paper = newton(replace(paper, factors=np.zeros(1)), paper.first, 30)  # with r_F = 0 the rod sticks
    assert by_paper.converged
    assert np.abs(oracle.end_of_step(paper, by_paper.x).motion.v - run.v[1]).max() <= 1e-9
    x = by_paper.x.copy()
    x[second.split(np.arange(len(x))).kappa_N] += 1.2 * dt * run.P_N[1]
    by_second = newton(second, x, 30)
    assert by_second.converged
    found = oracle.end_of_step(second, by_second.x)
    assert np.abs(found.motion.v - run.v[1]).max() <= 1e-9
    ends = ((paper, oracle.end_of_step(paper, by_paper.x)), (second, found))
    sets = [oracle.contact_sets(step, end)[0] for step, end in ends]
    assert sets == [Sets(A=True, B=True, C=False, D_st=True, E_st=False)] * 2  # it sticks, and the plane lets go


def test_forces_of_dependent_directions_are_not_unique_but_their_resultants_are():
    """The ball that is caught in the corner: four percussions, three equations of motion."""
    twin, dt = Twin("ball_in_corner"), 1.5e-2
    ours, theirs = twin.run(100, dt, 0.5, "second-order")
    assert np.abs(ours.v - theirs.v).max() <= 1e-12
    assert np.abs(ours.q[:, :2] - theirs.q[:, :2]).max() <= 1e-12
    caught = int(np.argmax(np.abs(ours.P_N - theirs.P_N).max(axis=1) > 1e-9))
    assert 80 < caught and (theirs.g_N[caught:] <= 1e-12).all()
    assert np.abs(ours.q[:caught] - theirs.q[:caught]).max() <= 1e-12
    for i in range(caught, 101):
        motion = Motion(twin.problem, ours.t[i], ours.q[i], ours.v[i], ours.a[i])
        pairs = [
            force_of(motion, P_N, P_F)
            for P_N, P_F in ((ours.P_N[i], ours.P_F[i]), (theirs.P_N[i], theirs.P_F[i] * twin.signs))
        ]
        assert np.abs(pairs[0] - pairs[1]).max() <= 1e-12


def box_scene():
    scene, q0, v0 = robots.load("box_on_incline")
    return scene, q0, v0


def with_force():
    scene, q0, v0 = robots.load("rotating_ball")
    scene.add_force(nga.JointSpring("z", 1.0))
    return scene, q0, v0


def with_limits():
    scene, q0, v0 = robots.load("rotating_ball")
    scene.model.lowerPositionLimit[0] = -1.0
    return scene, q0, v0


def with_weld():
    scene, q0, v0 = robots.load("rotating_ball")
    scene.add_constraint(nga.Distance("world", "ball", 1.0))
    return scene, q0, v0


def with_ball():
    scene, q0, v0 = robots.load("rotating_ball")
    scene.add_geometry("other", coal.Sphere(0.1), placement=pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0])))
    scene.add_contact("ball_0", "other")
    return scene, q0, v0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (box_scene, "no contact such as"),
        (with_ball, "ball_0/other"),
        (with_force, "no forces"),
        (with_limits, "no joint limits"),
        (with_weld, "no constraint such as"),
    ],
)
def test_what_the_paper_has_not_is_refused_by_name(make, words):
    scene, q0, v0 = make()
    with pytest.raises(nga.SceneError, match=words):
        oracle.simulate(scene, q0, v0, t_end=0.1, dt=1e-2)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"q0": np.zeros(3)}, "q0 has shape"),
        ({"q0": None}, "q0 has shape"),
        ({"v0": np.full(3, np.nan)}, "v0 .* finite"),
        ({"laws": "first-order"}, "choose one of paper, second-order"),
        ({"dt": 0.0}, "positive number of seconds"),
        ({"rho_inf": 1.5}, "must be in"),
    ],
)
def test_bad_input_is_refused(change, words):
    scene, q0, v0 = robots.load("rotating_ball")
    given = {"q0": q0, "v0": v0, "t_end": 0.1, "dt": 1e-2} | change
    with pytest.raises(nga.SceneError, match=words):
        oracle.simulate(scene, **given)


def test_step_without_a_solution_says_where():
    scene, q0, v0 = robots.load("rotating_ball")
    p = oracle.problem_of(scene)
    with pytest.raises(nga.NotConverged, match="from t = 0 s"):
        oracle.simulate(p, q0, np.full(3, 1e200), t_end=0.1, dt=1e-2)
