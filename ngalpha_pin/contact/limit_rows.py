"""Limits of joints among the rows of contacts: g_N = sign (q - limit), without friction."""

from __future__ import annotations

import numpy as np

from ngalpha_pin.contact.feature_rows import FeatureRows, StackedRows
from ngalpha_pin.contact.point_rows import Motion, Rows
from ngalpha_pin.contact.table import Subset


def limit_gaps(sub: Subset, q: np.ndarray) -> np.ndarray:
    """g_N of the limits of a subset, shape (limits,) [m or rad]."""
    return sub.limit_sign * (q[sub.limit_q] - sub.limit_value)


class LimitedRows:
    """Rows of a subset that has points and limits of joints; attributes as those of `Rows`.

    The rows are the normals of the points, the limits, the friction rows of the points.

    Args:
        sub: the contacts.
        points: rows of those that are points.
        q: configuration, shape (nq,).
    """

    W: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray

    def __init__(self, sub: Subset, points: Rows | FeatureRows | StackedRows, q: np.ndarray):
        self.sub, self.points = sub, points
        self._k = points.sub.k
        self.g_N = np.concatenate((points.g_N, limit_gaps(sub, q)))

    def move(self, motion: Motion) -> LimitedRows:
        """Add the rows and their rates at a velocity and an acceleration."""
        sub, n, nv = self.sub, len(self.sub.limits), len(motion.v)
        W = np.zeros((n, nv))
        W[np.arange(n), sub.limit_dof] = sub.limit_sign
        if self._k == 0:
            self.W, self.rate, self.acceleration = W, W @ motion.v, W @ motion.a
            return self
        points = self.points.move(motion)
        self.W = self._insert(points.W, W)
        self.rate = self._insert(points.rate, W @ motion.v)
        self.acceleration = self._insert(points.acceleration, W @ motion.a)
        return self

    @property
    def surface_rate(self) -> np.ndarray:
        """See `point_rows.Rows`."""
        nothing = np.zeros(len(self.sub.limits))
        return nothing if self._k == 0 else self._insert(self.points.surface_rate, nothing)

    @property
    def sizes(self) -> tuple[float, float]:
        """Largest position and velocity that the rows subtract."""
        own = float(np.abs(self.sub.limit_value).max()), float(np.abs(self.rate).max())
        if self._k == 0:
            return own
        c, c_dot = self.points.sizes
        return max(own[0], c), max(own[1], c_dot)

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each shape (k + m, nv)."""
        zero = np.zeros((len(self.sub.limits), len(motion.v)))
        if self._k == 0:
            return zero, zero
        X, Y = self.points.derivatives(motion)
        return self._insert(X, zero), self._insert(Y, zero)

    def _insert(self, of_points: np.ndarray, of_limits: np.ndarray) -> np.ndarray:
        return np.concatenate((of_points[: self._k], of_limits, of_points[self._k :]))
