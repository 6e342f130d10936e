"""Sixth-order differences: exact for polynomials up to degree six, and of their order beyond."""

import numpy as np
import pytest

from ngalpha_pin.numerics.finite_differences import first_derivative, two_derivatives


def test_exact_for_polynomials():
    p = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 2.0, 0.7])

    def curve(s):
        return np.array([p(s), 2.0 * p(-s)])

    value, rate, second = two_derivatives(curve, 0.1)
    assert value == pytest.approx([1.0, 2.0])
    assert rate == pytest.approx([-2.0, 4.0], abs=1e-12)
    assert second == pytest.approx([1.0, 2.0], abs=1e-10)
    assert first_derivative(curve, 0.1) == pytest.approx(rate, abs=1e-13)


def test_order():
    errors = []
    for h in (0.2, 0.1):
        _, rate, second = two_derivatives(lambda s: np.array([np.sin(1.0 + s)]), h)
        errors.append((abs(rate[0] - np.cos(1.0)), abs(second[0] + np.sin(1.0))))
    ratios = np.array(errors[0]) / errors[1]
    assert (ratios > 55).all() and (ratios < 70).all()  # 2^6
