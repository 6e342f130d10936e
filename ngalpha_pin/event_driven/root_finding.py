"""Moments at which something changes within a step, by bracketing on its dense output."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

# what brentq can tell apart: its smallest relative tolerance
NARROWEST = 4 * np.finfo(float).eps
# part of a step to which the change of a force or of a slip is located: what it changes begins at zero there
LOCATED = 1e-14


def first_root(function: Callable[[float], float], low: float, high: float) -> float:
    """A root of a function that changes its sign between two times; the end at which it vanishes already [s]."""
    at_low, at_high = function(low), function(high)
    if at_low == 0.0 or at_low * at_high > 0.0:
        return low if abs(at_low) <= abs(at_high) else high
    return float(brentq(function, low, high, xtol=NARROWEST * max(abs(high), high - low), rtol=NARROWEST))


def first_change(
    signs_at: Callable[[float], np.ndarray], t: tuple[float, float], signs: tuple[np.ndarray, np.ndarray]
) -> float:
    """The first time at which one of several functions that are positive at the start is no more, or infinity [s].

    Args:
        signs_at: the functions at a time within the step, shape (s,).
        t: beginning and end of the step [s].
        signs: the functions at both.
    """
    (low, high), (before, after) = t, signs
    found = np.inf
    while True:
        ends = np.flatnonzero((before > 0.0) & (after <= 0.0))
        if not len(ends):
            return found
        # the one that seems to be first; another one that has changed by then is looked for next
        i = int(ends[np.argmin(before[ends] / (before[ends] - after[ends]))])
        passed: dict[float, np.ndarray] = {low: before, high: after}

        def sign(s: float, i: int = i, passed: dict[float, np.ndarray] = passed) -> float:
            if s not in passed:
                passed[s] = signs_at(s)
            return float(passed[s][i])

        width = LOCATED * (high - low)
        root = float(brentq(sign, low, high, xtol=max(width, NARROWEST * abs(high)), rtol=NARROWEST))
        found = high = root
        after = passed[root].copy() if root in passed else signs_at(root)
        after[i] = np.inf
