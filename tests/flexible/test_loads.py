"""Loads on beams are checked where they are declared."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin.flexible.loads import LineLoad, PointLoad


@pytest.mark.parametrize("force", [(1.0, 2.0), (np.nan, 0.0, 0.0), 3.0])
def test_forces_are_finite_vectors(force):
    with pytest.raises(nga.SceneError, match="PointLoad at 'tip': force"):
        PointLoad("tip", force)
    with pytest.raises(nga.SceneError, match="LineLoad on 'beam': force"):
        LineLoad("beam", force)


def test_moments_are_finite():
    with pytest.raises(nga.SceneError, match="moment = inf: expected a finite number"):
        PointLoad("tip", moment=np.inf)
    assert PointLoad("tip", moment=2.0).force == (0.0, 0.0, 0.0)
