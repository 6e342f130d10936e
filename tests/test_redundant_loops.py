"""Loops whose constraints are dependent, always (Bricard) or in single positions (N-four-bar), and very stiff ones."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from test_mechanisms import assert_no_drift

import ngalpha_pin as nga
from ngalpha_pin import robots


def bricard_angles(x):
    """Joint angles and their derivatives by x, the angle of the even-numbered joints P0, P2, P4; 0 is the cube."""
    y = np.arcsin(np.sin(x) / (1 + np.sin(x)))
    dy = np.cos(x) / (1 + np.sin(x)) ** 2 / np.cos(y)
    return np.array([x, -y, x, -y, x]), np.array([1.0, -dy, 1.0, -dy, 1.0])


def bricard_period(model):
    """From the energy of the mechanism with one coordinate: it starts at rest and comes back."""
    data = model.createData()

    def fallen(x):
        return pin.computePotentialEnergy(model, data, np.zeros(5)) - pin.computePotentialEnergy(
            model, data, bricard_angles(x)[0]
        )

    def speed(x):
        q, rate = bricard_angles(x)
        return np.sqrt(fallen(x) / pin.computeKineticEnergy(model, data, q, rate))

    end = brentq(fallen, 2.0, 3.6, xtol=1e-14)
    # x = end / 2 (1 - cos s) takes the singularities at both ends away
    half, _ = quad(lambda s: end / 2 * np.sin(s) / speed(end / 2 * (1 - np.cos(s))), 0, np.pi, epsabs=1e-9)
    return 2 * half


def test_bricard_mechanism_keeps_its_period_and_its_shape():
    scene, q0, v0 = robots.load("bricard")
    run = nga.simulate(scene, q0, v0, t_end=10.0, dt=1e-2, method=nga.GeneralizedAlpha(rho_inf=0.9))
    assert_no_drift(run)
    assert np.abs(run.constraint_motion.g).max() <= 1e-10
    # in the closed form all even joints turn alike, and so do the odd ones
    shape = np.array([bricard_angles(x)[0] for x in run.q[:, 0]])
    np.testing.assert_allclose(run.q, shape, atol=1e-9)
    # at rest again where the velocity goes from negative to positive
    back = np.flatnonzero((run.v[:-1, 0] < 0) & (run.v[1:, 0] >= 0))
    v = run.v[:, 0]
    times = run.t[back] - v[back] * run.dt / (v[back + 1] - v[back])
    period = bricard_period(scene.model)
    assert times / np.arange(1, len(times) + 1) == pytest.approx(period, rel=5e-5)
    audit = run.audit()
    assert audit.ok
    assert audit.rank == (4, 5)
    assert "independent constraint rows 4 of 5" in " ".join(str(audit).split())
    assert set(run.solver_path[1:]) == {"minimum-norm"}
