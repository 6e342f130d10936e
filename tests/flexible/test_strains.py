"""Strains of plane curves against closed forms and finite differences."""

import numpy as np
import pytest

from ngalpha_pin.flexible.strains import direction_gradients, strain_gradients, strains
from ngalpha_pin.numerics.finite_differences import first_derivative

RNG = np.random.default_rng(3)
T, C = RNG.normal(size=(6, 2)), RNG.normal(size=(6, 2))


def test_circle():
    """Of a circle of radius R, run through with the angle k xi, the length is k R and the turning k."""
    k, R, xi = 1.7, 0.4, np.linspace(0.0, 2.0, 9)
    t = k * R * np.column_stack((-np.sin(k * xi), np.cos(k * xi)))
    c = -(k**2) * R * np.column_stack((np.cos(k * xi), np.sin(k * xi)))
    np.testing.assert_allclose(strains(t, c), np.tile([k * R, k], (9, 1)), rtol=1e-14)


def test_a_turn_of_the_axes_changes_nothing():
    Q = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    np.testing.assert_allclose(strains(T @ Q.T, C @ Q.T), strains(T, C), rtol=1e-13)


def test_gradients():
    found, G = strain_gradients(T, C)
    np.testing.assert_allclose(found, strains(T, C), rtol=1e-14)
    for i, e in enumerate(np.eye(4)):

        def along(s, e=e):
            return strain_gradients(T + s * e[:2], C + s * e[2:])

        np.testing.assert_allclose(G[..., i], first_derivative(lambda s: along(s)[0], 1e-3), atol=1e-8)


def test_directions():
    angle, G, H = direction_gradients(T)
    assert angle == pytest.approx(np.arctan2(T[:, 1], T[:, 0]))
    for i, e in enumerate(np.eye(2)):

        def along(s, e=e):
            return direction_gradients(T + s * e)

        np.testing.assert_allclose(G[:, i], first_derivative(lambda s: along(s)[0], 1e-3), atol=1e-8)
        np.testing.assert_allclose(H[:, i], first_derivative(lambda s: along(s)[1], 1e-3), atol=1e-6)
