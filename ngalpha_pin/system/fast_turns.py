"""Pairs of shapes that turn far in a step: did they meet on the way?

A step looks at gaps at its end, with the features and normals of its start. A blade that turns by 360 degrees in it is
back where it was, and would have passed through what lies in its way; and the plane of a face that has turned has on
its inner side what the face is nowhere near. Here such a pair is followed from pose to pose by no more than it can move
before it touches (conservative advancement).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.collision.manifold import SLOTS
from ngalpha_pin.common.tolerances import MISSED
from ngalpha_pin.system.state import State, StepResult
from ngalpha_pin.system.system import System

# relative turn in a step from which the way is looked at [rad]: up to it a normal of the start still tells both sides
# of a surface apart
FAR = 1.0
# shortest advance, in parts of the smaller shape: what grazes another one by less may be missed
ADVANCE = 0.01
LOOKS = 200  # at one pair in one step


def meet_on_the_way(system: System, state: State, end: State, doubtful: np.ndarray | None = None) -> bool:
    """Shapes that turn far in a step, or are doubtful, and have no contact in it, overlap between its ends.

    Args:
        system: compiled scene.
        state: start of the step.
        end: its end, as found.
        doubtful: numbers of contacts whose shapes are looked at however little they turn, or None.
    """
    slots, dt = system.slots, end.t - state.t
    doubted = _pairs(system, state.contacts[:0] if doubtful is None else doubtful)
    # no body turns faster than all coordinates together
    far = dt * max(np.abs(state.v).sum(), np.abs(end.v).sum()) >= FAR
    if slots.n == 0 or not (far or len(doubted)):
        return False
    carry = _pairs(system, np.union1d(state.contacts, end.contacts))
    apart = np.setdiff1d(np.arange(len(slots.pairs)) if far else doubted, carry)
    turning, pace = _turning(system, state, end, apart)
    fast = turning | np.isin(apart, doubted)
    found = any(_meets(system, state, end, int(i), float(v)) for i, v in zip(apart[fast], pace[fast], strict=True))
    system.place_moving(end.q, end.v)
    return found


def without_false_closings(system: System, state: State, whole: StepResult) -> StepResult:
    """A step without the contacts that seem to close in it, of shapes that turn far and meet nowhere on their way.

    Args:
        system: compiled scene.
        state: start of the step.
        whole: the step without the contacts that close in it.
    """
    end = whole.state
    pairs = np.setdiff1d(_pairs(system, whole.closing), _pairs(system, np.union1d(state.contacts, end.contacts)))
    if not len(pairs) or (end.t - state.t) * max(np.abs(state.v).sum(), np.abs(end.v).sum()) < FAR:
        return whole
    turning, pace = _turning(system, state, end, pairs)
    false = [
        int(i)
        for i, v in zip(pairs[turning], pace[turning], strict=True)
        if not _meets(system, state, end, int(i), float(v), at_end=True)
    ]
    system.place_moving(end.q, end.v)
    if not false:
        return whole
    near, closing = (x[~_of_pairs(system, x, false)] for x in (end.near, whole.closing))
    slots = end.slots[~np.isin(end.slots[:, 0].astype(int) // SLOTS, false)]
    return replace(whole, state=replace(end, near=near, slots=slots), closing=closing)


def _turning(system: System, state: State, end: State, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which pairs turn far in a step, and how fast each of them can approach [m/s], shape (n,) each."""
    slots = system.slots
    joints = np.array([slots.pairs[i].joints for i in pairs], dtype=int).reshape(-1, 2)
    pace, turns = np.zeros(len(pairs)), np.zeros(len(pairs))
    for at in (state, end):
        system.place_moving(at.q, at.v)
        pace = np.maximum(pace, slots.proximity.speeds(system.data, pairs))
        poses, velocities = list(system.data.oMi), list(system.data.v)
        omega = np.array([X.rotation @ V.angular for X, V in zip(poses, velocities, strict=True)])
        turns = np.maximum(turns, np.linalg.norm(omega[joints[:, 1]] - omega[joints[:, 0]], axis=1))
    return turns * (end.t - state.t) > FAR, pace


def nearly_touch(system: System, state: State, end: State, contacts: np.ndarray) -> float | None:
    """Part of a step after which the shapes of some contacts are about to touch; None where they are from its start on.

    Args:
        system: compiled scene.
        state: start of the step.
        end: its end, as found without these contacts.
        contacts: their numbers.
    """
    pairs, dt, pace = _pairs(system, contacts), end.t - state.t, 0.0
    if not len(pairs):
        return None
    for at in (state, end):
        system.place_moving(at.q, at.v)
        pace = max(pace, float(system.slots.proximity.speeds(system.data, pairs).max()))
    near = ADVANCE * min(system.slots.pairs[i].size for i in pairs)
    t, found = 0.0, None
    for _ in range(LOOKS):
        system.place(_between(system, state, end, t / dt))
        distance = min(system.slots.proximity.look(system.data, int(i)) for i in pairs)
        if distance <= near:
            found = t / dt if t > 0.0 else None
            break
        t += (distance - 0.5 * near) / pace
        if t >= dt:
            break
    system.place_moving(end.q, end.v)
    return found


def _pairs(system: System, contacts: np.ndarray) -> np.ndarray:
    """Numbers of the pairs of solids of contacts."""
    first, last = system.contacts.n_fixed, system.contacts.n_points
    return np.unique((contacts[(contacts >= first) & (contacts < last)] - first) // SLOTS)


def _of_pairs(system: System, contacts: np.ndarray, pairs: list[int]) -> np.ndarray:
    """Which contacts are those of some pairs of solids, shape (n,)."""
    first, last = system.contacts.n_fixed, system.contacts.n_points
    return (contacts >= first) & (contacts < last) & np.isin((contacts - first) // SLOTS, pairs)


def _meets(system: System, state: State, end: State, i: int, pace: float, at_end: bool = False) -> bool:
    """A pair overlaps on the way, or `at_end`, or that it does not cannot be told in so many looks."""
    proximity, dt = system.slots.proximity, end.t - state.t
    shortest, t = ADVANCE * system.slots.pairs[i].size / pace, 0.0
    for _ in range(LOOKS):
        system.place(_between(system, state, end, t / dt))
        distance = proximity.look(system.data, i)
        if t > 0.0 and distance < -MISSED * system.contacts.length:
            return True
        t += max(distance / pace, shortest)
        if t >= dt:
            system.place(end.q)
            return at_end and proximity.look(system.data, i) < 0.0
    return True


def _between(system: System, state: State, end: State, part: float) -> np.ndarray:
    """Configuration on the way, by the mean velocity: the difference of both ends does not know whole turns."""
    way = part * (end.t - state.t) * ((1.0 - 0.5 * part) * state.v + 0.5 * part * end.v)
    return np.asarray(system.integrate(state.q, way))
