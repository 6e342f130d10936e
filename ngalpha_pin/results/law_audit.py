"""The judge of contact laws at the recorded times and over the recorded steps, from arrays alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.common.tolerances import CLOSED, GRAVITY, NO_DIRECTION, TINY
from ngalpha_pin.results.cones import RecordedCones, cones_of
from ngalpha_pin.results.equations import speed_made, speed_of_rest
from ngalpha_pin.results.impact_audit import GAP

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded

# a force that is smaller than this part of the largest one is judged by that part
OWN = 1e-3
# slip velocities below this part of the largest contact velocity have no direction
SLIP = 1e-4
# impulsive part of a percussion that is no impact
CALM = 0.1
# change of the direction of slip within a step that percussions may be off by beyond the one of its ends [-]
TURN = 1e-2
# part of a change of friction that is left of it in the next step: |alpha_m / (1 - alpha_m)| with rho_inf = 0.9
FADES = 0.75
# parts of a step at which its slip is looked at
WITHIN = (0.25, 0.5, 0.75)


class ContactLaws(NamedTuple):
    """Largest violations over a run, in parts of the force or percussion that violates, or of the typical one [-].

    Rolling with a resistance is judged as a slip of its own, with its own coefficient.

    Attributes:
        cone: |la_F| - mu la_N and |P_F| - mu P_N.
        sign: negative la_N or P_N.
        complementarity: a force, or adhesion, at an open contact; a percussion counts where the contact did not touch
            at any known moment of its step.
        slip: friction of a contact that slips or rolls and is not mu times the normal force against the slip (120).
        percussion_slip: the same of percussions in steps in which the contact slips all the time, beyond the turning
            of the slip.
        compliance: normal forces of compliant contacts that are not those of their laws; None where there are none.
    """

    cone: float
    sign: float
    complementarity: float
    slip: float
    percussion_slip: float
    compliance: float | None = None


def judge_contacts(trajectory: Recorded) -> ContactLaws:
    """Violations of the laws of contact."""
    cones, open_ = cones_of(trajectory), ~_touches(trajectory)
    touched = trajectory.impact_laws.touched.copy()
    touched[0] = True  # what the start of a continued run reports came in a step of the run before
    touched[1:] |= ~open_[:-1]
    soft = trajectory.system.contacts.soft[trajectory.contact_columns]
    touched[:, soft] = True  # forces of the end of a contact are felt in the step behind it
    if trajectory.chosen is not None and trajectory.chosen.sampled:
        touched[:] = True  # what touched between recorded times is not known
    cone = sign = complementarity = 0.0
    # forces and percussions of bodies that nothing presses together are rounding
    mass = max(pin.computeTotalMass(trajectory.system.model), TINY)
    weight, stop = CLOSED * mass * GRAVITY, mass * speed_of_rest(trajectory)
    for N, F, without, none in (
        (trajectory.la_N, trajectory.la_F, open_, weight), (trajectory.P_N, trajectory.P_F, open_ & ~touched, stop)
    ):  # fmt: skip
        unit = max(float(np.abs(N).max(initial=0.0)), none)
        size, bound = norms(F, cones.rows), cones.mu * np.maximum(N, 0.0)[:, cones.contact]
        # rolling is a small part of the force: in parts of what bounds it
        least = np.where(np.arange(len(cones.mu)) < N.shape[1], 1.0, cones.mu)
        cone = _worst(
            cone, (size - bound) / (np.maximum(size, least * np.abs(N)[:, cones.contact]) + OWN * unit * least)
        )
        sign = _worst(sign, np.where(soft & (N is trajectory.P_N), 0.0, -N / unit))
        complementarity = _worst(complementarity, np.where(without, np.abs(N), 0.0) / unit)
    # a contact that holds is closed
    pulls = np.where(open_, trajectory.adhesion, 0.0) / max(float(trajectory.adhesion.max(initial=0.0)), TINY)
    complementarity = _worst(complementarity, pulls)
    slips = _slip(trajectory, cones, _of_slip(trajectory, cones), ~open_)
    return ContactLaws(cone, sign, complementarity, *slips, _compliance(trajectory, soft) if soft.any() else None)


def _compliance(trajectory: Recorded, soft: np.ndarray) -> float:
    """Largest distance of normal forces of compliant contacts from their laws, in parts of the largest of them."""
    table, k, worst = trajectory.system.contacts, len(soft), 0.0
    replay = trajectory.replay
    unit = max(float(trajectory.la_N[:, soft].max(initial=0.0)), TINY)
    for column in np.flatnonzero(soft).tolist():
        law = table.compliances[trajectory.contact_columns[column]]
        assert law is not None
        g_N, rate, la_N = replay.g_N[:, column], replay.rate[:, :k][:, column], trajectory.la_N[:, column]
        force = np.where(g_N < 0.0, law(np.maximum(-g_N, 0.0), -rate)[0], 0.0)
        # as it begins to touch a contact has a force, or has none yet
        judged = np.abs(g_N) > GAP * table.yardstick[trajectory.contact_columns[column]]
        worst = _worst(worst, np.where(judged, np.abs(la_N - force), 0.0) / unit)
    return worst


def _touches(trajectory: Recorded) -> np.ndarray:
    """Contacts that touch at the recorded times, or with a method on velocity level near them, shape (n + 1, k)."""
    replay, table = trajectory.replay, trajectory.system.contacts
    gap = GAP * table.yardstick[trajectory.contact_columns]
    if trajectory.on_velocity_level:
        way = np.diff(trajectory.t, prepend=trajectory.t[0])[:, None] * np.abs(replay.start_rate[:, : len(gap)])
        return np.asarray(replay.g_N <= gap + way)
    return np.asarray(replay.g_N <= gap)


def _of_slip(trajectory: Recorded, cones: RecordedCones) -> np.ndarray:
    """Friction coefficients of the slip at every time, shape (n + 1, c)."""
    found, rates = (
        np.tile(cones.mu, (len(trajectory.t), 1)),
        trajectory.replay.rate[:, len(trajectory.contact_columns) :],
    )
    for c, i in enumerate(trajectory.contact_columns.tolist()):
        curve = trajectory.system.contacts.curves[i]
        if curve is not None:
            found[:, c] = curve(np.linalg.norm(rates[:, cones.rows[c]], axis=1))[0]
    return found


def _slip(trajectory: Recorded, cones: RecordedCones, mu: np.ndarray, closed: np.ndarray) -> tuple[float, float]:
    """Violations of the law of slip by forces, and by percussions.

    In a step that captures an impact of many contacts friction is held back a little where it seems to stick, and the
    forces behind it belong to no motion at its end: such a step is not judged. Nor is one in which a contact begins to
    carry that turns its slip back. Where a closed contact gets an impulse, much friction against the slip may have left
    no forces that agree with it at the start of that step.
    """
    rows, of, k, least = cones.rows, cones.contact, closed.shape[1], _no_slip(trajectory)
    d, fast = _directions(trajectory.replay.rate[:, k:], rows, least)
    unit = max(float(np.abs(trajectory.la_N).max(initial=0.0)), TINY)
    calm = (trajectory.solver_path != "captured")[:, None] & ~_turned_back(trajectory)[:, of]
    calm[:-1] &= ((trajectory.La_N[1:] <= CALM * trajectory.P_N[1:]) | ~closed[:-1])[:, of]
    of_forces = _off(trajectory.la_F, mu * trajectory.la_N[:, of], d, rows, OWN * mu * unit)
    if trajectory.chosen is not None:
        of_forces -= NO_DIRECTION * least / np.maximum(norms(trajectory.replay.rate[:, k:], rows), least)
    of_forces = np.where(fast & calm, of_forces, 0.0)
    if trajectory.on_velocity_level or (trajectory.chosen is not None and trajectory.chosen.sampled):
        return _worst(0.0, of_forces), 0.0
    # in a step that begins and ends with slip, and has no impact
    start, fast_start = _directions(trajectory.replay.start_rate[1:, k:], rows, least)
    stays = (closed[1:] & closed[:-1] & ~trajectory.impact_laws.touched[1:])[:, of] & fast[1:] & fast_start
    stays &= calm[1:] & calm[:-1]
    stays &= ~np.isin(trajectory.solver_path[1:], ("slip", "release"))[:, None]  # it may have stuck in between
    # an impulse at any contact, as of a bounce that is left out, turns the slip of the others
    stays &= (np.abs(trajectory.La_N[1:]) <= CALM * trajectory.P_N[1:]).all(axis=1)[:, None]
    unit = max(float(np.abs(trajectory.P_N).max(initial=0.0)), TINY)
    off = _off(trajectory.P_F[1:], mu[1:] * trajectory.P_N[1:, of], d[1:], rows, OWN * mu[1:] * unit)
    # as the direction, the coefficient changes within the step
    off = off - np.abs(np.diff(mu, axis=0)) / np.maximum(mu[1:], TINY)
    turn = np.maximum(norms(d[1:] - start, rows), _swing(trajectory, rows, d[1:], least))
    turn = np.maximum(turn, _remembered(trajectory, cones, mu))
    return _worst(0.0, of_forces), _worst(0.0, np.where(stays, off - 2.0 * turn - TURN, 0.0))


def _turned_back(trajectory: Recorded) -> np.ndarray:
    """Contacts with tangential restitution that begin to carry in the step that ends at a time, shape (n + 1, k).

    Where its last bounces are left out the slip at the end of that step is the one that restitution leaves, and the
    friction there still that of a contact that sticks.
    """
    begins = np.ones(trajectory.la_N.shape, dtype=bool)
    begins[1:] = trajectory.la_N[:-1] <= 0.0
    return begins & (trajectory.system.contacts.e_F[trajectory.contact_columns] > 0.0)


def _swing(trajectory: Recorded, rows: tuple[slice, ...], d: np.ndarray, least: float) -> np.ndarray:
    """By how much the slip within each step is turned against the one at its end, shape (n, c).

    A slip may turn away and come back: rates and accelerations at both ends tell what it does between.
    """
    replay, k = trajectory.replay, len(trajectory.contact_columns)
    h = np.diff(trajectory.t)[:, None]
    swing = np.zeros((len(h), len(rows)))
    if not rows:
        return swing
    first, last = replay.start_rate[1:, k:], replay.rate[1:, k:]
    a_first, a_last = h * replay.acceleration[:-1, k:], h * replay.acceleration[1:, k:]
    for s in WITHIN:
        rest = 1.0 - s
        slip = rest**2 * ((1.0 + 2.0 * s) * first + s * a_first) + s**2 * ((1.0 + 2.0 * rest) * last - rest * a_last)
        swing = np.maximum(swing, norms(_directions(slip, rows, least)[0] - d, rows))
    return swing


def _remembered(trajectory: Recorded, cones: RecordedCones, mu: np.ndarray) -> np.ndarray:
    """What the percussions of each step may still hold of earlier changes of friction, shape (n, c).

    Friction in parts of its bound, as a method with auxiliary variables (71) remembers it.
    """
    rows, N = cones.rows, mu * np.maximum(trajectory.la_N, 0.0)[:, cones.contact]
    part, unit = trajectory.la_F.copy(), max(float(N.max(initial=0.0)), TINY)
    for c, s in enumerate(rows):  # what hardly ever pushes has no direction
        part[:, s] /= OWN * max(float(N[:, c].max(initial=0.0)), OWN * unit) + N[:, c, None]
    change = norms(np.diff(part, axis=0), rows)
    for i in range(1, len(change)):
        np.maximum(change[i], FADES * change[i - 1], out=change[i])
    return change


def _directions(gamma_F: np.ndarray, rows: tuple[slice, ...], least: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors along the slip of every cone, and which slip faster than the least speed."""
    speed, d = norms(gamma_F, rows), gamma_F.copy()
    for c, s in enumerate(rows):
        d[:, s] /= np.maximum(speed[:, c], TINY)[:, None]
    return d, speed > least


def _off(F: np.ndarray, bound: np.ndarray, d: np.ndarray, rows: tuple[slice, ...], least: np.ndarray) -> np.ndarray:
    """Distance of friction from its bound against a direction, in parts of the bound or of the least that counts."""
    against = F.copy()
    for c, s in enumerate(rows):
        against[:, s] += bound[:, c, None] * d[:, s]
    return norms(against, rows) / np.maximum(np.abs(bound) + least, TINY)


def _no_slip(trajectory: Recorded) -> float:
    """Slip velocity that has no direction [m/s]."""
    chosen, fastest = trajectory.chosen, float(np.abs(trajectory.replay.rate).max(initial=0.0))
    slowest = max(SLIP * max(fastest, speed_made(trajectory)), speed_of_rest(trajectory))
    if chosen is None:
        return slowest
    return max(slowest, chosen.atol + chosen.rtol * float(np.abs(trajectory.v).max(initial=0.0)))


def norms(F: np.ndarray, rows: tuple[slice, ...]) -> np.ndarray:
    """Norm of the friction of each cone, shape (n + 1, c)."""
    return np.stack([np.linalg.norm(F[:, s], axis=1) for s in rows], axis=1) if rows else np.zeros((len(F), 0))


def _worst(so_far: float, violations: np.ndarray) -> float:
    """The largest violation; one that is not a number stays."""
    return float(np.maximum(so_far, violations.max(initial=0.0)))
