"""Forces of contacts by pair: what each pair of geometries does to the body of its contact points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.results.recorded import Recorded
from ngalpha_pin.results.sensors.bodies import Pairs, pairs_of, sides
from ngalpha_pin.results.sensors.wrench_at import WrenchAt
from ngalpha_pin.system.system import System


class PairWrenches(NamedTuple):
    """Of every pair over time, about the origin of the world, in the axes of the world.

    Attributes:
        pairs: which they are, p of them.
        force: shape (n + 1, p, 6) [N, N m].
        impulsive: impulsive part of the percussions of the step that ends there, likewise [N s, N m s].
        percussion: all of them, likewise.
        weight: normal force, or percussion where there is none, shape (n + 1, p) [N or N s].
        place: contact points times that weight, shape (n + 1, p, 3).
    """

    pairs: Pairs
    force: np.ndarray
    impulsive: np.ndarray
    percussion: np.ndarray
    weight: np.ndarray
    place: np.ndarray


def pair_wrenches(trajectory: Recorded) -> PairWrenches:
    """Sums over the contacts of every pair, at the places at which they are at the recorded times."""
    system, n = trajectory.system, len(trajectory.t)
    pairs = pairs_of(system, trajectory.contact_columns)
    p = len(pairs.names)
    force, impulsive, percussion = np.zeros((3, n, p, 6))
    found = PairWrenches(pairs, force, impulsive, percussion, np.zeros((n, p)), np.zeros((n, p, 3)))
    acts = (trajectory.P_N != 0.0) | (trajectory.la_N != 0.0)
    acts[:, pairs.of_column < 0] = False
    rows_F = [np.arange(rows.start, rows.stop) for rows in trajectory.friction_rows]
    for i in np.flatnonzero(acts.any(axis=1)).tolist():
        columns = np.flatnonzero(acts[i])
        friction = np.concatenate([rows_F[column] for column in columns])
        F, points, of_row = wrench_rows(trajectory, i, trajectory.contact_columns[columns])
        of_contact = pairs.of_column[columns]
        for total, N, T in (
            (found.force, trajectory.la_N, trajectory.la_F),
            (found.impulsive, trajectory.La_N, trajectory.La_F),
            (found.percussion, trajectory.P_N, trajectory.P_F),
        ):
            acting = np.concatenate((N[i, columns], T[i, friction]))
            np.add.at(total[i], of_contact[of_row], acting[:, None] * F)
        N = trajectory.la_N[i, columns]
        weight = N if N.any() else trajectory.P_N[i, columns]
        np.add.at(found.weight[i], of_contact, weight)
        np.add.at(found.place[i], of_contact, weight[:, None] * points)
    return found


def wrench_rows(trajectory: Recorded, i: int, contacts: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Wrenches of unit forces on the bodies of some contact points at a recorded time.

    Args:
        trajectory: the run.
        i: number of the time.
        contacts: their numbers, no limits of joints among them, shape (k,).

    Returns:
        Wrenches about the origin of the world, shape (k + m, 6); the points of contact, shape (k, 3) [m]; the contact
        of each row, shape (k + m,).
    """
    system = trajectory.system
    system.slots.restore_one(trajectory.slots, trajectory.slot_ends, i)
    return moved_wrenches(system, contacts, trajectory.q[i], trajectory.v[i])


def moved_wrenches(
    system: System, contacts: np.ndarray, q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """See `wrench_rows`; the features of shapes are those that are loaded."""
    sub = system.contacts.subset(contacts)
    system.contact_rates(sub, q, v)  # puts the bodies there
    rows = system.contact_rows(sub, q, v, np.zeros_like(v))
    inside = sub.radius * (sub.index < system.contacts.n_fixed)
    return rows.F, rows.c - inside[:, None] * rows.normals, sub.of_row  # type: ignore[union-attr]


def step_lengths(trajectory: Recorded) -> np.ndarray:
    """Length of the step that ends at each recorded time, shape (n + 1,) [s]."""
    before = trajectory.t[0] - (trajectory.final_state.whole or trajectory.final_state.dt or trajectory.dt)
    return np.diff(trajectory.t, prepend=before)


def contact_force(trajectory: Recorded, body: str, other: str | None, mean: bool) -> WrenchAt:
    """See `Sensors.contact_force`."""
    found = trajectory.pair_wrenches
    side = sides(trajectory.scene, found.pairs, body, other)
    if checks.flag("mean", mean) or trajectory.on_velocity_level:
        return WrenchAt.of_origin(np.einsum("p,npi->ni", side, found.percussion) / step_lengths(trajectory)[:, None])
    return WrenchAt.of_origin(np.einsum("p,npi->ni", side, found.force))


def contact_percussion(trajectory: Recorded, body: str, other: str | None) -> WrenchAt:
    """See `Sensors.contact_percussion`."""
    found = trajectory.pair_wrenches
    side = sides(trajectory.scene, found.pairs, body, other)
    return WrenchAt.of_origin(np.einsum("p,npi->ni", side, found.impulsive))


def contact_point(trajectory: Recorded, body: str, other: str | None) -> np.ndarray:
    """See `Sensors.contact_point`."""
    found = trajectory.pair_wrenches
    side = np.abs(sides(trajectory.scene, found.pairs, body, other))
    weight = found.weight @ side
    place = np.einsum("p,npi->ni", side, found.place)
    carries = weight > 0.0
    return np.where(carries[:, None], place / np.where(carries, weight, 1.0)[:, None], np.nan)
