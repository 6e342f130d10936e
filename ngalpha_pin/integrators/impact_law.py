"""An impact at its own moment: the laws (43)-(49) between the velocities on its two sides.

With Newton's law this is the limit dt -> 0 of the equations of a step: the gaps vanish, M (v+ - v-) = W P (78), and
(133)-(139) hold for all contacts that are closed, those that were closed before included. Constraints take part with
g_dot = 0 and gamma = 0 after the impact; a torque of joint friction is bounded and has no percussion.
Poisson's and Stronge's laws follow the impact through compression and expansion, see `numerics.two_phases`, with all
contacts that their percussions move; others at the same moment are an impact of their own.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.contact.table import Subset
from ngalpha_pin.initialization.initial import closed_contacts
from ngalpha_pin.numerics.gauss_seidel import FreeProblem, solve_contact_problem, violation
from ngalpha_pin.numerics.two_phases import coupled
from ngalpha_pin.step.velocity_problem import VelocityProblem, two_phases, velocity_problem
from ngalpha_pin.system.state import Impact
from ngalpha_pin.system.system import System

# the second tolerance where many contacts have dependent directions: what rounding leaves open among them
SWEEP_TOL, ROUGH_TOL, MAX_SWEEPS = 1e-14, 1e-9, 2000
MAX_CURVE = 60  # iterations for coefficients that depend on the slip
# largest violation of the laws, in parts of the velocity of approach or of what a new constraint meets: a tenth of what
# the audit allows
LAWS = 1e-7


def impact(system: System, t: float, q: np.ndarray, v: np.ndarray) -> Impact | None:
    """The impact of a motion that arrives at (t, q) with the velocity v, or None where its percussions are not found.

    Args:
        system: compiled scene.
        t: time [s].
        q: configuration, shape (nq,).
        v: velocity before the impact, shape (nv,).
    """
    system.place(q)
    sub = closed_contacts(system, q)
    if sub.k == 0 and not system.constraints.names:  # a compliant contact begins to press
        nothing, none = np.zeros(0), np.zeros(0, dtype=int)
        return Impact(t, q, v, v, none, nothing, nothing, np.zeros(0), system.slots.contents())
    problem = velocity_problem(system, t, q, v, sub)
    rates, free = problem.rows.rate, problem.free
    P = _of_both(sub, problem) if sub.phases else _newton(sub, free, rates)
    if P is None:
        return None
    P_b, slots = free.constraint_forces(P), system.slots.contents()
    jump = problem.by_M @ np.concatenate((P, P_b))
    return Impact(t, q, v, v + jump, sub.index, P[: sub.k], P[sub.k :], P_b, slots)


def _of_both(sub: Subset, problem: VelocityProblem) -> np.ndarray | None:
    """Percussions (k + m,) of contacts some of which have Poisson's or Stronge's law; None where they are not found."""
    free, in_phases = problem.free, coupled(problem.G, sub.of_row, sub.in_phases)
    if in_phases.all():
        return two_phases(sub, free)
    P = np.zeros(sub.k + sub.m)
    for chosen in (in_phases, ~in_phases):
        part, rows = sub.table.subset(sub.index[chosen]), np.flatnonzero(chosen[sub.of_row])
        own = FreeProblem(free.G[np.ix_(rows, rows)], free.b[rows], len(rows))
        own.met = max(free.met, -float(free.b[: sub.k].min()))  # rounding is measured by the impact as a whole
        found = two_phases(part, own) if chosen is in_phases else _newton(part, own, problem.rows.rate[rows])
        if found is None:
            return None
        P[rows] = found
    return P


def _newton(sub: Subset, free: FreeProblem, rates: np.ndarray) -> np.ndarray | None:
    """Percussions of Newton's law (k + m,), or None where they are not found."""
    e, cones = sub.restitution(rates), sub.cones
    b = free.b + e * rates  # (44), (48) without percussions
    P, mu = np.zeros(sub.k + sub.m), cones.coefficients(rates[sub.k :])[0]
    for _ in range(MAX_CURVE):
        used = mu
        for tol in (SWEEP_TOL, ROUGH_TOL):
            given = free.G, b, used, cones.of_row, P
            P, converged, _ = solve_contact_problem(*given, tol, MAX_SWEEPS, of_cone=cones.contact)
            if converged:
                break
        if not cones.curves:
            break
        # the coefficient is that of the slip that is left
        mu = cones.coefficients((b + free.G @ P - e * rates)[sub.k :])[0]
        if np.abs(mu - used).max(initial=0.0) <= SWEEP_TOL:
            break
    # percussions of dependent directions may have become so large that a small part of them is no measure
    approach = max(-float(b[: sub.k].min(initial=0.0)), free.met)
    off = violation(free.G, b, mu, cones.of_row, P, of_cone=cones.contact)
    return P if converged and off <= LAWS * approach else None
