"""A bounce lower than a tolerance ends at once, and so does a slip that stops within one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.contact.point_rows import KinematicRows
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.event_driven.soft_contacts import pressing
from ngalpha_pin.initialization.initial import closed_contacts, consistent_state
from ngalpha_pin.numerics.block_matrix import Matrix, solve_positive
from ngalpha_pin.numerics.nearest_forces import DEPENDENT
from ngalpha_pin.system.actuation import NO_ACTUATION, Actuation
from ngalpha_pin.system.contact_search import contact_speed
from ngalpha_pin.system.system import System

# a slip stops at once where its speed times the time to its end is below this part of the height that is no bounce
STOP = 1e-2


class Settled(NamedTuple):
    """A motion whose low bounces and short slips are over.

    Attributes:
        v: nearest velocity without them, shape (nv,).
        contacts: those that are closed then, shape (k,).
        P_N, P_F: their percussions, shapes (k,) and (m,) [N s].
        bounced: those among them that would have bounced, shape (b,).
    """

    v: np.ndarray
    contacts: np.ndarray
    P_N: np.ndarray
    P_F: np.ndarray
    bounced: np.ndarray


def settled(
    system: System,
    t: float,
    q: np.ndarray,
    v: np.ndarray,
    height: float,
    slowest: float,
    actuation: Actuation = NO_ACTUATION,
) -> Settled | None:
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
        actuation: what motors hold.

    Returns:
        What has settled, or None where every contact stays closed or bounces higher, and slips on.
    """
    state = consistent_state(system, t, q, v, actuation)
    M = system.dynamics(t, q, v, state.a).M.copy()
    sub = closed_contacts(system, q)
    if system.contacts.soft.any():
        sub = system.contacts.subset(np.union1d(sub.index, pressing(system, state)))
        system.dynamics(t, q, v, state.a)
    if sub.k == 0:
        return None
    rows = system.contact_rows(sub, q, v, state.a, t)
    rate, gamma_F, cones = rows.rate[: sub.k], rows.rate[sub.k :], sub.cones
    resting = np.isin(sub.index, state.contacts)
    low, ends, begun = _over(sub, rows, resting, contact_speed(system, rows), height, slowest)
    if not begun:
        return None
    keeps = resting | low
    sticks = ends[cones.of_row]
    shut = keeps & ~system.contacts.soft[sub.index]  # compliant contacts may go on to move along their normal
    chosen = np.concatenate((shut, sticks))
    every = system.directions([rows])
    W, error = every[chosen], np.concatenate((rate[shut], gamma_F[sticks]))
    # what slips on feels the friction of all bounces that are left out: without them it has less of it (120)
    slides = (keeps[cones.contact] & ~ends)[cones.of_row]
    tied = np.where(slides, -cones.coefficients(gamma_F)[0][cones.of_row] * cones.unit(gamma_F)[0], 0.0)
    along = np.zeros((sub.k, len(v)))
    np.add.at(along, sub.of_F, tied[:, None] * every[sub.k :])
    pushes = W.copy()
    pushes[: shut.sum()] += along[shut]
    if system.constraints.names:
        constraints = system.constraint_rows(t, q, v, state.a)
        W_b = system.directions([constraints])
        W, error = np.concatenate((W, W_b)), np.concatenate((error, constraints.rate))
        pushes = np.concatenate((pushes, W_b))
    change, P = smallest_change(M, W, error, pushes)
    P_N, P_F = np.zeros(sub.k), np.zeros(sub.m)
    P_N[shut], P_F[sticks] = np.split(P[: chosen.sum()], [int(shut.sum())])
    P_F += tied * P_N[sub.of_F]
    return Settled(v + change, sub.index[keeps], P_N[keeps], P_F[keeps[sub.of_F]], sub.index[low])


def _over(
    sub: Subset, rows: KinematicRows, resting: np.ndarray, speed_of_none: float, height: float, slowest: float
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Which contacts bounce too low, shape (k,), which cones end to slip, shape (c,), and whether any does."""
    rate, falls = rows.rate[: sub.k], -rows.acceleration[: sub.k]
    low = ~resting & (rate > 0.0) & (rate * rate < 2.0 * height * falls)
    gamma_F, cones, of = rows.rate[sub.k :], sub.cones, sub.cones.contact
    speed = cones.sizes(gamma_F)
    stuck = speed <= speed_of_none
    brakes = -cones.products(gamma_F, rows.acceleration[sub.k :])  # times the speed
    slips = resting[of] & ~stuck
    stops = slips & (speed <= slowest) & (brakes > 0.0)
    if (speed**3 <= STOP * height * brakes)[slips].all():
        stops = slips
    return low, ((resting | low)[of] & stuck) | stops, bool(low.any() or stops.any())


def smallest_change(
    M: Matrix, W: np.ndarray, error: np.ndarray, pushes: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The smallest x in the norm of M with W x = -error, and the P with M x = W^T P; W may have dependent rows.

    Args:
        M: mass matrix.
        W: rows, shape (n, nv).
        error: of these rows, shape (n,).
        pushes: directions that take the place of W in M x = W^T P, shape (n, nv).
    """
    by_M = solve_positive(M, (W if pushes is None else pushes).T)
    G = W @ by_M
    root = np.sqrt(np.maximum(np.abs(G.diagonal()), TINY))
    P = np.linalg.lstsq(G / np.outer(root, root), -error / root, rcond=DEPENDENT)[0] / root
    return by_M @ P, P
