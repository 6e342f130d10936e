"""What is over at once: a bounce lower than a tolerance is none, and a slip that stops within one has stopped."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.event_driven.smooth_phase import smallest_change
from ngalpha_pin.initialization.initial import closed_contacts, consistent_state
from ngalpha_pin.system.system import System

# a slip stops at once where its speed times the time to its end is below this part of the height that is no bounce
STOP = 1e-2


class Settled(NamedTuple):
    """A motion whose low bounces and short slips are over.

    Attributes:
        v: nearest velocity without them, shape (nv,).
        contacts: those that are closed then, shape (k,).
        P_N, P_F: their percussions, shapes (k,) and (m,) [N s].
        bounced: a contact that would have bounced is among them.
    """

    v: np.ndarray
    contacts: np.ndarray
    P_N: np.ndarray
    P_F: np.ndarray
    bounced: bool


def settled(system: System, t: float, q: np.ndarray, v: np.ndarray, height: float, slowest: float) -> Settled | None:
    """The velocity without the rise of closed contacts that would fall back from below a height or stop slipping.

    A slip can stop in no time: the more a contact is pressed down by its own friction, the faster it slows down, and
    the forces grow without bound. It stops here where all slipping contacts do, or where it is slow and slows down.

    Args:
        system: compiled scene.
        t: time [s].
        q: configuration, shape (nq,).
        v: velocity after an impact, shape (nv,).
        height: what counts as no bounce [m].
        slowest: slip below this that slows down has stopped [m/s].

    Returns:
        What has settled, or None where every contact stays closed or bounces higher, and slips on.
    """
    state = consistent_state(system, t, q, v)
    M = system.dynamics(t, q, v, state.a).M.copy()
    sub = closed_contacts(system, q)
    if sub.k == 0:
        return None
    rows = system.contact_rows(sub, q, v, state.a)
    rate, falls = rows.rate[: sub.k], -rows.acceleration[: sub.k]
    resting = np.isin(sub.index, state.contacts)
    low = ~resting & (rate > 0.0) & (rate * rate < 2.0 * height * falls)
    gamma_F = rows.rate[sub.k :]
    speed = np.sqrt(np.bincount(sub.of_F, gamma_F**2, sub.k))
    stuck = speed <= 1e-9 * max(rows.sizes[1], 1e-300)
    brakes = -np.bincount(sub.of_F, gamma_F * rows.acceleration[sub.k :], sub.k)  # times the speed
    slips = resting & ~stuck
    stops = slips & (speed <= slowest) & (brakes > 0.0)
    if (speed**3 <= STOP * height * brakes)[slips].all():
        stops = slips
    if not low.any() and not stops.any():
        return None
    keeps = resting | low
    sticks = (resting & (stuck | stops))[sub.of_F]
    W = system.directions([rows])[np.concatenate((keeps, sticks))]
    error = np.concatenate((rate[keeps], gamma_F[sticks]))
    if system.constraints.names:
        constraints = system.constraint_rows(t, q, v, state.a)
        W, error = np.concatenate((W, system.directions([constraints]))), np.concatenate((error, constraints.rate))
    change, P = smallest_change(M, W, error)
    P_N, P_F = np.zeros(sub.k), np.zeros(sub.m)
    P_N[keeps], P_F[sticks] = np.split(P[: keeps.sum() + sticks.sum()], [int(keeps.sum())])
    return Settled(v + change, sub.index[keeps], P_N[keeps], P_F[keeps[sub.of_F]], bool(low.any()))
