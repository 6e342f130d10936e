"""For how long forces move the bodies within a step, on which kappa depends; its twin is engine/kernel/step.c."""

from __future__ import annotations

import numpy as np

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.step.protocol import Equations


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


def normal_displacement(equations: Equations, options: LawOptions, la_N: np.ndarray) -> np.ndarray:
    """What is added to kappa_N in kappa_hat_N (102), shape (k,) [N s^2].

    Of a contact that has carried before it is dt/2 times what its force does to the velocities, as for impulsive
    friction (80). With a quadrature of its own, one that opens would let go of the positions at another moment than of
    the velocities, and move the contacts of the same bodies that stick.

    Args:
        equations: of the step.
        options: laws.
        la_N: normal forces at the end, shape (k,) [N].
    """
    k, known = equations.sub.k, equations._z_known
    carried = equations.carried & (not options.paper)
    of_contact = np.where(carried, equations.dt / 2 * known[k : 2 * k], known[:k])
    return np.asarray(of_contact + normal_displacement_slope(equations, options) * la_N)


def normal_displacement_slope(equations: Equations, options: LawOptions) -> np.ndarray:
    """Derivative of `normal_displacement` by la_N, shape (k,) [s^2]."""
    carried = equations.carried & (not options.paper)
    return np.where(carried, equations.dt / 2 * equations.gamma_c, equations.beta_c)
