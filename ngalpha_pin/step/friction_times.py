"""For how long friction moves the bodies within a step, on which kappa_F depends; its twin is engine/kernel/step.c."""

from __future__ import annotations

import numpy as np

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.contact.table import Subset


def friction_times(sub: Subset, z: np.ndarray, dt: float, carried: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The time that friction has acted before the end of the step, contact by contact, and how it moves with P_N.

    The paper lets an impulsive friction force act for dt/2 (80). Where a contact closes within the step the normal law
    knows better: kappa_hat_N / P_N is the time since the impact, so kappa_hat_F = (kappa_hat_N / P_N) P_F. One that has
    carried before keeps (80): without impulses its friction moves the bodies as its quadrature says, as everything else
    does that acts, so that a contact that sticks stays where it is, whatever load jumps.

    Args:
        sub: contacts.
        z: forces of the contact laws, see `contact.laws`, shape (n_c,).
        dt: step [s].
        carried: contacts with a force at the start of the step, shape (k,).

    Returns:
        ratio: kappa_hat_N / P_N between zero and dt, or dt/2, shape (k,) [s].
        share: P_F / P_N where that ratio is free to move, zero elsewhere, shape (m,) [-].
    """
    k = sub.k
    P_N, P_F = z[k : 2 * k], z[2 * k : 2 * k + sub.m]
    carries = (P_N > TINY) & ~carried
    safe = np.where(carries, P_N, 1.0)
    free = np.where(carries, z[:k] / safe, dt / 2)
    ratio = np.minimum(np.maximum(free, 0.0), dt)
    return ratio, P_F * ((carries & (free == ratio)) / safe)[sub.of_F]
