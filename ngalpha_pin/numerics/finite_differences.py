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


def two_derivatives(
    function: Callable[[float], np.ndarray], h: float, room: tuple[float, float] = (-np.inf, np.inf)
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The function and its first two derivatives at s = 0, from seven values at multiples of h.

    Args:
        function: of s.
        h: distance of the values.
        room: interval around zero beyond which the function is another one; where it is too small for seven values on
            both sides they are shifted, or nearer to each other.
    """
    low, high = room
    if low > -3 * h or high < 3 * h:
        return _shifted_derivatives(function, min(h, (high - low) / 6), low, high)
    values = np.array([function(i * h) for i in OFFSETS])
    return values[3], np.tensordot(FIRST, values, 1) / h, np.tensordot(SECOND, values, 1) / (h * h)


def _shifted_derivatives(
    function: Callable[[float], np.ndarray], h: float, low: float, high: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `two_derivatives`, from values between two ends that are not on both sides of zero alike."""
    places = OFFSETS + min(max(0.0, low / h + 3.0), high / h - 3.0)
    values = np.array([function(float(place * h)) for place in places])
    powers = places ** np.arange(len(places))[:, None]
    first, second = np.linalg.solve(powers, np.eye(len(places))[:, 1:3] * (1.0, 2.0)).T
    return function(0.0), np.tensordot(first, values, 1) / h, np.tensordot(second, values, 1) / (h * h)
