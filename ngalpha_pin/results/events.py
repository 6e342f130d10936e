"""Events of a run, found in its arrays: impacts, lift-offs, changes between slip and stick, between roll and rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import CLOSED, RECORDED, TINY
from ngalpha_pin.results.cones import cones_of

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded

# a jump of the gap rate, or an impulse, counts as an impact from this many times what the weight does in a step
IMPACT = 5.0
# an impulsive part of this size, relative to the percussion of the force before, is an impact of a closed contact
SUDDEN = 0.4
# a slip velocity counts as slip from this part of the largest contact velocity of the run, and from what is rounding of
# any motion, see `contact_search.contact_speed`: in a run at rest the largest velocity is rounding as well
SLIP = 1e-6
# what a cone begins to do, and what it comes to: those of slip, and those of rolling
KINDS = (("slip", "stick"), ("roll", "rest"))


class Event(NamedTuple):
    """Something that happened within a step.

    Attributes:
        t: the moment of a located impact, otherwise the end of the step [s].
        kind: "impact", "closed" (without impact), "lift-off", "slip" or "stick"; with rolling resistance "roll" or
            "rest".
        contact: name of the contact.
    """

    t: float
    kind: str
    contact: str


def find_events(trajectory: Recorded) -> list[Event]:
    """Events in the order of time."""
    motion, events = trajectory.contact_motion, []
    table = trajectory.system.contacts
    gravity = float(np.linalg.norm(trajectory.scene.model.gravity.linear))
    closed = motion.g_N <= RECORDED * table.yardstick[trajectory.contact_columns]
    speed, none = speeds(trajectory)
    at, cones = trajectory.impacts.step, cones_of(trajectory)
    of_contact: list[list[slice]] = [[] for _ in trajectory.contact_names]
    for k, rows in zip(cones.contact.tolist(), cones.rows, strict=True):
        of_contact[k].append(rows)
    for k, name in enumerate(trajectory.contact_names):
        hits = trajectory.impacts.P_N[:, k] > 0.0
        events += [Event(float(t), "impact", name) for t in trajectory.impacts.t[hits]]
        known = np.isin(np.arange(len(trajectory.t)), at[hits])
        events += [Event(t, kind, name) for t, kind in _normal(trajectory, k, closed[:, k], known, gravity, speed)]
        for kinds, rows in zip(KINDS, of_contact[k], strict=False):
            changes = _friction(trajectory.t, closed[:, k], motion.gamma_F[:, rows], none)
            events += [Event(t, kinds[ends], name) for t, ends in changes]
    return sorted(events, key=lambda event: event.t)


def speeds(trajectory: Recorded) -> tuple[float, float]:
    """The largest contact velocity of a run, and the slip that counts as none [m/s]."""
    motion = trajectory.contact_motion
    speed = max(float(np.abs(motion.g_N_dot).max(initial=0.0)), float(np.abs(motion.gamma_F).max(initial=0.0)), TINY)
    return speed, max(SLIP * speed, CLOSED * trajectory.system.contacts.speed)


def _normal(
    trajectory: Recorded, k: int, closed: np.ndarray, known: np.ndarray, gravity: float, speed: float
) -> list[tuple[float, str]]:
    """Impact, closing and lift-off of one contact, without the impacts of the steps in which they are known."""
    t, g_N_dot = trajectory.t, trajectory.contact_motion.g_N_dot[:, k]
    carries = trajectory.P_N[:, k] > 0
    dt = np.diff(t, prepend=t[0])
    jump = np.diff(g_N_dot, prepend=g_N_dot[0])
    impulse = trajectory.La_N[:, k]
    threshold = IMPACT * gravity * dt + RECORDED * speed
    stays = closed & np.roll(closed, 1) & (np.abs(np.roll(g_N_dot, 1)) <= RECORDED * speed)
    before = np.abs(np.roll(trajectory.la_N[:, k], 1)) * dt
    # an impact without collision (10.4), or passed on by another contact, is what the force before cannot explain;
    # a contact that hands its load over to others loses force as well, but nothing jumps
    slip = trajectory.contact_motion.gamma_F[:, trajectory.friction_rows[k]]
    jerked = np.linalg.norm(np.diff(slip, axis=0, prepend=slip[:1]), axis=1) > threshold
    sudden = stays & (before > 0) & (np.abs(impulse) > SUDDEN * before) & ((impulse > 0) | jerked)
    # friction can make an impulse of any size out of next to no approach
    weight = gravity * sum(inertia.mass for inertia in trajectory.scene.model.inertias)
    violent = (weight > 0) & (impulse > IMPACT * weight * dt)
    impact = carries & ((impulse > 0) & (jump > threshold) | sudden | violent)
    impact[0] = False
    found = [(float(t[i]), "impact") for i in np.flatnonzero(impact & ~known)]
    impact |= known
    touched, force = closed & carries, trajectory.la_N[:, k] > 0.0
    for i in range(1, len(t)):
        if touched[i] and not closed[i - 1] and not impact[i]:
            found.append((float(t[i]), "closed"))
        # what touches at an impact on the end of a step, and carried nothing before, does not lift off besides
        elif not closed[i] and closed[i - 1] and (force[i - 1] or not (known[i] or known[i - 1])):
            found.append((float(t[i]), "lift-off"))
    return found


def _friction(t: np.ndarray, closed: np.ndarray, gamma_F: np.ndarray, none: float) -> list[tuple[float, int]]:
    """Begin (0) and end (1) of the slip of one cone while its contact stays closed; slip that turns back begins."""
    stays, slips = closed[1:] & closed[:-1], np.linalg.norm(gamma_F, axis=1) > none
    back = stays & slips[1:] & slips[:-1] & ((gamma_F[1:] * gamma_F[:-1]).sum(axis=1) < 0.0)
    began, ended = stays & slips[1:] & ~slips[:-1], stays & ~slips[1:] & slips[:-1]
    return [(float(x), 0) for x in t[1:][began | back]] + [(float(x), 1) for x in t[1:][ended]]
