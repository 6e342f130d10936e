"""Cross products of many vectors at once, in three and in six dimensions (linear part first, as in Pinocchio)."""

from __future__ import annotations

import numpy as np

_EPS = np.zeros((3, 3, 3))
_EPS[0, 1, 2] = _EPS[1, 2, 0] = _EPS[2, 0, 1] = 1.0
_EPS[0, 2, 1] = _EPS[2, 1, 0] = _EPS[1, 0, 2] = -1.0


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Row-wise cross product of two arrays of shape (k, 3); `numpy.cross` takes several times as long."""
    return np.einsum("ijk,mj,mk->mi", _EPS, a, b)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Row-wise scalar product of two arrays of shape (k, n)."""
    return np.einsum("ij,ij->i", a, b)


def skew(x: np.ndarray) -> np.ndarray:
    """Matrices of the cross product with each row, shape (k, 3, 3)."""
    S = np.zeros((len(x), 3, 3))
    S[:, 2, 1], S[:, 0, 2], S[:, 1, 0] = x[:, 0], x[:, 1], x[:, 2]
    S[:, 1, 2], S[:, 2, 0], S[:, 0, 1] = -x[:, 0], -x[:, 1], -x[:, 2]
    return S


def motion_cross(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Row-wise cross product of spatial motions, shape (k, 6)."""
    return np.hstack((cross(x[:, 3:], y[:, :3]) + cross(x[:, :3], y[:, 3:]), cross(x[:, 3:], y[:, 3:])))


def force_cross(x: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Row-wise dual product of a spatial motion x and a wrench f: its power on y is that of f on y cross x."""
    return np.hstack((cross(x[:, 3:], f[:, :3]), cross(x[:, :3], f[:, :3]) + cross(x[:, 3:], f[:, 3:])))


def wrench(force: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The wrenches about the world origin of forces at points, shape (k, 6)."""
    return np.hstack((force, cross(point, force)))
