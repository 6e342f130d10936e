"""What a smooth phase starts with: forces of its contacts, and which of them, and of the joints, slip."""

from __future__ import annotations

import numpy as np

from ngalpha_pin.contact.table import Subset
from ngalpha_pin.initialization.initial import joint_speed
from ngalpha_pin.system.contact_search import contact_speed
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

EDGE = 1e-9  # a sticking force this close to its cone slips


def forces_of(system: System, state: State, sub: Subset) -> tuple[np.ndarray, np.ndarray]:
    """Forces of some contacts, zero where a state does not know them, shapes (k,) and (m,) [N]."""
    known = system.contacts.subset(state.contacts)
    N, F = np.zeros(system.contacts.n), np.zeros(int(system.contacts.n_F.sum()))
    N[known.index], F[known.rows_F] = state.la_N, state.la_F
    return N[sub.index], F[sub.rows_F]


def turning(system: System, v: np.ndarray, tau_f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which joints with dry friction are stuck, and the direction in which the others turn or begin to, shapes (f,).

    Args:
        system: compiled scene.
        v: velocity, shape (nv,).
        tau_f: torques of their friction, shape (f,) [N m or N].
    """
    lower, upper = system.joint_friction.bounds
    rate = v[system.joint_friction.dofs]
    turns = np.abs(rate) > joint_speed(system)
    moving = turns | (tau_f <= lower * (1 - EDGE)) | (tau_f >= upper * (1 - EDGE))
    return ~moving, np.where(turns, np.sign(rate), -np.sign(tau_f)) * moving


def slipping(
    system: System, t: float, state: State, sub: Subset, la_N: np.ndarray, la_F: np.ndarray, idle: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which cones slip, the direction of slip, and which of them begin to, shapes (c,), (m,) and (c,).

    Args:
        system: compiled scene.
        t: time of what is given [s].
        state: with consistent accelerations.
        sub: the closed contacts.
        la_N: their normal forces, shape (k,) [N].
        la_F: their friction, shape (m,) [N].
        idle: cones that carry no force, shape (c,).
    """
    k, cones, of = sub.k, sub.cones, sub.cones.contact
    system.dynamics(t, state.q, state.v, state.a)
    rows = system.contact_rows(sub, state.q, state.v, state.a, t)
    gamma_F = rows.rate[k:]
    fast = cones.sizes(gamma_F) > contact_speed(system, rows)
    on_edge = cones.sizes(la_F) >= cones.mu * la_N[of] * (1 - EDGE)
    on_edge &= (la_N[of] > 0.0) | ~np.isin(of, sub.soft)
    slips = (fast | on_edge | idle) & (cones.rows > 0)
    # slip that begins is against the force: its acceleration can be nothing but rounding
    begins = np.where((la_N > 0.0)[sub.of_F], -la_F, rows.acceleration[k:])
    direction = cones.unit(np.where(fast[cones.of_row], gamma_F, begins))[0]
    return slips, direction, slips & ~fast
