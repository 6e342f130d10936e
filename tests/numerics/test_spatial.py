"""Products of many vectors against numpy and Pinocchio, one at a time."""

import numpy as np
import pinocchio as pin

from ngalpha_pin.numerics.spatial import cross, dot, force_cross, motion_cross, skew, wrench

RNG = np.random.default_rng(0)
A, B, X, Y = RNG.normal(size=(5, 3)), RNG.normal(size=(5, 3)), RNG.normal(size=(5, 6)), RNG.normal(size=(5, 6))


def test_three_dimensions():
    np.testing.assert_allclose(cross(A, B), np.cross(A, B), atol=1e-15)
    np.testing.assert_allclose(dot(A, B), (A * B).sum(axis=1), atol=1e-15)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", skew(A), B), np.cross(A, B), atol=1e-15)


def test_six_dimensions():
    for x, y, motion, force in zip(X, Y, motion_cross(X, Y), force_cross(X, Y), strict=True):
        np.testing.assert_allclose(motion, pin.Motion(x).cross(pin.Motion(y)).vector, atol=1e-14)
        np.testing.assert_allclose(force, pin.Motion(x).cross(pin.Force(y)).vector, atol=1e-14)
    # the power of the dual product on y is that of the wrench on y cross x
    f = RNG.normal(size=(5, 6))
    np.testing.assert_allclose(dot(force_cross(X, f), Y), dot(f, motion_cross(Y, X)), atol=1e-13)


def test_wrench_of_a_force_at_a_point():
    for force, point, found in zip(A, B, wrench(A, B), strict=True):
        np.testing.assert_allclose(found, pin.SE3(np.eye(3), point).act(pin.Force(force, np.zeros(3))).vector)
