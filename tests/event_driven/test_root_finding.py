"""Moments of change within a step, against closed forms."""

import numpy as np
import pytest

from ngalpha_pin.event_driven.root_finding import first_change, first_root


def test_first_root():
    assert first_root(np.cos, 1.0, 2.0) == pytest.approx(np.pi / 2, abs=1e-15)
    assert first_root(lambda s: s, 0.0, 1.0) == 0.0  # it vanishes at an end already
    assert first_root(lambda s: 1.0 + s, 0.0, 1.0) == 0.0  # no change of sign: the nearer end


def test_first_change_of_several():
    """The one that seems to be first by a straight line is not: 1 - t^8 falls late, 0.25 - t^2 early."""

    def signs(t):
        return np.array([1.0 - t**8, 0.25 - t**2, t + 1.0])

    found = first_change(signs, (0.0, 1.5), (signs(0.0), signs(1.5)))
    assert found == pytest.approx(0.5, abs=1e-13)
    assert first_change(signs, (0.0, 0.4), (signs(0.0), signs(0.4))) == np.inf
