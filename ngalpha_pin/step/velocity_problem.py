"""What percussions make of the velocities at one moment, and what a step that captures an impact takes from it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import CLOSED
from ngalpha_pin.contact.kernel_rows import rows_at
from ngalpha_pin.contact.laws import rebounds
from ngalpha_pin.contact.point_rows import KinematicRows
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.numerics.block_matrix import solve_positive
from ngalpha_pin.numerics.gauss_seidel import FreeProblem, solve_contact_problem
from ngalpha_pin.numerics.two_phases import Contacts, percussions
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.contact_search import contact_speed
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import ContactRows, System

# tolerance of the percussions that say how much of a bounce leaves no more energy than there was, and bisections
FOUND, BISECTIONS = 1e-9, 30


class VelocityProblem(NamedTuple):
    """Velocities of contacts as percussions change them at a moment.

    Attributes:
        rows: of the contacts, before.
        free: y = b + G P with the rates as b, constraints eliminated.
        by_M: change of the velocity by percussions of contacts and constraints, shape (nv, rows).
        G: Delassus matrix of both, shape (rows, rows) [1/kg].
    """

    rows: ContactRows
    free: FreeProblem
    by_M: np.ndarray
    G: np.ndarray


def velocity_problem(system: System, t: float, q: np.ndarray, v: np.ndarray, sub: Subset) -> VelocityProblem:
    """The problem of some contacts of a motion at (t, q, v)."""
    still = np.zeros_like(v)
    M = system.dynamics(t, q, v, still).M
    rows = rows_at(system, sub, q, v, still, t)
    parts: list[KinematicRows] = [rows]
    rates = rows.rate
    if system.constraints.names:  # their rates vanish after an impact
        constraints = system.constraint_rows(t, q, v, still)
        parts.append(constraints)
        rates = np.concatenate((rates, constraints.rate))
    W = system.directions(parts)
    by_M = solve_positive(M, W.T)
    G = W @ by_M
    return VelocityProblem(rows, FreeProblem(G, rates, sub.k + sub.m), by_M, G)


def two_phases(sub: Subset, free: FreeProblem) -> np.ndarray | None:
    """Percussions (k + m,) of an impact in which contacts have Poisson's or Stronge's law; None where not found.

    Contacts with Newton's law that take part in it follow Poisson's.
    """
    works = np.zeros(sub.k, dtype=bool)
    for i, law in sub.restitutions:
        works[i] = law.law == "stronge"
    e, cones = sub.restitution(free.b)[: sub.k], sub.cones
    process = Contacts(free.G, lambda slip: cones.coefficients(slip)[0], cones.of_row, e, works, cones.contact)
    return percussions(process, free.b)


def rebound(
    system: System, parameters: Parameters, state: State, sub: Subset, rates: np.ndarray | None, carried: np.ndarray
) -> np.ndarray | None:
    """What restitution adds to the rates at the end of a step that captures impacts, (k + m,) [m/s]; None is nothing.

    With Newton's law see `rebounds`. Otherwise the normal velocities are those which the impact of the contacts that
    approach would leave, or the same part of all of them that leaves no more energy than there was.

    Args:
        system: compiled scene.
        parameters: of the method.
        state: start of the step.
        sub: contacts.
        rates: g_N_dot and gamma_F at the start, shape (k + m,) [m/s]; None where they are not needed.
        carried: contacts with a force at the start, shape (k,).
    """
    if rates is None or not sub.bounces:
        return None
    if not sub.phases:
        return rebounds(sub, rates, carried, parameters.paper)
    added = np.zeros(len(rates))
    if not (rates[: sub.k] < -CLOSED * system.contacts.speed).any():
        return added
    problem = velocity_problem(system, state.t, state.q, state.v, sub)
    added[: sub.k] = captured(sub, problem.free, contact_speed(system, problem.rows))
    return added


def captured(sub: Subset, free: FreeProblem, slowest: float) -> np.ndarray:
    """What restitution with two phases adds to the normal rates behind an impact that is captured, shape (k,) [m/s].

    Args:
        sub: contacts.
        free: their problem with the rates before.
        slowest: approach that is no impact [m/s].
    """
    hits = free.b[: sub.k] < -slowest
    P = two_phases(sub, free) if hits.any() else None
    if P is None:
        return np.zeros(sub.k)
    after = (free.b + free.G @ P)[: sub.k]
    bounce = np.where(hits & (P[: sub.k] > 0.0), np.maximum(after, 0.0), 0.0)
    return -bounce * _part_without_gain(sub, free, bounce)


def _part_without_gain(sub: Subset, free: FreeProblem, bounce: np.ndarray) -> float:
    """The largest part of some normal velocities with which the laws of a step leave no more energy than there was."""

    def gains(part: float) -> bool:
        b = free.b.copy()
        b[: sub.k] -= part * bounce
        cones = sub.cones
        given = free.G, b, cones.coefficients(free.b[sub.k :])[0], cones.of_row, np.zeros(len(b))
        P, converged, _ = solve_contact_problem(*given, FOUND, of_cone=cones.contact)
        return not converged or P @ (free.b + 0.5 * free.G @ P) > FOUND * abs(P @ free.b)

    low, high = 0.0, 1.0
    if not gains(high):
        return high
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if gains(middle) else (middle, high)
    return low
