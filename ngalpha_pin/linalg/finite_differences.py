"""Derivatives of functions that come without them, by central differences of sixth order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

OFFSETS = np.arange(-3, 4)
FIRST = np.array([-1 / 60, 3 / 20, -3 / 4, 0.0, 3 / 4, -3 / 20, 1 / 60])
SECOND = np.array([1 / 90, -3 / 20, 3 / 2, -49 / 18, 3 / 2, -3 / 20, 1 / 90])


def first_derivative(function: Callable[[float], np.ndarray], h: float) -> np.ndarray:
    """D function / ds at s = 0, from six values at multiples of h."""
    return sum(w * function(i * h) for i, w in zip(OFFSETS, FIRST, strict=True) if i) / h


def two_derivatives(function: Callable[[float], np.ndarray], h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The function and its first two derivatives at s = 0, from seven values at multiples of h."""
    values = np.array([function(i * h) for i in OFFSETS])
    return values[3], np.tensordot(FIRST, values, 1) / h, np.tensordot(SECOND, values, 1) / (h * h)
