"""Whether the features with which shapes touch stay the same in a step, and no other shapes come together in it.

Within a smooth phase every closed contact keeps its features, whose kinematics are exact to second order. Where others
take over, a corner comes down or leaves a face, or where shapes may meet, the phase cannot go on. Distances of shapes
change by no more than they move: two that are apart at both ends of a step by more than that have not met in it.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin import engine
from ngalpha_pin.collision.features import VANISHED
from ngalpha_pin.collision.manifold import SLOTS, apart
from ngalpha_pin.common.tolerances import CLOSED
from ngalpha_pin.event_driven.dense_step import DenseStep
from ngalpha_pin.system.system import System

# shapes move at most so many times as fast within a step as at its ends
BETWEEN = 2.0
# halvings of a step to show that shapes do not meet in it
HALVINGS = 6
# distance between features that are the same, in parts of the size of the scene: radii are roots of what is rounded
SAME = 1e-7


class PairWatch:
    """The pairs of solids in a phase.

    Args:
        system: compiled scene, with the features of the phase in its places.
        closed: numbers of the contacts that are closed in it.
    """

    def __init__(self, system: System, closed: np.ndarray):
        self._system, slots, table = system, system.slots, system.contacts
        places = closed[(closed >= table.n_fixed) & (closed < table.n_points)] - table.n_fixed
        self._touching = np.unique(places // SLOTS).tolist()
        self._closed = {i: slots.packed[places[places // SLOTS == i]].copy() for i in self._touching}
        loaded = np.flatnonzero(slots.loaded & (slots.packed[:, VANISHED] == 0.0))
        self._known = {i: slots.packed[loaded[loaded // SLOTS == i]].copy() for i in self._touching}
        self._others = np.setdiff1d(np.arange(len(slots.pairs)), self._touching)

    def stays(self, step: DenseStep) -> bool:
        """Features stay the same up to the end of a step, and no other shapes meet in it."""
        if not self._system.slots.n:
            return True
        return self._same(step) and self._apart(step, step.t_0, step.t_1, self._others, HALVINGS)

    def _same(self, step: DenseStep) -> bool:
        system, length = self._system, self._system.contacts.length
        system.place_moving(*step(step.t_1))
        for i in self._touching:
            X, known, closed = system.slots.pose(system.data, i), self._known[i], self._closed[i]
            found = system.slots.features(i, X, np.zeros(3), known, closed)
            if not len(found) or apart(found, closed, X).min(axis=0).max() > SAME * length:
                return False
            new = apart(found, known, X).min(axis=1) > SAME * length
            if any(engine.gap_along_normal(row, X.rotation, X.translation) <= CLOSED * length for row in found[new]):
                return False
        return True

    def _apart(self, step: DenseStep, t_0: float, t_1: float, pairs: np.ndarray, halvings: int) -> bool:
        """The pairs do not meet between two times."""
        (d_0, speed_0), (d_1, speed_1) = (self._distances(step, t, pairs, t_1 - t_0) for t in (t_0, t_1))
        near = pairs[~(d_0 + d_1 > (t_1 - t_0) * BETWEEN * np.maximum(speed_0, speed_1))]
        if not len(near):
            return True
        middle = 0.5 * (t_0 + t_1)
        parts = ((t_0, middle), (middle, t_1))
        return halvings > 0 and all(self._apart(step, *part, near, halvings - 1) for part in parts)

    def _distances(self, step: DenseStep, t: float, pairs: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Distances of pairs, or lower bounds where they are far, and bounds of their speeds."""
        system, proximity = self._system, self._system.slots.proximity
        system.place_moving(*step(t))
        speed = proximity.speeds(system.data, pairs)
        reach = 2.0 * BETWEEN * h * speed
        found = np.full(len(pairs), np.inf)
        near, _ = proximity.bounds(system.data, reach, pairs)
        for i in near.tolist():
            found[np.searchsorted(pairs, i)] = proximity.look(system.data, i)
        far = ~np.isfinite(found)
        found[far] = reach[far]
        return found, speed
