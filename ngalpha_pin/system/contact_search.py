"""What a step asks of the pairs of solids: features at its start, what is missing at its end, what is near."""

from __future__ import annotations

import re
import warnings
from typing import TYPE_CHECKING

import numpy as np

from ngalpha_pin.collision.features import VANISHED
from ngalpha_pin.collision.manifold import SLOTS
from ngalpha_pin.contact.limit_rows import LimitedRows
from ngalpha_pin.system.state import State

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene
    from ngalpha_pin.system.system import ContactRows, System

# penetration of features that are in no place, in parts of the size of the scene
MISSED = 1e-10
# depth from which shapes overlap at the start, likewise
OVERLAP = 5e-10
# gap of what touches and, in parts of a velocity, speed of what is at rest, likewise
CLOSED = 1e-10
LISTED = 8


def load_slots(system: System, state: State, dt: float | None, within: float = 0.0) -> np.ndarray:
    """Choose the features that a step from `state` works with.

    Args:
        system: compiled scene.
        state: start of the step.
        dt: length of the step [s]; None for corners that are fixed points, which do not run around a rim.
        within: distance from which pairs have features even where they are at rest [m].

    Returns:
        Numbers of the contacts whose places are taken.
    """
    first, last = system.contacts.n_fixed, system.contacts.n_points
    carries = state.contacts[(state.contacts >= first) & (state.contacts < last)] - first
    system.place_moving(state.q, state.v)
    system.slots.load(system.data, state.slots, carries, dt, within)
    return first + np.flatnonzero(system.slots.loaded)


def successors(system: System, state: State) -> np.ndarray:
    """Contacts of features that touch, of pairs one of whose features has vanished with a force.

    What rests on other corners than before rests on them from the start of the step. Without them as unknowns it would
    first have to fall, which is a harder problem than its rest.

    Args:
        system: compiled scene, after `load_slots`.
        state: start of the step.
    """
    slots, first = system.slots, system.contacts.n_fixed
    loaded = np.flatnonzero(slots.loaded)
    gone = slots.packed[loaded, VANISHED] > 0.0
    if not gone.any():
        return loaded[gone]
    sub = system.contacts.subset(first + loaded[~gone & np.isin(loaded // SLOTS, loaded[gone] // SLOTS)])
    return sub.index[system.gaps(sub, state.q) <= CLOSED * system.contacts.yardstick[sub.index]]


def add_missing(system: System, near: np.ndarray, rows: ContactRows) -> np.ndarray:
    """Where a pair penetrates with features that no place has, they are added; the places that are new."""
    first, before = system.contacts.n_fixed, system.slots.loaded.copy()
    near = near[near < system.contacts.n_points]
    points = rows.points if isinstance(rows, LimitedRows) else rows
    system.slots.add_missing(system.data, points.normals[near >= first], MISSED * system.contacts.length)
    return first + np.flatnonzero(system.slots.loaded & ~before)


def has_rims(system: System) -> bool:
    """A rim is in one of the places."""
    return system.slots.n > 0 and system.slots.has_rims()


def smallest_gap(system: System, q: np.ndarray) -> float:
    """The smallest gap of all contacts at q, or a lower bound of it, in parts of the yardstick; see `gaps`."""
    table = system.contacts
    first, length, others = table.n_fixed, table.length, not_solid(system)
    smallest = float((system.gaps(table.subset(others), q) / table.yardstick[others]).min(initial=1.0))
    if system.slots.n == 0:
        return smallest
    rows = system.point_rows(table.subset(first + np.flatnonzero(system.slots.loaded)))
    return min(smallest, system.slots.deepest(system.data, length, rows.normals) / length)


def not_solid(system: System) -> np.ndarray:
    """Numbers of the contacts that are no places of pairs of solids."""
    table = system.contacts
    return np.concatenate((np.arange(table.n_fixed), np.arange(table.n_points, table.n)))


def overlaps(system: System, q: np.ndarray) -> list[str]:
    """Names of the contacts, or of the pairs of solids, whose shapes overlap at q."""
    table, fixed = system.contacts, np.arange(system.contacts.n_fixed)
    system.place(q)
    depth = OVERLAP * table.length
    found = [table.names[i] for i in np.flatnonzero(system.gaps(table.subset(fixed), q) < -depth)]
    return found + [system.slots.pairs[i].name for i in system.slots.overlapping(system.data, depth)]


def leave_out_overlaps(scene: Scene, system: System, q0: np.ndarray) -> bool:
    """Take pairs that overlap at q0 and that no one has named out of the contacts of a scene, with a warning.

    Returns:
        Whether there were any.
    """
    names = {re.sub(r"\[\d+\]", "", name) for name in overlaps(system, q0)}
    found = [p for p in scene.contacts if p.found and f"{p.geometry_a}/{p.geometry_b}" in names]
    if found:
        scene.contacts = [p for p in scene.contacts if p not in found]
        scene.left_out += found
        listed = ", ".join(f"{p.geometry_a}/{p.geometry_b}" for p in found[:LISTED])
        more = f" and {len(found) - LISTED} more" if len(found) > LISTED else ""
        warnings.warn(f"overlap at q0 and are left out of the contacts: {listed}{more}", stacklevel=3)
    return bool(found)
