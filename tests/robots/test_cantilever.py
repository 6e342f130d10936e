"""The cantilever that is let go: its bent shape and its first eigenfrequency, in closed form."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.robots.hopper import EI, LENGTH, LINE_DENSITY


def test_small_deflection_and_energy():
    """F L^3 / (3 E I) at the tip; and what was stored comes back as motion without loss."""
    force = 1e-3
    scene, q0, v0 = robots.load("cantilever", force=force, gravity=0.0)
    tip = q0[-1]
    assert abs(tip) == pytest.approx(force * LENGTH**3 / (3 * EI), rel=1e-3)
    period = 2 * np.pi / (1.8751**2 * np.sqrt(EI / (LINE_DENSITY * LENGTH**4)))
    run = nga.simulate(scene, q0, v0, t_end=period / 2, dt=period / 400, method=nga.GeneralizedAlpha(rho_inf=1.0))
    # half a period later the first mode, which has nearly all of the energy, is on the other side
    assert run.q[-1, -1] == pytest.approx(-tip, rel=0.1)
    assert np.ptp(run.energy.total) < 1e-3 * run.energy.total[0]
