"""Coefficients (72) of the method: second order, and the spectral radius that rho_inf asks for."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin.step.options import PAPER, SECOND_ORDER
from ngalpha_pin.step.parameters import Parameters


@pytest.mark.parametrize("rho_inf", [0.0, 0.3, 0.5, 0.9, 1.0])
def test_coefficients(rho_inf):
    method = nga.GeneralizedAlpha(rho_inf=rho_inf)
    alpha_f, alpha_m, gamma, beta = method.parameters.coefficients
    assert gamma == pytest.approx(0.5 + alpha_f - alpha_m)  # second order
    assert beta == pytest.approx(0.25 * (0.5 + gamma) ** 2)  # most damping of high frequencies
    # amplification matrix of q'' = -w^2 q for w dt -> infinity, with (1 - alpha_m) a_bar' + alpha_m a_bar =
    # (1 - alpha_f) a' + alpha_f a
    x = 1e9
    E = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [x * (1 - alpha_f), 0.0, 1 - alpha_m]])
    N = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1 - gamma], [-x * alpha_f, 0.0, -alpha_m]])
    radius = np.abs(np.linalg.eigvals(np.linalg.solve(E, N))).max()
    assert radius == pytest.approx(rho_inf, abs=2e-3)


def test_laws_and_rungs():
    numbers = dict(alpha_f=0.3, alpha_m=0.0, gamma=0.8, beta=0.4, tol=1e-10, max_iter=30, rho_inf=0.5)
    ours = Parameters(**numbers, paper=False, solver="auto")
    assert ours.coefficients == (0.3, 0.0, 0.8, 0.4) and ours.auto and ours.laws is SECOND_ORDER
    theirs = Parameters(**numbers, paper=True, solver="newton")
    assert not theirs.auto and theirs.laws is PAPER
