"""Proximal point functions (25): idempotent, non-expansive, and the nearest points of their sets."""

import numpy as np
import pytest

from ngalpha_pin.numerics import prox

RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(200, 3)) * RNG.uniform(0.1, 10, size=(200, 1))


@pytest.mark.parametrize("radius", [0.0, 1e-300, 0.5, 3.0, np.inf])
def test_ball(radius):
    for p in POINTS:
        x = prox.prox_ball(p, radius)
        assert np.linalg.norm(x) <= radius * (1 + 1e-15)
        assert np.abs(prox.prox_ball(x, radius) - x).max() <= 1e-15 * np.abs(x).max()
        # points of the set stay
        if np.linalg.norm(p) <= radius:
            assert np.array_equal(x, p)
        # p - x is in the normal cone of the set at x: no other point is nearer
        others = POINTS / np.linalg.norm(POINTS, axis=1)[:, None] * min(radius, 1e3) * RNG.uniform(size=(200, 1))
        assert ((others - x) @ (p - x)).max() <= 1e-12 * max(1.0, min(radius, 1e3)) * np.linalg.norm(p)


def test_ball_does_not_expand():
    for p, q in zip(POINTS, POINTS[::-1], strict=True):
        x, y = prox.prox_ball(p, 1.0), prox.prox_ball(q, 1.0)
        assert np.linalg.norm(x - y) <= np.linalg.norm(p - q) * (1 + 1e-14)


def test_ball_of_no_radius_and_no_dimension():
    assert np.array_equal(prox.prox_ball(np.array([1.0, -2.0]), 0.0), [0.0, 0.0])
    assert prox.prox_ball(np.zeros(0), 1.0).shape == (0,)
    assert np.array_equal(prox.prox_ball(np.zeros(2), 0.0), [0.0, 0.0])


def test_ball_does_not_write_to_its_argument():
    p = np.array([3.0, 4.0])
    prox.prox_ball(p, 1.0)
    assert np.array_equal(p, [3.0, 4.0])
