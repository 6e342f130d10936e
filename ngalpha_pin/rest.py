"""The end of bounces that accumulate: a bounce lower than a tolerance is none, its contact closes."""

from __future__ import annotations

import numpy as np

from .initial import closed_contacts, consistent_state
from .smooth_phase import smallest_change
from .system import System


def settled(
    system: System, t: float, q: np.ndarray, v: np.ndarray, height: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """The velocity without the rise of those closed contacts that would fall back from below a height [m].

    Args:
        system: compiled scene.
        t: time [s].
        q: configuration, shape (nq,).
        v: velocity after an impact, shape (nv,).
        height: what counts as no bounce [m].

    Returns:
        The nearest velocity, shape (nv,), the contacts that are closed then and their percussions in normal direction;
        or None where every contact stays closed or bounces higher.
    """
    state = consistent_state(system, t, q, v)
    M = system.dynamics(t, q, v, state.a).M.copy()
    sub = closed_contacts(system, q)
    rows = system.contact_rows(sub, q, v, state.a)
    rate, falls = rows.rate[: sub.k], -rows.acceleration[: sub.k]
    resting = np.isin(sub.index, state.contacts)
    low = ~resting & (rate > 0.0) & (rate * rate < 2.0 * height * falls)
    if not low.any():
        return None
    keeps = resting | low
    sticks = resting[sub.of_F] & (np.abs(rows.rate[sub.k :]) <= 1e-9 * max(rows.sizes[1], 1e-300))
    W = system.directions([rows])[np.concatenate((keeps, sticks))]
    error = np.concatenate((rate[keeps], rows.rate[sub.k :][sticks]))
    if system.constraints.names:
        constraints = system.constraint_rows(t, q, v, state.a)
        W, error = np.concatenate((W, system.directions([constraints]))), np.concatenate((error, constraints.rate))
    change, P = smallest_change(M, W, error)
    return v + change, sub.index[keeps], P[: int(keeps.sum())]
