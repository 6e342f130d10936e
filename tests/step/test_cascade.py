"""The rungs of the cascade: which one solves what, and how long the first one is waited for."""

import numpy as np
import pytest
from contact_scenes import balls

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
    nga.simulate(scene, q0, np.tile([0.5, 0.0, 0.0], n), t_end=2e-3, dt=1e-3, method=method)
    # quadratic convergence takes three or four corrections once the index sets are found
    assert asked and (set(asked) == {30} if not many else 4 <= min(asked) and max(asked) <= 10)
