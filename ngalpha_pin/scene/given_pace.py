"""How fast what is given changes with time, which bounds steps where the motion does not tell.

While everything rests, or nothing moves but what is far from the load, an error estimate is zero and a step grows
without bound, over a push that comes later. Functions of time are therefore sampled once for a run, and a step goes on
for no more than a part of their range. What is shorter than a sample apart can be missed, as a jump there can.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.breakpoints import NOISE, SAMPLES, time_functions

# what is given changes in a step by this part of its range, at most
PART = 0.25


class GivenPace:
    """The pace of what is given in a run.

    Args:
        scene: its forces, driven joints and frames, and surfaces.
        q, v: a motion at which forces that depend on it are sampled, shapes (nq,) and (nv,).
        start, end: of the run [s].
    """

    def __init__(self, scene: Any, q: np.ndarray, v: np.ndarray, start: float, end: float):
        self._t = np.linspace(start, end, SAMPLES + 1)
        self._apart, most = float(end - start) / SAMPLES, np.zeros(SAMPLES)
        for function in time_functions(scene, q, v):
            values = _sampled(function, self._t)
            size = np.nanmax(np.abs(values), axis=0, initial=0.0)
            wide = np.nanmax(values, axis=0, initial=-np.inf) - np.nanmin(values, axis=0, initial=np.inf)
            moves = wide > 1e2 * NOISE * size
            if moves.any():
                changes = np.abs(np.diff(values[:, moves], axis=0)) / wide[moves]
                most = np.maximum(most, np.nan_to_num(changes).max(axis=1))
        self._passed = np.concatenate(([0.0], np.cumsum(most)))

    def longest(self, t: float) -> float:
        """The longest step from a time on, at least the distance of two samples [s]; infinity where nothing changes."""
        until = np.interp(t, self._t, self._passed) + PART
        i = int(np.searchsorted(self._passed, until))
        return max(float(self._t[i]) - t, self._apart) if i < len(self._t) else np.inf


def _sampled(function: Callable[[float], np.ndarray], t: np.ndarray) -> np.ndarray:
    """Values of a function, shape (times, n); nan where it gives nothing, as beyond where a run ends by an event."""
    found: list[np.ndarray | None] = []
    for time in t.tolist():
        try:
            found.append(np.ravel(function(time)))
        except SceneError:
            found.append(None)
    n = next((len(value) for value in found if value is not None), 0)
    return np.array([np.full(n, np.nan) if value is None else value for value in found])
