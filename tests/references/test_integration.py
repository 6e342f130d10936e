"""Event-driven integration to round-off."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ngalpha_pin.references.integration import PRECISE, ends_integration


def test_falls_to_the_ground_and_stops_there():
    def ground(t, y):
        return y[0]

    ends_integration(ground, -1)
    part = solve_ivp(lambda t, y: [y[1], -9.81], (0.0, 5.0), [1.0, 2.0], events=ground, **PRECISE)
    exact = (2.0 + np.sqrt(4.0 + 2 * 9.81)) / 9.81
    assert part.t[-1] == pytest.approx(exact, rel=1e-12) and len(part.t_events[0]) == 1
