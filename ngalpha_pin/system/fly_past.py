"""Points that fly past round surfaces in one step: did they meet on the way?

A step looks at gaps at its end. Two balls that have passed through each other in it are apart there. Here the way of
such a point relative to the surface is followed, as a parabola, and the step is divided where both are nearest.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.common.tolerances import MISSED
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

# relative way in a step from which it is looked at, in parts of the sum of both radii r: a shorter chord leaves less
# than one hundredth of r between itself and the surface, way^2 / (8 r)
FAR = np.sqrt(8 * 0.01)


def may_fly_past(system: System, q: np.ndarray, v: np.ndarray, near: np.ndarray, dt: float) -> Subset | None:
    """Of contacts those that can pass in a step, or None.

    Args:
        system: compiled scene.
        q: configuration at the start of the step, shape (nq,).
        v: velocity there, shape (nv,).
        near: numbers of the contacts, without those that carry there.
        dt: length of the step [s].
    """
    table = system.contacts
    near = near[near < table.n_fixed]
    near = near[table.curved[near] & (table.side[near] > 0.0)]
    if not len(near):
        return None
    r = table.surface_radius[near] + table.radius[near]
    if system.gap_motion(dt * v) < FAR * r.min():
        return None
    system.place_moving(q, v)
    fast = np.linalg.norm(_relative(system, table.subset(near))[1], axis=1) * dt > FAR * r
    return table.subset(near[fast]) if fast.any() else None


def first_fly_past(system: System, state: State, end: State) -> float | None:
    """Where in a step a point has been inside of a round surface that it is outside of at both ends.

    Args:
        system: compiled scene.
        state: start of the step.
        end: its end, as found.

    Returns:
        Part of the step after which the first such point is nearest to the axis or centre of its surface, or None.
    """
    dt = end.t - state.t
    sub = may_fly_past(system, state.q, state.v, np.setdiff1d(end.near, np.union1d(end.contacts, state.contacts)), dt)
    if sub is None:
        return None
    system.place_moving(state.q, state.v)
    at_start, rate, along = _relative(system, sub)
    system.place_moving(end.q, end.v)
    at_end, _, along_end = _relative(system, sub)
    first = None
    within = sub.surface_radius + sub.radius - MISSED * system.contacts.length
    heights = along_end - along
    for i in range(sub.k):
        way = np.array([at_end[i] - at_start[i] - dt * rate[i], dt * rate[i], at_start[i]])
        part = _nearest(way)
        inside = np.linalg.norm(_at(way, part)) < within[i] <= np.linalg.norm(at_end[i])
        if inside and 0.0 < part < 1.0 and abs(along[i] + part * heights[i]) <= sub.half_length[i]:
            first = part if first is None else min(first, part)
    return first


def _relative(system: System, sub: Subset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of points relative to the centres, where the bodies are: place and rate across the axis, place along it.

    Returns:
        Two arrays of shape (k, 3) and one of shape (k,).
    """
    poses, velocities = system.data.oMi, system.data.v
    R, p, v, omega = (
        np.array([of(int(body)) for body in sub.bodies])
        for of in (
            lambda j: poses[j].rotation,
            lambda j: poses[j].translation,
            lambda j: poses[j].rotation @ velocities[j].linear,
            lambda j: poses[j].rotation @ velocities[j].angular,
        )
    )
    a, b = sub.body_a, sub.body_b
    arm_a, arm_b = (np.einsum("kij,kj->ki", R[body], x) for body, x in ((a, sub.centre), (b, sub.point)))
    place = p[b] + arm_b - p[a] - arm_a
    axis = np.einsum("kij,kj->ki", R[a], sub.axis)
    along = np.einsum("ki,ki->k", axis, place)
    # what turns with the surface does not come nearer to it
    rate = v[b] + np.cross(omega[b], arm_b) - v[a] - np.cross(omega[a], arm_a)
    across = place - along[:, None] * axis
    return across, rate - np.einsum("ki,ki->k", axis, rate)[:, None] * axis, along


def _nearest(way: np.ndarray) -> float:
    """Where in [0, 1] a parabola with these coefficients, highest first, shape (3, n), is nearest to the origin."""
    a, b, c = way
    turns = np.roots([2 * a @ a, 3 * a @ b, b @ b + 2 * a @ c, b @ c])
    parts = [0.0, 1.0, *(x for x in turns.real if 0.0 < x < 1.0)]
    return float(min(parts, key=lambda part: float(np.linalg.norm(_at(way, part)))))


def _at(way: np.ndarray, part: float) -> np.ndarray:
    """The parabola at a part of the step."""
    return np.asarray((way[0] * part + way[1]) * part + way[2])
