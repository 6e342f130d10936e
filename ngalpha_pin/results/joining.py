"""Runs that follow each other as one: chunks of one scene, and the parts between changes of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.transfer import places, places_of
from ngalpha_pin.results.records import Impacts, Kept
from ngalpha_pin.results.replay import ConstraintMotion
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.system import System

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded

OVER_TIME = ("t", "q", "v", "a", "tau", "tau_step", "tau_f", "P_f", "n_iter", "solver_path")
OF_CONTACTS = ("P_N", "la_N", "La_N", "adhesion")
OF_FRICTION = ("P_F", "la_F", "La_F")


class Columns(NamedTuple):
    """Columns of a joined run, and where those of each part are among them.

    Attributes:
        contacts: numbers of the contacts in the scene of the joined run, shape (k,).
        names: theirs.
        friction_rows: slice of each contact into the arrays of friction.
        g, gamma: names of the rows of constraints.
        of_contacts, of_friction, of_g, of_gamma: one array of places per part.
    """

    contacts: np.ndarray
    names: tuple[str, ...]
    friction_rows: tuple[slice, ...]
    g: tuple[str, ...]
    gamma: tuple[str, ...]
    of_contacts: list[np.ndarray]
    of_friction: list[np.ndarray]
    of_g: list[np.ndarray]
    of_gamma: list[np.ndarray]


def check_follows(parts: Sequence[Recorded]) -> None:
    """Each part begins where the one before ends.

    Raises:
        SceneError: it does not, or there are none.
    """
    if not parts:
        raise SceneError("there are no runs to join")
    for i, (a, b) in enumerate(zip(parts, parts[1:], strict=False)):
        if a.t[-1] != b.t[0] or not np.array_equal(a.q[-1], b.q[0]):
            raise SceneError(
                f"run {i + 1} begins at t = {b.t[0]:g} s where run {i} has not ended: it ends at t = {a.t[-1]:g} s"
            )


def joined_fields(parts: Sequence[Recorded], scene: Scene, system: System) -> dict[str, Any]:
    """The arrays of several runs as those of one.

    Of the moment at which one ends and the next begins it has the end; an impact there is one of the next step.

    Args:
        parts: checked by `check_follows`, with the same coordinates.
        scene: of the joined run, with every contact of all of them.
        system: that scene, compiled.
    """
    columns = _columns(parts, system)
    first, last = parts[0], parts[-1]
    k = len(columns.contacts)
    m = columns.friction_rows[-1].stop if k else 0
    kinds: list[tuple[tuple[str, ...], int, list[np.ndarray]]] = [
        (OF_CONTACTS, k, columns.of_contacts), (OF_FRICTION, m, columns.of_friction),
        (("la_g", "La_g"), len(columns.g), columns.of_g),
        (("la_gamma", "La_gamma"), len(columns.gamma), columns.of_gamma),
    ]  # fmt: skip
    found: dict[str, Any] = {
        name: np.concatenate([getattr(p, name)[i > 0 :] for i, p in enumerate(parts)]) for name in OVER_TIME
    }
    for names, width, at in kinds:
        for name in names:
            found[name] = np.concatenate([
                spread(getattr(p, name)[i > 0 :], at[i], width) for i, p in enumerate(parts)
            ])  # fmt: skip
    found |= {"friction_rows": columns.friction_rows, "contact_names": columns.names}
    found |= {"contact_columns": columns.contacts, "n_g": len(columns.g)}
    found |= {"constraint_names": columns.g + columns.gamma, "friction_names": first.friction_names}
    found |= {"scene": scene, "method": first.method, "dt": first.dt, "success": last.success}
    found |= {"message": last.message, "final_state": last.final_state, "entry": first.entry}
    found["slots"], found["slot_ends"] = _slots(parts, system)
    found["impacts"] = _impacts(parts, columns, found, system)
    return found


def joined_kept(parts: Sequence[Recorded]) -> Kept | None:
    """What the files of several chunks say beside their scenes; None of runs that were computed."""
    kept = [p.kept for p in parts]
    if any(k is None for k in kept):
        return None
    motion = ConstraintMotion(*(
        np.concatenate([getattr(k.constraint_motion, name)[i > 0 :] for i, k in enumerate(kept)])
        for name in ConstraintMotion._fields
    ))  # fmt: skip
    elastic = np.concatenate([k.elastic[i > 0 :] for i, k in enumerate(kept)])
    return Kept(motion, elastic, all(k.conserved for k in kept), any(k.has_forces for k in kept))


def spread(values: np.ndarray, at: np.ndarray, width: int, empty: float = 0.0) -> np.ndarray:
    """Columns at their places among others, shape (n, width)."""
    wide = np.full((len(values), width), empty)
    wide[:, at] = values
    return wide


def columns_of(parts: Sequence[Recorded], names: Sequence[str], what: str) -> list[np.ndarray]:
    """Where the columns of each part are among those with some names."""
    return [places_of(getattr(part, what), names) for part in parts]


def _columns(parts: Sequence[Recorded], system: System) -> Columns:
    table = system.contacts
    number = {name: i for i, name in enumerate(table.names)}
    missing = {name for p in parts for name in p.contact_names if name not in number}
    if missing:
        raise SceneError(f"the runs cannot be joined: the scene has no contact {sorted(missing)[0]!r}")
    used = sorted({number[name] for p in parts for name in p.contact_names})
    sub = table.subset(np.array(used, dtype=int))
    counts = np.bincount(sub.of_F, minlength=sub.k)
    ends = np.cumsum(counts)
    rows = tuple(slice(int(end - count), int(end)) for end, count in zip(ends, counts, strict=True))
    of_contacts = columns_of(parts, sub.names, "contact_names")
    of_friction = [
        np.array([i for column in at.tolist() for i in range(rows[column].start, rows[column].stop)], dtype=int)
        for at in of_contacts
    ]
    levels = [[p.constraint_names[: p.n_g] for p in parts], [p.constraint_names[p.n_g :] for p in parts]]
    g, gamma = (_union(names) for names in levels)
    of_g, of_gamma = (
        [places_of(names, every) for names in level] for level, every in zip(levels, (g, gamma), strict=True)
    )
    return Columns(sub.index, sub.names, rows, g, gamma, of_contacts, of_friction, of_g, of_gamma)


def _union(lists: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Names in the order of their first appearance, each as often as the list that has it most often."""
    found: list[str] = []
    for names in lists:
        for name in dict.fromkeys(names):
            found += [name] * max(0, list(names).count(name) - found.count(name))
    return tuple(found)


def _slots(parts: Sequence[Recorded], system: System) -> tuple[np.ndarray, np.ndarray]:
    """Features at all times with the places of the joined run."""
    rows, ends, total = [], [], 0
    for i, part in enumerate(parts):
        start = int(part.slot_ends[0]) if i else 0
        rows.append(_moved(part.slots[start:], part.system, system))
        ends.append(part.slot_ends[i > 0 :] - start + total)
        total = int(ends[-1][-1]) if len(ends[-1]) else total
    return np.concatenate(rows), np.concatenate(ends)


def _moved(slots: np.ndarray, a: System, b: System) -> np.ndarray:
    """Features of some times of one system with the places of another one."""
    if not len(slots) or a is b:
        return slots
    moved = slots.copy()
    moved[:, 0] = places(a, b).slots[slots[:, 0].astype(int)]
    return moved


def _impacts(parts: Sequence[Recorded], columns: Columns, found: dict[str, Any], system: System) -> Impacts:
    """The impacts of all parts; those at which parts begin belong to the next step, with their percussions."""
    kinds = [(OF_CONTACTS[0], columns.of_contacts), (OF_FRICTION[0], columns.of_friction)]
    widths = {"P_N": len(columns.contacts), "P_F": found["P_F"].shape[1]}
    lists: dict[str, list[np.ndarray]] = {name: [] for name in Impacts._fields}
    first, total = 0, 0
    for i, part in enumerate(parts):
        at_start = i and part.entry is not None
        for hits, entry in ((part.entry, True), (part.impacts, False)) if at_start else ((part.impacts, False),):
            step = hits.step + first + entry
            n_g, b = part.n_g, len(columns.g)
            P = {name: spread(getattr(hits, name), at[i], widths[name]) for name, at in kinds}
            P_g = spread(hits.P_b[:, :n_g], columns.of_g[i], b)
            P_gamma = spread(hits.P_b[:, n_g:], columns.of_gamma[i], len(columns.gamma))
            P["P_b"] = np.hstack((P_g, P_gamma))
            slots = _moved(hits.slots, part.system, system)
            values = {**hits._asdict(), **P, "step": step, "slots": slots, "slot_ends": hits.slot_ends + total}
            total += len(slots)
            for name, value in values.items():
                lists[name].append(value)
            if entry and int(step[0]) < len(found["t"]):
                for name, value in (
                    ("P_N", P["P_N"]), ("La_N", P["P_N"]), ("P_F", P["P_F"]), ("La_F", P["P_F"]),
                    ("La_g", P_g), ("La_gamma", P_gamma),
                ):  # fmt: skip
                    found[name][int(step[0])] += value[0]
        first += len(part.t) - 1
    inside = np.concatenate(lists["step"]) < len(found["t"])
    joined = {name: np.concatenate(value) for name, value in lists.items()}
    if not inside.all():  # the run ends with a change
        keep = {name: joined[name][inside] for name in joined if name != "slots"}
        last = int(keep["slot_ends"][-1]) if inside.any() else 0
        return Impacts(**keep, slots=joined["slots"][:last])
    return Impacts(**joined)
