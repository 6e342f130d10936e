"""Newton's cradle with gaps: free pendulums between impacts of two neighbours each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from .integration import PRECISE, Motion, ends_integration

RADIUS, LENGTH, GRAVITY = 0.1, 1.0, 9.81


def cradle(t: np.ndarray, n: int = 5, gap: float = 2e-3, e_N: float = 0.9, raised: float = 0.5) -> Motion:
    """The angles of the pendulums; parameters as in `robots.cradle`, with a gap above 0.

    Returns:
        q (n_t, n) and v (n_t, n).
    """
    end, start, y = float(np.max(t)), 0.0, np.zeros(2 * n)
    y[0] = raised
    found = np.zeros((len(t), 2 * n))
    events = [_touch(i, n, gap) for i in range(n - 1)]
    while start < end:
        part = solve_ivp(_rate, (start, end + 1e-9), y, events=events, max_step=0.02, **PRECISE)
        here = (t >= start) & (t <= part.t[-1])
        if here.any():
            found[here] = part.sol(t[here]).T
        start, y = part.t[-1], part.y[:, -1].copy()
        for i in range(n - 1):
            if len(part.t_events[i]) and start < end:
                row = _direction(y, i, n, gap)
                y[n:] -= (1 + e_N) * (row @ y[n:]) / (row @ row) * row
    return found[:, :n], found[:, n:]


def _rate(_: float, y: np.ndarray) -> np.ndarray:
    n = len(y) // 2
    return np.concatenate((y[n:], -GRAVITY / LENGTH * np.sin(y[:n])))


def _between(y: np.ndarray, i: int, gap: float) -> np.ndarray:
    """From ball i to its neighbour, in x and z [m]."""
    ends = [LENGTH * np.array([-np.sin(angle), -np.cos(angle)]) for angle in y[i : i + 2]]
    return ends[1] - ends[0] + np.array([2 * RADIUS + gap, 0.0])


def _direction(y: np.ndarray, i: int, n: int, gap: float) -> np.ndarray:
    """Derivative of the distance of a pair by the angles; all inertias are 1."""
    line = _between(y, i, gap)
    line /= np.linalg.norm(line)
    tangents = [LENGTH * np.array([-np.cos(angle), np.sin(angle)]) for angle in y[i : i + 2]]
    row = np.zeros(n)
    row[i], row[i + 1] = -line @ tangents[0], line @ tangents[1]
    return row


def _touch(i: int, n: int, gap: float) -> Callable[[float, np.ndarray], float]:
    def gap_of_pair(_: float, y: np.ndarray) -> float:
        return float(np.linalg.norm(_between(y, i, gap))) - 2 * RADIUS

    ends_integration(gap_of_pair, -1)
    return gap_of_pair
