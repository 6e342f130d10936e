"""Events of pairs of geometries: a foot lands once, however many of its corners touch."""

from __future__ import annotations

import numpy as np

from ngalpha_pin.common.tolerances import RECORDED
from ngalpha_pin.results.cones import cones_of
from ngalpha_pin.results.events import Event, speeds
from ngalpha_pin.results.recorded import Recorded
from ngalpha_pin.results.sensors.bodies import pair_name, pairs_of

# impacts of one pair that are nearer to each other than this part of a step are one
TOGETHER = 1e-6


def pair_events(trajectory: Recorded) -> list[Event]:
    """See `Sensors.pair_events`."""
    pairs, table = pairs_of(trajectory.system, trajectory.contact_columns), trajectory.system.contacts
    motion, t = trajectory.contact_motion, trajectory.t
    closed = motion.g_N <= RECORDED * table.yardstick[trajectory.contact_columns]
    none = speeds(trajectory)[1]
    declared = {f"{pair.geometry_a}/{pair.geometry_b}": pair for pair in trajectory.scene.contacts}
    of_pair: dict[str, list[Event]] = {name: [] for name in pairs.names}
    limits = {trajectory.contact_names[column] for column in np.flatnonzero(pairs.of_column < 0)}
    for event in trajectory.events:
        if event.contact not in limits and pair_name(event.contact, declared) in of_pair:
            of_pair[pair_name(event.contact, declared)].append(event)
    events, cones = [], cones_of(trajectory)
    for number, name in enumerate(pairs.names):
        columns = np.flatnonzero(pairs.of_column == number)
        touches = closed[:, columns].any(axis=1)
        slips, rolls = np.zeros((2, len(t)), dtype=bool)
        for cone in np.flatnonzero(np.isin(cones.contact, columns)).tolist():
            sliding = np.linalg.norm(motion.gamma_F[:, cones.rows[cone]], axis=1) > none
            moves = slips if cone < len(pairs.of_column) else rolls
            moves |= sliding & closed[:, cones.contact[cone]]
        events += _of_pair(name, t, touches, slips, rolls, of_pair[name])
    return sorted(events, key=lambda event: event.t)


def _of_pair(
    name: str, t: np.ndarray, touches: np.ndarray, slips: np.ndarray, rolls: np.ndarray, corners: list[Event]
) -> list[Event]:
    """Events of one pair from what its corners do."""
    found, told = [], set()
    for kind, changes, of_corner in (
        ("lands", touches[1:] & ~touches[:-1], ("impact", "closed")),
        ("leaves", ~touches[1:] & touches[:-1], ("lift-off",)),
        ("slips", slips[1:] & ~slips[:-1] & touches[:-1], ("slip",)),
        ("sticks", ~slips[1:] & slips[:-1] & touches[1:], ("stick",)),
        ("rolls", rolls[1:] & ~rolls[:-1] & touches[:-1], ("roll",)),
        ("rests", ~rolls[1:] & rolls[:-1] & touches[1:], ("rest",)),
    ):
        for i in np.flatnonzero(changes):
            within = [e for e in corners if t[i] < e.t <= t[i + 1] and e.kind in of_corner]
            moment = (min if kind in ("lands", "slips", "rolls") else max)(
                (e.t for e in within), default=float(t[i + 1])
            )
            found.append(Event(moment, kind, name))
            if kind == "lands":
                told |= {e for e in within if e.t - moment <= TOGETHER * (t[i + 1] - t[i])}
    last = -np.inf
    for event in corners:
        if event.kind == "impact" and event not in told:
            step = np.searchsorted(t, event.t)
            if event.t - last > TOGETHER * (t[step] - t[max(step - 1, 0)]):
                found.append(Event(event.t, "impact", name))
            last = event.t
    return found
