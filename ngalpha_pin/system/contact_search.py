"""What a step asks of the pairs of solids: features at its start, what is missing at its end, what is near."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable

import numpy as np

from ngalpha_pin.collision.features import VANISHED
from ngalpha_pin.collision.manifold import SLOTS
from ngalpha_pin.common.tolerances import CLOSED, MISSED, OVERLAP
from ngalpha_pin.scene.decomposition import only_hulls_of
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.regime import LOOKED_AGAIN, Regime
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import ContactRows, System

LISTED = 8  # names in a message: more are not read
# contacts whose gap is below this many times the possible motion of one step are looked at in every step
NEAR_STEPS = 16.0
# motion of a step, in parts of the clearance, below which all contacts are looked through once more where many are open
RELAXED = 1000.0


class ContactSearch:
    """What a step knows of the contacts that are near, and of those that close in it.

    Args:
        system: compiled scene; features of shapes are put into its places.
        state: start of the step.
        dt: step [s].
        follow_rims: the lowest point of a rim moves around it in the step; otherwise it is fixed in the body.
        features: end of a longer step from the same start whose features of shapes are taken, or None.

    Attributes:
        near: numbers of the contacts that are looked at in this step.
        clearance: by how much the others can still move before one of them could close [m].
        successors: contacts that have to carry from the start of the step, see `successors`.
    """

    def __init__(
        self, system: System, state: State, dt: float, follow_rims: bool = True, features: State | None = None
    ):
        self._system, self._state, self._dt, self._gaps = system, state, dt, np.zeros(0)
        self.near, self.clearance, self.successors = state.near, state.clearance, state.near[:0]
        if system.contacts.n == 0:
            return
        if features is not None and system.slots.n:
            system.slots.restore(features.slots)
            self.near, self.clearance = features.near, features.clearance
            return
        self.near, self.clearance = _screen(system, state, system.gap_motion(dt * state.v))
        if system.slots.n:
            self.near = np.union1d(self.near, load_slots(system, state, dt if follow_rims else None))
            self.successors = successors(system, state)

    def reaches(self, motion: float) -> None:
        """The step has moved gaps by so much [m]: where that is more than foreseen, no contact is known to be open."""
        if not self.clearance > motion:
            self.near, self.clearance = np.union1d(self.near, not_solid(self._system)), -np.inf

    def end(self, motion: float) -> None:
        """The step has ended with this motion [m]."""
        if np.isfinite(motion):
            self.clearance = self.clearance - motion

    def closing(self, contacts: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Near contacts that are none of these and whose gap is negative at q, where the last evaluation was.

        Features that were missing among the near ones are added to them.
        """
        system, near = self._system, self.near
        if system.slots.n == 0 and (len(near) == 0 or near.tobytes() == contacts.tobytes()):
            return near[:0]
        gaps, normals = system.gaps_and_normals(system.contacts.subset(near), q)
        penetrates = near[gaps < 0.0].tolist()
        known = set(contacts.tolist()) if penetrates else set()
        closing = np.array([i for i in penetrates if i not in known], dtype=int)
        self._gaps = gaps[np.searchsorted(near, closing)]
        if len(closing) or system.slots.n == 0:
            return closing
        return self._missed(normals[near[near < system.contacts.n_points] >= system.contacts.n_fixed])

    def found(self, closing: np.ndarray, gaps: np.ndarray, q: np.ndarray) -> np.ndarray:
        """The same, where the engine has looked at what is near, no features among it.

        Args:
            closing: those of the near contacts that close, increasing.
            gaps: of these, shape (n,) [m or rad].
            q: configuration, shape (nq,).
        """
        self._gaps = gaps
        if len(closing) or self._system.slots.n == 0:
            return closing
        self._system.place(q)
        return self._missed(np.zeros((0, 3)))

    def _missed(self, normals: np.ndarray) -> np.ndarray:
        """Features that were missing among the near ones, which are added to them: those that penetrate."""
        system = self._system
        added = add_missing(system, normals)
        if len(added) == 0:
            return added
        self.near = np.union1d(self.near, added)
        gaps = system.point_rows(system.contacts.subset(added)).g_N
        self._gaps = gaps[gaps < 0.0]
        return added[gaps < 0.0]

    def hitting(self, contacts: np.ndarray) -> np.ndarray:
        """Those of the contacts that `closing` found last that meet an impact in the step.

        They are open at its start, or approaching there, or leave and are in flight for the greater part of it. From
        the rate r at the start to the gap -d at the end a parabola is back after r dt / (r dt + d) of the step. What
        comes back earlier hardly leaves, and goes on with ever smaller bounces.
        """
        system, state, sub = self._system, self._state, self._system.contacts.subset(contacts)
        system.place(state.q)
        hits = system.gaps(sub, state.q) > CLOSED * system.contacts.yardstick[contacts]
        if not hits.all():
            rows = system.contact_rows_at(sub, state.q, state.v, state.t)
            rate = rows.rate[: sub.k]
            flies = (rate > contact_speed(system, rows)) & (rate * self._dt > -self._gaps)
            # among many contacts each bounce would divide the step once more
            flies &= Regime(len(state.contacts)).divides
            hits |= (rate < -contact_speed(system, rows)) | flies
        return contacts[hits]


def _screen(system: System, state: State, motion: float) -> tuple[np.ndarray, float]:
    """Contacts to look at in this step, and by how much the others can still move before one could close [m].

    While the clearance of the last look lasts, nothing is computed for the contacts that are far away. Pairs of solids
    have their own way, see `broad_phase`.

    Args:
        system: compiled scene.
        state: start of the step.
        motion: by how much a gap changes in this step, roughly and at most [m].
    """
    table, every = system.contacts, not_solid(system)
    known = state.near[(state.near < table.n_fixed) | (state.near >= table.n_points)]
    again = len(known) > len(state.contacts) + LOOKED_AGAIN and state.clearance > RELAXED * motion
    if state.clearance > 2.0 * motion and not again:
        return known, state.clearance
    if not np.isfinite(motion):  # a point can be any distance away from a joint that turns
        return every, np.inf
    system.place(state.q)
    gaps = system.gaps(table.subset(every), state.q) * table.measure[every]
    is_near = ~(gaps > NEAR_STEPS * motion) | (every >= table.n_shapes)  # nothing bounds how fast own gaps close
    far = gaps[~is_near]
    return every[is_near], float(far.min()) if len(far) else np.inf


def contact_speed(system: System, rows: ContactRows) -> float:
    """Speed of a contact that counts as none at a motion with these rows [m/s]."""
    return CLOSED * max(rows.sizes[1], system.contacts.speed)


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


def add_missing(system: System, normals: np.ndarray) -> np.ndarray:
    """Where a pair penetrates with features that no place has, they are added; the places that are new.

    Args:
        system: compiled scene, with the bodies at the end of the step.
        normals: of the features in the places, in order, in the world, shape (taken, 3).
    """
    return system.contacts.n_fixed + system.slots.add_missing(system.data, normals, MISSED * system.contacts.length)


def has_rims(system: System) -> bool:
    """A rim is in one of the places."""
    return system.slots.n > 0 and system.slots.has_rims()


def smallest_gap(system: System, q: np.ndarray) -> float:
    """The smallest gap of all contacts at q, or a lower bound of it, in parts of the yardstick; see `gaps`."""
    table = system.contacts
    first, length, others = table.n_fixed, table.length, not_solid(system)
    others = others[~table.soft[others]]
    smallest = float((system.gaps(table.subset(others), q) / table.yardstick[others]).min(initial=1.0))
    if system.slots.n == 0:
        return smallest
    _, normals = system.gaps_and_normals(table.subset(first + np.flatnonzero(system.slots.loaded)), q)
    return min(smallest, system.slots.deepest(system.data, length, normals) / length)


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
        hulls = only_hulls(system, names)
        warnings.warn(f"overlap at q0 and are left out of the contacts: {listed}{more}{hulls}", stacklevel=3)
    return bool(found)


def only_hulls(system: System, names: Iterable[str]) -> str:
    """What to say of contacts that overlap at the present poses where only the convex hull of a mesh does."""
    names = {re.sub(r"\[\d+\]", "", name) for name in names}
    solids = [pair.name for pair in system.slots.pairs if pair.name in names]
    pairs = (
        {f"{p.geometry_a}/{p.geometry_b}": (p.geometry_a, p.geometry_b) for p in system.scene.contacts}
        if solids
        else {}
    )
    return only_hulls_of(system.scene, system.data, [pairs[name] for name in solids if name in pairs])
