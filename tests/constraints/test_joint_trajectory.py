"""Joint coordinates that follow a function of time: the derivatives of what the user has, and the motion."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import ngalpha_pin as nga
from ngalpha_pin.constraints.joint_trajectory import derivatives_of

NO_BREAKS = np.zeros(0)


@pytest.mark.parametrize(
    "given, atol",
    [
        (lambda t: np.sin(3 * t), 1e-9),
        (lambda t: (np.sin(3 * t), 3 * np.cos(3 * t), -9 * np.sin(3 * t)), 1e-15),
        (lambda t: np.array([np.sin(3 * t)]), 1e-9),
    ],
)
def test_derivatives(given, atol):
    t = 0.4
    exact = [np.sin(3 * t), 3 * np.cos(3 * t), -9 * np.sin(3 * t)]
    assert derivatives_of(given, "crank", NO_BREAKS)(t) == pytest.approx(exact, abs=atol)


def test_a_spline_knows_its_derivatives():
    spline = CubicSpline([0.0, 0.5, 1.0], [0.0, 1.0, 0.2])
    assert derivatives_of(spline, "crank", NO_BREAKS)(0.3).tolist() == [spline(0.3), spline(0.3, 1), spline(0.3, 2)]


def test_other_shapes_are_refused():
    with pytest.raises(nga.SceneError, match="crank: .* not shape .2,"):
        derivatives_of(lambda t: (t, 1.0), "crank", NO_BREAKS)
