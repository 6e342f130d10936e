"""Of forces that are not unique, those nearest to given ones: they make the accelerations, and what cancels stays."""

import numpy as np
import pytest

from ngalpha_pin.numerics.nearest_forces import nearest_forces, spanned_forces

# four legs of a table: heave, roll and pitch; one combination of their forces cancels
LEGS = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [1.0, -1.0, 1.0]])
CANCELS = np.array([1.0, -1.0, 1.0, -1.0])
G = LEGS @ np.diag([0.5, 2.0, 3.0]) @ LEGS.T


def test_forces_that_do_not_cancel_have_the_rank_of_the_motion():
    basis = spanned_forces(G)
    assert basis.shape == (4, 3)
    assert CANCELS @ basis == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("cancelling", [0.0, 0.7, -3.0])
def test_what_cancels_stays(cancelling):
    wanted = LEGS @ np.array([2.0, 0.3, -0.2])
    found = nearest_forces(G, np.zeros((4, 4)), G @ wanted, cancelling * CANCELS)
    assert G @ found == pytest.approx(G @ wanted, rel=1e-12)
    assert found @ CANCELS / 4 == pytest.approx(cancelling, abs=1e-12)


def test_friction_that_is_tied_to_the_forces_takes_part():
    tied = np.random.default_rng(0).normal(size=(4, 4)) @ G * 0.05
    b = (G + tied) @ LEGS @ np.ones(3)
    found = nearest_forces(G, tied, b, np.zeros(4))
    basis = spanned_forces(G)
    assert basis.T @ ((G + tied) @ found - b) == pytest.approx(0.0, abs=1e-12)
