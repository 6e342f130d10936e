"""Moreau's scheme: of first order across impacts, exact where it must be, with the laws of impact."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import references, robots
from ngalpha_pin.integrators.moreau import MoreauJean


def error(dt):
    run = nga.simulate(*robots.load("rotating_ball", omega=50.0), t_end=1.0, dt=dt, method=MoreauJean())
    q, _ = references.rotating_ball(run.t, omega=50.0)
    return np.abs(run.q - q)[-1, :2].max()


def test_order():
    errors = np.array([np.mean([error(dt * s) for s in (0.93, 1.0, 1.07)]) for dt in (4e-3, 1e-3)])
    order = np.log(errors[0] / errors[1]) / np.log(4)
    assert 0.7 < order < 1.4


def test_free_flight_is_exact():
    run = nga.simulate(*robots.load("rotating_ball"), t_end=0.3, dt=1e-2, method=MoreauJean())
    assert run.q[-1, 1] == pytest.approx(1.0 - 0.5 * 9.81 * 0.3**2, abs=1e-13)


def test_restitution():
    run = nga.simulate(*robots.load("rotating_ball", omega=0.0, e_N=0.5), t_end=0.5, dt=1e-3, method=MoreauJean())
    hit = int(np.argmax(run.P_N[:, 0] > 0))
    assert run.v[hit, 1] == pytest.approx(-0.5 * run.v[hit - 1, 1], rel=2e-2)


def test_parameters_are_checked():
    with pytest.raises(nga.SceneError, match="theta"):
        MoreauJean(theta=1.5)


def test_sweeps_that_do_not_converge_are_an_error():
    method = MoreauJean(max_sweeps=1, tol=1e-15)
    with pytest.raises(nga.NotConverged, match="sweeps"):
        nga.simulate(*robots.load("ball_in_corner"), t_end=1.0, dt=1e-3, method=method)
