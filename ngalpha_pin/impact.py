"""An impact at its own moment: the laws (43)-(49) between the velocities on its two sides.

This is the limit dt -> 0 of the equations of a step: the gaps vanish, M (v+ - v-) = W P (78), and Newton's and
Coulomb's laws (133)-(139) hold for all contacts that are closed, those that were closed before included.
"""

from __future__ import annotations

import numpy as np

from .contact_problem import solve_contact_problem
from .initial import closed_contacts
from .state import Impact
from .system import System

SWEEP_TOL, MAX_SWEEPS = 1e-14, 2000


def impact(system: System, t: float, q: np.ndarray, v: np.ndarray) -> Impact | None:
    """The impact of a motion that arrives at (t, q) with the velocity v, or None where its percussions are not found.

    Args:
        system: compiled scene.
        t: time [s].
        q: configuration, shape (nq,).
        v: velocity before the impact, shape (nv,).
    """
    dynamics = system.dynamics(t, q, v, np.zeros_like(v))
    sub = closed_contacts(system)
    rows = system.contact_rows(sub, v, np.zeros_like(v))
    by_M = np.linalg.solve(dynamics.M, rows.W.T)
    xi = rows.rate * (1.0 + sub.e)  # (44), (48) without percussions
    P, converged, _ = solve_contact_problem(
        rows.W @ by_M, xi, sub.mu, sub.of_F, np.zeros(sub.k + sub.m), SWEEP_TOL, MAX_SWEEPS
    )
    if not converged:
        return None
    return Impact(t, q, v, v + by_M @ P, sub.index, P[: sub.k], P[sub.k :])
