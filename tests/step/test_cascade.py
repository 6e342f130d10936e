"""The rungs of the cascade: which one solves what, and how long the first one is waited for."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import balls
from scipy.integrate import solve_ivp

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.step import cascade
from ngalpha_pin.system.state import SolvedBy


def rungs(run):
    return {SolvedBy(rung) for rung in run.audit().rungs}


def test_smooth_motion_is_newtons():
    run = nga.simulate(*robots.load("tippe_top"), t_end=0.05, dt=1e-3)
    assert rungs(run) <= {SolvedBy.NEWTON, SolvedBy.IMPACT}


@pytest.mark.parametrize("solver, rung", [("newton", SolvedBy.NEWTON), ("fixed_point", SolvedBy.FIXED_POINT)])
def test_one_solver_alone(solver, rung):
    method = nga.GeneralizedAlpha(solver=solver)
    run = nga.simulate(*robots.load("tippe_top"), t_end=0.02, dt=1e-3, method=method)
    assert rung in rungs(run) and rungs(run) <= {rung, SolvedBy.IMPACT}


def test_balls_in_a_row_at_rest_have_forces_of_minimum_norm():
    scene = balls(3, mu=0.5)
    q0 = np.array([0.0, 0.0, 0.1, 0.2, 0.0, 0.1, 0.4, 0.0, 0.1])
    run = nga.simulate(scene, q0, t_end=0.01, dt=1e-3)
    assert run.audit().success and np.abs(run.q - q0).max() < 1e-12


@pytest.mark.parametrize("many", [True, False])
def test_patience_of_the_first_rung(many, monkeypatch):
    """Among many contacts Newton's method is left after a few corrections: what has not converged by then goes in
    circles, and each correction costs as much as a round of what comes next. Of few contacts it has all of them."""
    asked, original = [], cascade.newton_within_efforts

    def seen(equations, evaluation, max_iter, *others):
        asked.append(max_iter)
        return original(equations, evaluation, max_iter, *others)

    monkeypatch.setattr(cascade, "newton_within_efforts", seen)
    monkeypatch.setattr("ngalpha_pin.integrators.native_attempt.plain_of", lambda system: None)  # has no rungs
    n, method = 12 if many else 4, nga.GeneralizedAlpha(max_iter=30)
    scene = balls(n, mu=0.5)
    q0 = np.array([[0.3 * i, 0.0, 0.1] for i in range(n)]).ravel()
    nga.simulate(scene, q0, t_end=2e-3, dt=1e-3, method=method)  # nothing slips: no smooth step is tried before
    # quadratic convergence takes three or four corrections once the index sets are found
    assert asked and (set(asked) == {30} if not many else 4 <= min(asked) and max(asked) <= 10)


CLEARANCE, LEVER, INERTIA = 1e-3, 0.5, 1e-3


def journal(tied):
    """A pendulum of 1 kg whose pin has 1 mm of play: in its hole, or on a link of that length without mass."""
    model = pin.Model()
    x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    z = model.addJoint(x, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    turn = model.addJoint(z, pin.JointModelRY(), pin.SE3.Identity(), "pendulum")
    centre = pin.Inertia(1.0, np.array([0.0, 0.0, -LEVER]), INERTIA * np.diag([1.0, 1.0, 1e-6]))
    model.appendBodyToJoint(turn, centre, pin.SE3.Identity())
    model.addJointFrame(turn)
    scene = nga.Scene(model)
    if tied:
        scene.add_constraint(nga.Distance("pendulum", "world", CLEARANCE))
        return scene
    upright = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))
    scene.add_geometry("hole", nga.Hollow(coal.Cylinder(0.01 + CLEARANCE, 0.1)), placement=upright)
    scene.add_geometry("pin", coal.Sphere(0.01), parent="pendulum")
    scene.add_contact("pin", "hole", mu=0.0)
    return scene


def of_two_links(t, y):
    """A pendulum on a link without mass."""
    a, b, da, db = y
    c, s, L, C, g = np.cos(a - b), np.sin(a - b), LEVER, CLEARANCE, 9.81
    M = np.array([[C * C, C * L * c], [C * L * c, INERTIA + L * L]])
    right = [-C * L * s * db**2 - g * C * np.sin(a), C * L * s * da**2 - g * L * np.sin(b)]
    return np.r_[da, db, np.linalg.solve(M, right)]


@pytest.mark.parametrize("dt, tol", [(1e-3, 1e-3), (1e-4, 1e-4)])
@pytest.mark.parametrize("tied", [False, True])
def test_pin_with_play_that_swings_faster_than_the_step(tied, dt, tol):
    """It swings with 1600 rad/s, which 1 ms does not resolve; corrections without derivatives of the normal miss."""
    run = nga.simulate(journal(tied), np.array([0.0, -CLEARANCE, 0.3]), t_end=0.02, dt=dt)
    assert SolvedBy.HALVED not in rungs(run)
    assert (SolvedBy.ALL_DERIVATIVES in rungs(run)) is (dt == 1e-3)
    right = solve_ivp(of_two_links, (0.0, 0.02), [0.0, 0.3, 0.0, 0.0], method="DOP853", rtol=1e-9, atol=1e-9).y[1, -1]
    energy = run.energy.total
    assert abs(run.q[-1, 2] - right) < tol and (energy - energy[0]).max() < 1e-9
    assert np.abs(np.hypot(*run.q[:, :2].T) - CLEARANCE).max() < 1e-12
