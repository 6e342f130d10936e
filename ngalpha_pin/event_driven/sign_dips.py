"""Signs that are positive at both ends of a step and may have vanished between them.

A load can push a body that sticks over the edge of its cone, or lift it, and be back within one step. Parabolas through
three neighbouring points show where a sign may have fallen; there it is evaluated, until none falls any more by much.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ngalpha_pin.event_driven.root_finding import first_change

# a parabola that falls below this part of the lowest of its points has to be looked at
DEEP = 0.5
# of its width it leaves this part at both ends, where the next points decide; a sign that begins or ends in parts of
# its largest value below this is one that grows from zero or comes to it
AT_END, GROWS = 1e-2, 1e-3
# places that are looked at in a step, at most
LOOKS = 16

Signs = tuple[float, np.ndarray]


def first_end(signs_at: Callable[[float], np.ndarray], points: list[Signs]) -> float:
    """The first time within a step at which a sign that is positive at its start is no more, or infinity [s].

    Args:
        signs_at: the signs at a time, shape (s,).
        points: times of both ends and between, increasing, with signs there, which need to be exact only at the ends.
    """
    while (dip := first_dip(signs_at, points)) is not None:
        points = [*(point for point in points if point[0] < dip[0]), dip]
    (start, before), (end, after) = points[0], points[-1]
    return first_change(signs_at, (start, end), (before, after))


def first_dip(signs_at: Callable[[float], np.ndarray], points: list[Signs]) -> Signs | None:
    """A time between both ends at which a sign is not positive that is so at the start, with all signs there, or None.

    Of signs that are positive at both ends it is looked for between the points as well. Arguments as in `first_end`.
    """
    t, values = np.array([time for time, _ in points]), np.array([signs for _, signs in points])
    largest = np.abs(values).max(axis=0)
    begins = (values[0] > GROWS * largest) & np.isfinite(values).all(axis=0)
    if not begins.any():
        return None
    known = np.zeros(len(t), dtype=bool)
    known[[0, -1]] = True
    values = values[:, begins]
    lasts = values[-1] > GROWS * largest[begins]
    for _ in range(LOOKS):
        wrong = np.flatnonzero(~known & (values <= 0.0).any(axis=1))
        place = float(t[wrong[0]]) if len(wrong) else _deepest(t, values[:, lasts])
        if place is None:
            return None
        found = signs_at(place)
        if (found[begins] <= 0.0).any():
            return place, found
        i = int(np.searchsorted(t, place))
        if t[i] == place:
            values[i], known[i] = found[begins], True
        else:
            t, known = np.insert(t, i, place), np.insert(known, i, True)
            values = np.insert(values, i, found[begins], axis=0)
    return None


def _deepest(t: np.ndarray, values: np.ndarray) -> float | None:
    """Where the first parabola through three points in a row falls far below them, or None."""
    left, right = np.diff(t)[:-1, None], np.diff(t)[1:, None]
    slope = np.diff(values, axis=0) / np.diff(t)[:, None]
    bend = (slope[1:] - slope[:-1]) / (left + right)
    with np.errstate(divide="ignore", invalid="ignore"):
        # from the middle point on
        rate = slope[:-1] + bend * left
        lowest = -rate / (2.0 * bend)
        bottom = values[1:-1] + 0.5 * rate * lowest
    lower = np.minimum(np.minimum(values[:-2], values[1:-1]), values[2:])
    within = (lowest > -left * (1.0 - AT_END)) & (lowest < right * (1.0 - AT_END))
    # a point that has been looked at tells all around it
    new = np.abs(lowest) > AT_END * np.minimum(left, right)
    falls = (bend > 0.0) & within & (bottom < DEEP * lower)
    falls &= new | (bottom <= 0.0)
    places = np.argwhere(falls)
    if not len(places):
        return None
    i, j = places[0]
    return float(t[i + 1] + lowest[i, j])
