"""Housner's rocking block: rotation about one corner, then about the other, from impact to impact."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from .integration import PRECISE, Motion, ends_integration

HALF_WIDTH, HALF_HEIGHT, GRAVITY = 0.1, 0.4, 9.81
SIZE = HALF_WIDTH**2 + HALF_HEIGHT**2
KEPT = 1.0 - 1.5 * HALF_WIDTH**2 / SIZE
"""Part of the angular velocity that an impact leaves: the angular momentum about the new corner is kept [-]."""


def rocking_block(t: np.ndarray, tilt: float = 0.15) -> Motion:
    """The block that is let go on a corner; parameters as in `robots.rocking_block`.

    The impact law is the one with e_N = 0 and stick at the corner that hits, while the other corner lets go.

    Returns:
        q (n, 3): (x, z, angle) and v (n, 3).
    """
    starts, sides, arcs = rocking_arcs(tilt, float(np.ceil(np.max(t) + 1e-9)))
    q, v = np.empty((len(t), 3)), np.empty((len(t), 3))
    for i, s in enumerate(t):
        k = int(np.searchsorted(starts, s, side="right")) - 1
        angle, rate = arcs[k](s)
        b, c, n = sides[k] * HALF_WIDTH, np.cos(angle), np.sin(angle)
        q[i] = b - b * c + HALF_HEIGHT * n, b * n + HALF_HEIGHT * c, angle
        v[i] = rate * (b * n + HALF_HEIGHT * c), rate * (b * c - HALF_HEIGHT * n), rate
    return q, v


@cache
def rocking_arcs(tilt: float, t_end: float) -> tuple[list[float], list[float], list[Any]]:
    """The stretches between impacts: start [s], side of the corner, and the function t -> (angle, rate)."""

    def rate(_: float, y: np.ndarray, side: float) -> list[float]:
        lever = side * HALF_WIDTH * np.cos(y[0]) - HALF_HEIGHT * np.sin(y[0])
        return [y[1], -GRAVITY * lever / (4.0 / 3.0 * SIZE)]

    def upright(_: float, y: np.ndarray, side: float) -> float:
        return side * y[0] if side * y[1] < 0.0 else 1.0

    ends_integration(upright, -1)
    start, side, y = 0.0, float(np.sign(tilt)), np.array([tilt, 0.0])
    starts, sides, arcs = [], [], []
    while start < t_end:
        part = solve_ivp(rate, (start, t_end), y, args=(side,), events=upright, **PRECISE)
        starts.append(float(start))
        sides.append(side)
        arcs.append(part.sol)
        start, side, y = part.t[-1], -side, np.array([0.0, KEPT * part.y[1, -1]])
    return starts, sides, arcs
