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


def falling(force):
    """A free beam with a force of the scene beside the gravity of its model."""
    scene = nga.Scene()
    scene.add_force(force)
    scene.add_beam(nga.PlanarBeam(1.0, EA=1e5, EI=10.0, line_density=0.5, degree=3, elements=2), "beam")
    return scene


def test_another_gravity_acts_on_beams():
    """On the moon it falls by g t^2 / 2, and its energy stays."""
    scene = falling(nga.Gravity((0.0, 0.0, -1.6)))
    run = nga.simulate(scene, scene.q_ref, t_end=0.05, dt=5e-3)
    np.testing.assert_allclose(run.q[-1, 1::2], -1.6 * 0.05**2 / 2, rtol=1e-9)
    np.testing.assert_allclose(run.energy.total, run.energy.total[0], atol=1e-10)


def test_a_gravity_that_is_a_function_is_refused_beside_a_beam():
    scene = falling(nga.Gravity(lambda t: (0.0, 0.0, -t)))
    with pytest.raises(nga.SceneError, match="does not act on a PlanarBeam"):
        nga.simulate(scene, scene.q_ref, t_end=0.05, dt=5e-3)
