"""The contacts that are open in a phase, and the first moment at which one of them closes.

A gap that is open at both ends of a step can have closed and opened between them. It has not where the sum of both gaps
is more than the bodies can move, by a bound of their speeds. Otherwise the step is halved until this bound decides, or
until the parts are so short that a cubic through gaps and rates at their ends is right to a known error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from ngalpha_pin.common.tolerances import CLOSED, TINY
from ngalpha_pin.event_driven.dense_step import DenseStep
from ngalpha_pin.event_driven.root_finding import NARROWEST
from ngalpha_pin.system.contact_search import not_solid
from ngalpha_pin.system.system import System

# a cubic is trusted where the bodies move less than this part of the radius of the surfaces, and where what it misses
# in the middle is below this part of the gap; what it may miss elsewhere, in units of that
CURVED, TRUSTED, MISSED = 0.5, 0.1, 2.0
# where no bound of the speed is known, it is taken from so many places of the step, this many times
PLACES, ELSEWHERE = 5, 2.0
# parts of a step that are looked at, at most
MAX_PARTS = 4000


class Gaps(NamedTuple):
    """Gaps and their rates, shape (j,) each [m, m/s]."""

    g_N: np.ndarray
    rate: np.ndarray


class GapWatch:
    """The contacts of a scene that are open in a phase, without those of solids (see `pair_watch`).

    Args:
        system: compiled scene.
        closed: numbers of the others.
    """

    def __init__(self, system: System, closed: np.ndarray):
        table = system.contacts
        self._system, self.sub = system, table.subset(np.setdiff1d(not_solid(system), closed))
        self.touching = CLOSED * table.yardstick[self.sub.index]
        points = self.sub.points
        moves = np.zeros((self.sub.k, system.nv))
        if points.k:
            mask, n = np.abs(points.mask[: points.k]), system.tree.nv
            moves[: points.k, :n] = mask[:, :n]
            # what moves with a point of a beam may move with all of its coordinates
            moves[: points.k, n:] = mask[:, n:] if system.beams is None else mask[:, n:].any(axis=1, keepdims=True)
        limits = np.arange(points.k, points.k + len(self.sub.limits))
        moves[limits, table.limit_dof[self.sub.limits]] = 1.0
        self._reach = np.where(moves > 0.0, table.reach, 0.0)
        self._reach[points.k + len(limits) :] = np.inf  # of own constraints nothing is known
        radius = np.full(self.sub.k, table.length)
        if points.k:
            bends = points.surface_radius + points.side * points.radius
            radius[: points.k] = np.where(points.curved, bends, table.length)
        self._scale = CURVED * radius

    def at(self, q: np.ndarray, v: np.ndarray) -> Gaps:
        """Gaps and rates at a motion."""
        if self.sub.k == 0:
            return Gaps(np.zeros(0), np.zeros(0))
        rows = self._system.contact_rows_at(self.sub, q, v, 0.0)  # no gap feels how surfaces move along themselves
        return Gaps(rows.g_N, rows.rate[: self.sub.k])

    def alone(self, q: np.ndarray) -> np.ndarray:
        """Gaps at a configuration, shape (j,) [m]."""
        self._system.place(q)
        return self._system.gaps(self.sub, q)

    def first_closing(self, step: DenseStep, before: Gaps, after: Gaps) -> tuple[float, int]:
        """The first time in a step at which a gap that has been open vanishes, or infinity, and number of the contact.

        Args:
            step: the motion.
            before: gaps and rates at its beginning.
            after: the same at its end.
        """
        if self.sub.k == 0:
            return np.inf, -1
        speed = self._speeds(step)
        h = step.t_1 - step.t_0
        may_close = (before.g_N + after.g_N <= speed * h) | (after.g_N < 0.0)
        first, which = np.inf, -1
        search = _Search(self, step)
        for i in np.flatnonzero(may_close):
            ends = [(step.t_0, before.g_N[i], before.rate[i]), (step.t_1, after.g_N[i], after.rate[i])]
            t = search.first_of(int(i), ends, float(speed[i]), float(self._scale[i]), min(first, step.t_1))
            if t < first:
                first, which = t, int(self.sub.index[i])
        return first, which

    def _speeds(self, step: DenseStep) -> np.ndarray:
        """Bounds of the rates of the gaps within a step, shape (j,) [m/s]."""
        with np.errstate(invalid="ignore"):  # a coordinate that does not move has no way, whatever its reach
            speed = np.where(step.fastest > 0.0, self._reach * step.fastest, 0.0).sum(axis=1)
        endless = np.flatnonzero(~np.isfinite(speed))
        if len(endless):  # a point can be any distance away from a joint that turns: where it is now tells
            part = self._system.contacts.subset(self.sub.index[endless])
            speed[endless] = 0.0
            for t in np.linspace(step.t_0, step.t_1, PLACES):
                W = self._system.directions([self._system.contact_rows_at(part, *step(t), t)])[: part.k]
                speed[endless] = np.maximum(speed[endless], ELSEWHERE * (np.abs(W) @ step.fastest))
        return speed


# a time with the gap and its rate
Point = tuple[float, float, float]


class _Search:
    """Looks for the first closing of one gap after the other within a step."""

    def __init__(self, watch: GapWatch, step: DenseStep):
        self._watch, self._step = watch, step
        self._known: dict[float, Gaps] = {}

    def _point(self, i: int, t: float) -> Point:
        if t not in self._known:
            self._known[t] = self._watch.at(*self._step(t))
        return t, float(self._known[t].g_N[i]), float(self._known[t].rate[i])

    def first_of(self, i: int, ends: list[Point], speed: float, scale: float, before: float) -> float:
        """The first time before another one at which gap number i closes, or infinity [s].

        Of a gap that vanishes at the start and does not open, that is the start.

        Args:
            i: number of the gap in the watch.
            ends: both ends of the step.
            speed: bound of its rate [m/s].
            scale: motion over which its direction stays the same, nearly [m].
            before: later ones are of no interest [s].
        """
        touching = float(self._watch.touching[i])
        (start, gap, rate), (end, last, _) = ends
        opened, count = gap > touching or rate * (end - start) > touching, 0
        if not opened and all(self._point(i, t)[1] <= touching for t in np.linspace(start, end, PLACES)[1:-1]):
            return start if last < -touching else np.inf
        parts = [(ends[0], ends[1])]
        while parts:
            low, high = parts.pop()
            if low[0] >= before:
                return np.inf
            opened = opened or low[1] > touching
            h = high[0] - low[0]
            if high[1] > 0.0 and max(low[1], 0.0) + high[1] > speed * h:
                continue
            middle = self._point(i, (low[0] + high[0]) / 2)
            count += 1
            lowest, missed = _cubic(low, middle, high)
            trusted = speed * h <= scale and missed <= max(TRUSTED * max(abs(low[1]), abs(high[1])), touching)
            if trusted and high[1] > 0.0 and lowest - MISSED * missed > -touching:
                continue
            tiny = h <= NARROWEST * max(abs(high[0]), TINY) * 4 or count > MAX_PARTS
            falls = trusted and high[1] <= 0.0 and low[2] < 0.0 and high[2] < 0.0
            if not (tiny or falls):
                parts += [(middle, high), (low, middle)]
            elif high[1] < (0.0 if opened else -touching):
                return self._root(i, low, high) if opened else ends[0][0]
        return np.inf

    def _root(self, i: int, low: Point, high: Point) -> float:
        if low[1] <= 0.0:
            return low[0]

        def gap(s: float) -> float:
            return float(self._watch.alone(self._step(s)[0])[i])

        if gap(low[0]) <= 0.0:
            return low[0]
        if gap(high[0]) > 0.0:
            return high[0]
        return float(brentq(gap, low[0], high[0], xtol=NARROWEST * max(abs(high[0]), high[0] - low[0]), rtol=NARROWEST))


def _cubic(low: Point, middle: Point, high: Point) -> tuple[float, float]:
    """A lower bound of the cubic between two points, and by how much it misses the one in their middle."""
    h = high[0] - low[0]
    third = h / 3.0
    lowest = min(low[1], low[1] + third * low[2], high[1] - third * high[2], high[1])
    predicted = (low[1] + high[1]) / 2 + h * (low[2] - high[2]) / 8
    return lowest, abs(predicted - middle[1])
