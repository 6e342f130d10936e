"""Limits of joints and own unilateral constraints among the rows of contacts.

A limit is g_N = sign (q - limit), without friction; an own constraint has the rows of its functions.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ngalpha_pin.contact.feature_rows import FeatureRows, StackedRows
from ngalpha_pin.contact.point_rows import KinematicRows, Motion, Rows
from ngalpha_pin.contact.table import Subset


class Own(Protocol):
    """The own unilateral constraints of a scene."""

    def gaps(self, which: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Gaps of some of them, shape (n,)."""

    def rows(self, which: np.ndarray, q: np.ndarray, motion: Motion) -> KinematicRows:
        """Rows of some of them: all gaps, then all slips."""


def other_gaps(sub: Subset, q: np.ndarray, own: Own | None) -> np.ndarray:
    """g_N of the limits and of the own constraints of a subset, shape (limits + own,) [m or rad]."""
    limits = sub.limit_sign * (q[sub.limit_q] - sub.limit_value)
    return limits if own is None or not len(sub.own) else np.concatenate((limits, own.gaps(sub.own, q)))


class LimitedRows:
    """Rows of a subset that has points, limits of joints and own constraints; attributes as those of `Rows`.

    The rows are the normals of the points, the limits, the own gaps, the friction rows of the points, the own slips.

    Args:
        sub: the contacts.
        points: rows of those that are points.
        q: configuration, shape (nq,).
        own: the own constraints of the scene, or None.
    """

    W: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray

    def __init__(self, sub: Subset, points: Rows | FeatureRows | StackedRows, q: np.ndarray, own: Own | None = None):
        self.sub, self.points = sub, points
        self._k, self._q, self._own = points.sub.k, q, own if len(sub.own) else None
        self.g_N = np.concatenate((points.g_N, other_gaps(sub, q, own)))

    def move(self, motion: Motion) -> LimitedRows:
        """Add the rows and their rates at a velocity and an acceleration."""
        sub, n, nv = self.sub, len(self.sub.limits), len(motion.v)
        W = np.zeros((n, nv))
        W[np.arange(n), sub.limit_dof] = sub.limit_sign
        if self._own is not None:
            self._own_rows = self._own.rows(sub.own, self._q, motion)
        if self._k:
            self.points.move(motion)
        self.W, self.rate, self.acceleration = (
            self._joined(name, limits)
            for name, limits in (("W", W), ("rate", W @ motion.v), ("acceleration", W @ motion.a))
        )
        return self

    @property
    def surface_rate(self) -> np.ndarray:
        """See `point_rows.Rows`."""
        points = self.points.surface_rate if self._k else np.zeros(0)
        of_own = np.zeros(len(self.sub.own) + self.sub.m - max(0, len(points) - self._k))
        return self._insert(points, np.zeros(len(self.sub.limits)), of_own)

    @property
    def sizes(self) -> tuple[float, float]:
        """Largest position and velocity that the rows subtract."""
        own = float(np.abs(self.sub.limit_value).max(initial=0.0)), float(np.abs(self.rate).max())
        c, c_dot = self.points.sizes if self._k else (0.0, 0.0)
        return max(own[0], c), max(own[1], c_dot)

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each shape (k + m, nv)."""
        nv = len(motion.v)
        nothing, zero = np.zeros((0, nv)), np.zeros((len(self.sub.limits), nv))
        of_points = self.points.derivatives(motion) if self._k else (nothing, nothing)
        of_own = (nothing, nothing) if self._own is None else self._own_rows.derivatives(motion)
        X, Y = (self._insert(*parts) for parts in zip(of_points, (zero, zero), of_own, strict=True))
        return X, Y

    def _joined(self, name: str, of_limits: np.ndarray) -> np.ndarray:
        of_points = getattr(self.points, name) if self._k else of_limits[:0]
        return self._insert(of_points, of_limits, of_limits[:0] if self._own is None else getattr(self._own_rows, name))

    def _insert(self, of_points: np.ndarray, of_limits: np.ndarray, of_own: np.ndarray) -> np.ndarray:
        k, n = self._k, len(self.sub.own)
        return np.concatenate((of_points[:k], of_limits, of_own[:n], of_points[k:], of_own[n:]))
