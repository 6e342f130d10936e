"""An impact at its own moment: the laws (43)-(49) between the velocities on its two sides.

This is the limit dt -> 0 of the equations of a step: the gaps vanish, M (v+ - v-) = W P (78), and Newton's and
Coulomb's laws (133)-(139) hold for all contacts that are closed, those that were closed before included. Constraints
take part with g_dot = 0 and gamma = 0 after the impact; a torque of joint friction is bounded and has no percussion.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.contact.kernel_rows import rows_at
from ngalpha_pin.contact.point_rows import KinematicRows
from ngalpha_pin.contact_solvers.gauss_seidel import FreeProblem, solve_contact_problem, violation
from ngalpha_pin.initialization.initial import closed_contacts
from ngalpha_pin.linalg.block_matrix import solve_positive
from ngalpha_pin.system.state import Impact
from ngalpha_pin.system.system import System

# the second tolerance where many contacts have dependent directions: what rounding leaves open among them
SWEEP_TOL, ROUGH_TOL, MAX_SWEEPS = 1e-14, 1e-9, 2000
MAX_CURVE = 60  # iterations for coefficients that depend on the slip
LAWS = 1e-7  # largest violation of the laws, in parts of the velocity of approach: a tenth of what the audit allows


def impact(system: System, t: float, q: np.ndarray, v: np.ndarray) -> Impact | None:
    """The impact of a motion that arrives at (t, q) with the velocity v, or None where its percussions are not found.

    Args:
        system: compiled scene.
        t: time [s].
        q: configuration, shape (nq,).
        v: velocity before the impact, shape (nv,).
    """
    dynamics = system.dynamics(t, q, v, np.zeros_like(v))
    sub, still = closed_contacts(system, q), np.zeros_like(v)
    contacts = rows_at(system, sub, q, v, still, t)
    parts: list[KinematicRows] = [contacts]
    xi = contacts.rate * (1.0 + sub.e)  # (44), (48) without percussions
    if system.constraints.names:  # their rates vanish after it
        constraints = system.constraint_rows(t, q, v, still)
        parts.append(constraints)
        xi = np.concatenate((xi, constraints.rate))
    W = system.directions(parts)
    by_M = solve_positive(dynamics.M, W.T)
    problem = FreeProblem(W @ by_M, xi, sub.k + sub.m)
    P, mu = np.zeros(sub.k + sub.m), sub.coefficients(contacts.rate[sub.k :])[0]
    for _ in range(MAX_CURVE):
        used = mu
        for tol in (SWEEP_TOL, ROUGH_TOL):
            P, converged, _ = solve_contact_problem(problem.G, problem.b, used, sub.of_F, P, tol, MAX_SWEEPS)
            if converged:
                break
        if not sub.curves:
            break
        # the coefficient is that of the slip that is left
        mu = sub.coefficients((problem.b + problem.G @ P - sub.e * contacts.rate)[sub.k :])[0]
        if np.abs(mu - used).max(initial=0.0) <= SWEEP_TOL:
            break
    # percussions of dependent directions may have become so large that a small part of them is no measure
    approach = -float(problem.b[: sub.k].min(initial=0.0))
    if not (converged and violation(problem.G, problem.b, mu, sub.of_F, P) <= LAWS * approach):
        return None
    P_b, slots = problem.constraint_forces(P), system.slots.contents()
    return Impact(t, q, v, v + by_M @ np.concatenate((P, P_b)), sub.index, P[: sub.k], P[sub.k :], P_b, slots)
