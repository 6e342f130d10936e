"""Runs as functions of forces and parameters: forward and backward, against differences, in a fit."""

import warnings

import numpy as np
import pytest
from central_differences import EXACT
from contact_scenes import balls
from scipy.optimize import least_squares

import ngalpha_pin as nga
from ngalpha_pin.errors import SceneError

START = np.array([0.0, 0.0, 0.15])
FORWARD = np.array([0.8, 0.0, 0.0])


def pushed(n, seed=0):
    """A ball on the ground that is pushed about, slips and takes off."""
    u = np.random.default_rng(seed).normal(size=(n, 3)) * (4.0, 4.0, 6.0)
    return nga.Rollout(balls(1, mu=0.3, e_N=0.2), START, FORWARD, 5e-3, n, ["mu", "e_N", "mass[ball_0]"], EXACT), u


def test_backward_is_forward():
    roll, u = pushed(60)
    rng = np.random.default_rng(1)
    gq, gv = rng.normal(size=(2, 61, 3))
    gradient = roll.vjp(u, None, gq, gv)
    forward = roll.jac(u, None, of=("u", "p", "q0", "v0"))
    assert "impact" in roll.status
    expected = np.einsum("ti,tic->c", gq, forward.q) + np.einsum("ti,tic->c", gv, forward.v)
    found = np.concatenate((gradient.u.ravel(), gradient.p, gradient.q0, gradient.v0))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_forces_and_parameters_as_central_differences_say():
    roll, u = pushed(40)
    forward = roll.jac(u, None, of=("u", "p"))
    rng = np.random.default_rng(2)
    along = rng.normal(size=(2, len(forward.names)))
    for direction in along:
        du, dp = direction[:120].reshape(40, 3), direction[120:] * 0.1
        ends = [roll(u + s * 1e-6 * du, roll.values + s * 1e-6 * dp) for s in (1, -1)]
        both = np.concatenate((direction[:120], dp))
        for name in ("q", "v"):
            expected = (getattr(ends[0], name) - getattr(ends[1], name)) / 2e-6
            np.testing.assert_allclose(getattr(forward, name) @ both, expected, atol=2e-7 * np.abs(expected).max())


def test_maps_of_steps_are_the_derivatives_of_the_run():
    scene, q0, v0 = nga.robots.load("rotating_ball", omega=50.0, e_N=0.5, height=0.3)
    names = ["mu", "e_N"]
    roll = nga.Rollout(scene, q0, v0, 1e-2, 40, names)
    forward = roll.jac(of=("q0", "p"))
    run = nga.simulate(scene, q0, v0, t_end=0.4, dt=1e-2, sensitivities=nga.Sensitivities(q0=True, parameters=names))
    np.testing.assert_array_equal(roll().q, run.q)
    np.testing.assert_allclose(forward.q, run.derivatives.q, atol=1e-11)
    np.testing.assert_allclose(forward.v, run.derivatives.v, atol=1e-10)
    assert forward.names == run.derivatives.names


def test_parameters_are_identified_from_noisy_motion():
    truth = np.array([0.25, 0.6])
    roll = nga.Rollout(balls(1, mu=0.3, e_N=0.5), 2 * START, 3 * FORWARD, 1e-2, 40, ["mu", "e_N"])
    clean = roll(p=truth).q
    recorded = clean + 1e-3 * np.random.default_rng(0).normal(size=clean.shape)

    def residual(rolled):
        return (rolled.q - recorded).ravel()

    found = least_squares(lambda p: residual(roll(p=p)), [0.3, 0.5], jac=roll.jac_of(residual), x_scale=[0.1, 0.1])
    assert found.success and found.nfev <= 18
    J = roll.jac_of(residual)(found.x)
    deviation = 1e-3 * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    assert (np.abs(found.x - truth) <= 3.0 * deviation).all() and deviation.max() < 0.01
    # the Jacobian is that of the residual
    for i, e in enumerate(1e-6 * np.eye(2)):
        expected = (residual(roll(p=found.x + e)) - residual(roll(p=found.x - e))) / 2e-6
        np.testing.assert_allclose(J[:, i], expected, atol=1e-5 * np.abs(expected).max())


def test_a_fit_is_told_what_the_run_does_not_feel():
    resting = nga.Rollout(
        balls(1, mu=0.3), np.array([0.0, 0.0, 0.1]), np.zeros(3), 5e-3, 4, ["mu", "mass[ball_0]"], EXACT
    )
    push = np.full((4, 3), [0.1, 0.0, 0.0])
    with pytest.warns(UserWarning, match=r"does not depend on mu, so that a fit leaves it"):
        resting.jac_of(lambda rolled: rolled.q.ravel(), push)(resting.values)
    roll, u = pushed(60)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        roll.jac_of(lambda rolled: rolled.q.ravel(), u)(roll.values)


def test_the_last_run_is_kept():
    roll, u = pushed(10)
    first = roll(u)
    assert roll(u.copy()) is first
    assert roll(u, roll.values + 0.01) is not first


@pytest.mark.parametrize(
    ("given", "said"),
    (({"u": np.zeros((3, 3))}, "u"), ({"p": np.zeros(2)}, "p"), ({"u": np.full((10, 3), np.nan)}, "u")),
)
def test_wrong_input_is_named(given, said):
    roll, _ = pushed(10)
    with pytest.raises(SceneError, match=said):
        roll(**given)
    with pytest.raises(SceneError, match="of"):
        roll.jac(of=("x",))
