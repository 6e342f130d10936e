"""Moments of change within a step, against closed forms."""

import numpy as np
import pytest

from ngalpha_pin.event_driven.root_finding import first_change, first_closing, first_root


def test_first_root():
    assert first_root(np.cos, 1.0, 2.0) == pytest.approx(np.pi / 2, abs=1e-15)
    assert first_root(lambda s: s, 0.0, 1.0) == 0.0  # it vanishes at an end already
    assert first_root(lambda s: 1.0 + s, 0.0, 1.0) == 0.0  # no change of sign: the nearer end


def test_first_change_of_several():
    """The one that seems to be first by a straight line is not: 1 - t^8 falls late, 0.5 - t early."""

    def signs(t):
        return np.array([1.0 - t**8, 0.5 - t, t + 1.0])

    found = first_change(signs, (0.0, 1.5), (signs(0.0), signs(1.5)))
    assert found == pytest.approx(0.5, abs=1e-10)
    assert first_change(signs, (0.0, 0.4), (signs(0.0), signs(0.4))) == np.inf


def gaps(t):
    """A ball that falls, one that only comes near, one that grazes and comes back within the step."""
    return np.array([1.0 - t**2, 0.5 + (t - 1.0) ** 2, (t - 0.4) * (t - 0.6)])


def rates(t):
    return np.array([-2.0 * t, 2.0 * (t - 1.0), 2.0 * t - 1.0])


def test_first_closing():
    t, none = (0.0, 1.5), np.full(3, 1e-12)
    time, which = first_closing(t, (gaps(0.0), gaps(1.5)), (rates(0.0), rates(1.5)), gaps, none)
    assert (time, which) == (pytest.approx(0.4, abs=1e-13), 2)  # though it is open at both ends
    first = slice(0, 2)

    def two(s):
        return gaps(s)[first]

    ends = (two(0.0), two(1.5)), (rates(0.0)[first], rates(1.5)[first])
    assert first_closing(t, *ends, two, none[first]) == (pytest.approx(1.0, abs=1e-13), 0)
    ends = (two(0.0), two(0.9)), (rates(0.0)[first], rates(0.9)[first])
    assert first_closing((0.0, 0.9), *ends, two, none[first]) == (np.inf, -1)
