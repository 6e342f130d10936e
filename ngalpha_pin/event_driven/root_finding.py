"""Moments at which something changes within a step, by bracketing on its dense output."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from ngalpha_pin import checks
from ngalpha_pin.scene.user_function import called

ROUNDING = 4 * np.finfo(float).eps
# part of a step to which the change of a force or of a slip is located: what it changes begins at zero there
LOCATED = 1e-11

GapFunction = Callable[[float], np.ndarray]
UserFunction = Callable[[float, np.ndarray, np.ndarray], float]


def first_root(function: Callable[[float], float], low: float, high: float) -> float:
    """A root of a function that changes its sign between two times; the end at which it vanishes already [s]."""
    at_low, at_high = function(low), function(high)
    if at_low == 0.0 or at_low * at_high > 0.0:
        return low if abs(at_low) <= abs(at_high) else high
    return float(brentq(function, low, high, xtol=ROUNDING * max(abs(high), high - low), rtol=ROUNDING))


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
        root = float(brentq(sign, low, high, xtol=max(width, ROUNDING * abs(high)), rtol=ROUNDING))
        found = high = root
        after = passed[root].copy() if root in passed else signs_at(root)
        after[i] = np.inf


def first_closing(
    t: tuple[float, float],
    gaps: tuple[np.ndarray, np.ndarray],
    rates: tuple[np.ndarray, np.ndarray],
    gaps_at: GapFunction,
    touching: np.ndarray,
) -> tuple[float, int]:
    """The first time at which a gap that has been open vanishes, or infinity, and which gap.

    Args:
        t: beginning and end of the step [s].
        gaps: at both, shape (j,) [m].
        rates: of the gaps at both, shape (j,) [m/s].
        gaps_at: the gaps at a time within the step.
        touching: gaps below these count as none, shape (j,) [m].
    """
    third = (t[1] - t[0]) / 3
    control = np.minimum(gaps[0] + third * rates[0], gaps[1] - third * rates[1])  # the cubic stays above these
    first, which = np.inf, -1
    for i in np.flatnonzero(np.minimum(control, gaps[1]) < 0.0):
        cubic = CubicHermiteSpline(t, [gaps[0][i], gaps[1][i]], [rates[0][i], rates[1][i]])
        roots = cubic.roots(extrapolate=False)
        ends = np.concatenate(([t[0]], roots[roots > t[0]], [t[1]]))
        middles = (ends[:-1] + ends[1:]) / 2  # one in every stretch of one sign
        values = np.array([gaps_at(s)[i] for s in middles] + [gaps[1][i]])
        times = np.append(middles, t[1])
        is_open = np.maximum.accumulate(np.append(gaps[0][i] > touching[i], values[:-1] > 0.0))[1:]
        closed = np.flatnonzero(is_open & (values[:-1] > 0.0) & (values[1:] <= 0.0))
        if len(closed):
            low, high = times[closed[0]], times[closed[0] + 1]
        elif gaps[1][i] < -touching[i]:
            low, high = t[0], t[1] if gaps[0][i] > touching[i] else t[0]  # or it closes from the start on
        else:
            continue

        def gap(s: float, i: int = int(i)) -> float:
            return float(gaps_at(s)[i])

        root = first_root(gap, low, high) if high > low else low
        if root < first:
            first, which = root, int(i)
    return first, which


@dataclass
class UserEvent:
    """A function of the user whose zeros are located, with what was found.

    Attributes:
        function: called with (t, q, v); attributes `terminal` (bool or number of times) and `direction` as in scipy.
        t, q, v: where it vanished.
    """

    function: UserFunction
    t: list[float] = field(default_factory=list)
    q: list[np.ndarray] = field(default_factory=list)
    v: list[np.ndarray] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Read the attributes of the function."""
        checks.function("event", self.function, "of (t, q, v)")
        self.name = f"event {getattr(self.function, '__name__', 'of the user')}"
        self.direction = checks.number(f"{self.name}: direction", getattr(self.function, "direction", 0.0))
        terminal = getattr(self.function, "terminal", False)
        if not isinstance(terminal, bool):
            checks.integer(f"{self.name}: terminal", terminal, 0)
        self.terminal = int(terminal)

    def value(self, t: float, q: np.ndarray, v: np.ndarray) -> float:
        """The function at a motion.

        Raises:
            SceneError: it fails, or gives anything but a finite number.
        """
        return checks.number(f"{self.name} at t = {t:g}", called(self.name, self.function, t, q, v))

    def crossed(self, before: float, after: float) -> bool:
        """Whether the signs at both ends of a step show a zero in the wanted direction."""
        up, down = before < 0.0 <= after, before > 0.0 >= after
        return (up and self.direction >= 0) or (down and self.direction <= 0)

    def add(self, t: float, q: np.ndarray, v: np.ndarray) -> bool:
        """Note a zero; whether the run ends there."""
        self.t.append(t)
        self.q.append(q)
        self.v.append(v)
        return 0 < self.terminal <= len(self.t)
