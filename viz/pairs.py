"""Contacts by pair of geometries: a foot on the ground is one thing to look at, whichever of its corners carries it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ngalpha_pin import Trajectory

MOST_TIMES = 2000  # at which gaps of pairs in flight are computed; lines in between
TOUCHES = 1e-6  # gap in parts of the size of the scene up to which the contact that carries has the gap of its pair
ROUNDED = 1e-9  # an impulse below this part of the largest one is rounding, not an impact
SLIPS = 1e-6  # slip counts from this part of the largest contact velocity, as in the events of a run

Pairs = dict[str, np.ndarray]
"""Columns of the contacts of every pair, by its name "geometry/geometry"."""


def pair_names(trajectory: Trajectory) -> list[str]:
    """Name of the pair of every contact column; a limit of a joint keeps its own name."""
    system = trajectory.system
    declared = {f"{p.geometry_a}/{p.geometry_b}" for p in trajectory.scene.contacts}
    found = []
    for column, name in zip(np.asarray(trajectory.contact_columns).tolist(), trajectory.contact_names, strict=True):
        if column >= system.contacts.n_points:
            found.append(name)
        elif column >= system.contacts.n_fixed:
            found.append(system.slots.pairs[_pair_number(trajectory, column)].name)
        else:
            found.append(_declared(name, declared))
    return found


def contact_pairs(trajectory: Trajectory) -> Pairs:
    """The pairs of geometries that have columns, in the order of their first one; without limits of joints."""
    found: dict[str, list[int]] = {}
    places = np.asarray(trajectory.contact_columns) < trajectory.system.contacts.n_points
    for k, name in enumerate(pair_names(trajectory)):
        if places[k]:
            found.setdefault(name, []).append(k)
    return {name: np.array(columns) for name, columns in found.items()}


def busiest(trajectory: Trajectory, pairs: Pairs, most: int) -> list[str]:
    """The pairs whose impulse over the run is largest, in the order in which they were declared."""
    load = np.sum(trajectory.P_N, axis=0)
    wanted = sorted(pairs, key=lambda name: -float(load[pairs[name]].sum()))[:most]
    return [name for name in pairs if name in wanted]


def pair_gap(trajectory: Trajectory, columns: np.ndarray) -> np.ndarray:
    """Smallest distance of the two geometries of a pair over time [m], shape (n + 1,).

    Columns are there for the contacts that carried alone, and a place of a feature that is not near holds no gap: where
    the pair does not touch, its distance is computed again from the poses.

    Args:
        trajectory: any run.
        columns: of the pair, see `contact_pairs`.
    """
    system, t = trajectory.system, np.asarray(trajectory.t)
    gap = np.asarray(trajectory.g_N)[:, columns].min(axis=1)
    first = int(trajectory.contact_columns[columns[0]])
    points = np.zeros(0, dtype=int)
    if first < system.contacts.n_fixed:
        points = _points_of(trajectory, columns[0])
        if len(points) == len(columns):
            return gap
    touches = gap <= TOUCHES * system.contacts.length
    known = touches.copy()
    known[np.unique(np.linspace(0, len(t) - 1, MOST_TIMES).astype(int))] = True
    for i in np.flatnonzero(known & ~touches & np.isfinite(trajectory.q).all(axis=1)):
        system.place(trajectory.q[i])
        if len(points):
            gap[i] = system.gaps(system.contacts.subset(points), trajectory.q[i]).min()
        else:
            gap[i] = system.slots.proximity.look(system.data, _pair_number(trajectory, first))
    return np.where(known, gap, np.interp(t, t[known], gap[known]))


def friction_impulse(trajectory: Trajectory, pairs: Pairs) -> dict[str, np.ndarray]:
    """Friction of each pair summed over its contacts, as a vector in the world.

    Args:
        trajectory: any run.
        pairs: those that are wanted.

    Returns:
        Impulse of each step [N s], shape (n + 1, 3).
    """
    P_F = np.asarray(trajectory.P_F)
    found = {name: np.zeros((len(P_F), 3)) for name in pairs}
    rows = {
        name: np.concatenate([np.arange(r.start, r.stop) for r in (trajectory.friction_rows[k] for k in columns)])
        for name, columns in pairs.items()
    }
    wanted = np.concatenate([*rows.values(), np.zeros(0, dtype=int)]).astype(int)
    points = trajectory.system.contacts.subset(np.asarray(trajectory.contact_columns)).points
    still = bool(points.k) and points.k == points.k_fixed and points.fixed_planes
    directions = trajectory.contact_frames(0)[2] if len(wanted) else np.zeros((0, 3))
    for i in np.flatnonzero(P_F[:, wanted].any(axis=1)):
        if not still:
            directions = trajectory.contact_frames(int(i))[2]
        for name, own in rows.items():
            found[name][i] = P_F[i, own] @ directions[own]
    return found


def contact_events(trajectory: Trajectory) -> Iterator[tuple[float, str, int, str, float]]:
    """Time, kind, column of the contact or -1, its name and the impulse [N s] of every event.

    A located impact has an impulse of its own; otherwise it is the impulsive part of its step.
    """
    number, t = {name: k for k, name in enumerate(trajectory.contact_names)}, np.asarray(trajectory.t)
    located = trajectory.impacts
    own = {(float(located.t[i]), int(k)): float(located.P_N[i, k]) for i, k in np.argwhere(located.P_N > 0.0)}
    of_step = trajectory.La_N if np.any(trajectory.La_N) else trajectory.P_N
    for event in trajectory.events:
        k, P = number.get(event.contact, -1), 0.0
        if event.kind == "impact" and k >= 0:
            P = own.get((float(event.t), k), float(of_step[_step_of(t, event.t), k]))
        yield float(event.t), str(event.kind), k, str(event.contact), P


def pair_events(trajectory: Trajectory) -> list[tuple[float, str, str, float]]:
    """Time, kind, pair and impulse [N s] of what happens to pairs, in the order of time.

    Impacts of several corners at one moment are one impact with their impulse. A pair lifts off when none of its
    corners touches any more, and slips while any of them does.
    """
    names, t = np.array(pair_names(trajectory)), np.asarray(trajectory.t)
    several = Counter(names.tolist())
    states: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    found: dict[tuple[float, str, str], float] = {}
    for at, kind, k, contact, P in contact_events(trajectory):
        pair = str(names[k]) if k >= 0 else contact
        if k >= 0 and several[pair] > 1:
            if pair not in states:
                states[pair] = _touching_and_slipping(trajectory, np.flatnonzero(names == pair))
            if not _of_the_pair(kind, *states[pair], _step_of(t, at)):
                continue
        found[at, kind, pair] = found.get((at, kind, pair), 0.0) + P
    least = ROUNDED * max(found.values(), default=0.0)
    rows = [(*key, P) for key, P in found.items() if key[1] != "impact" or P > least]
    return sorted(rows, key=lambda row: row[0])


def _step_of(t: np.ndarray, at: float) -> int:
    """The step that ends at a moment or after it."""
    return min(int(np.searchsorted(t[:-1], at)), len(t) - 1)


def _of_the_pair(kind: str, touches: np.ndarray, slips: np.ndarray, i: int) -> bool:
    """Whether what one of several corners does in step i is what its pair does."""
    before = max(i - 1, 0)
    new = {"closed": not touches[before], "lift-off": not touches[i], "slip": not slips[before], "stick": not slips[i]}
    return new.get(kind, True)


def _touching_and_slipping(trajectory: Trajectory, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether any contact of a pair touches, and whether any that touches slips, shape (n + 1,) each."""
    motion, table = trajectory.contact_motion, trajectory.system.contacts
    closed = motion.g_N[:, columns] <= 1e-9 * table.yardstick[np.asarray(trajectory.contact_columns)[columns]]
    speed = max(float(np.abs(motion.g_N_dot).max(initial=0.0)), float(np.abs(motion.gamma_F).max(initial=0.0)))
    rows = [trajectory.friction_rows[k] for k in columns]
    slip = np.column_stack([np.linalg.norm(motion.gamma_F[:, r], axis=1) for r in rows])
    return closed.any(axis=1), (closed & (slip > SLIPS * speed)).any(axis=1)


def _pair_number(trajectory: Trajectory, column: int) -> int:
    """Of a contact in a place of a changing feature, the number of its pair."""
    slots = trajectory.system.slots
    return (column - trajectory.system.contacts.n_fixed) // (slots.n // len(slots.pairs))


def _points_of(trajectory: Trajectory, column: int) -> np.ndarray:
    """Numbers of all contact points of the pair of a column, those that never carried included."""
    table = trajectory.system.contacts
    declared = {f"{p.geometry_a}/{p.geometry_b}" for p in trajectory.scene.contacts}
    pair = _declared(trajectory.contact_names[column], declared)
    return np.array([i for i in range(table.n_fixed) if _declared(table.names[i], declared) == pair])


def _declared(name: str, declared: set[str]) -> str:
    """The pair that a contact point is of: its name without the number of the point."""
    if name in declared:
        return name
    without = (name[: m.start()] + name[m.end() :] for m in re.finditer(r"\[\d+\]", name))
    return next((pair for pair in without if pair in declared), name)
