"""Derivatives of the force laws of a converged step by all that they look at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.contact.laws import ContactResidual
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.friction_times import normal_displacement_slope


class LawDerivatives(NamedTuple):
    """Derivatives of the residual of the laws, on the index sets that were found.

    Attributes:
        by_y: by the kinematics, shape (n, n).
        by_multipliers: with the kinematics held, shape (n, n).
        by_z: of those of the contacts by the known parts of their forces, shape (n_c, n_c).
        by_torque: of the rows La_f by the known part of the torques of joint friction, shape (f,).
    """

    by_y: np.ndarray
    by_multipliers: np.ndarray
    by_z: np.ndarray
    by_torque: np.ndarray


def law_derivatives(equations: StepEquations, ev: Evaluation) -> LawDerivatives:
    """Those of a step at its solution."""
    layout, sub, n_c = equations.layout, equations.sub, equations.layout.n_c
    by_y, by_multipliers = np.diag(ev.kinematic * 1.0), np.zeros((equations.n, equations.n))
    by_z, by_torque = np.zeros((n_c, n_c)), np.zeros(layout.f)
    if sub.k:
        kappa_c = normal_displacement_slope(equations, ev.options)
        (values_y, at_y), (values_f, at_f) = ev.contact.derivatives(equations.gamma_c, kappa_c)
        by_y[:n_c, :n_c] = 0.0
        np.add.at(by_y, at_y, values_y)
        np.add.at(by_multipliers, at_f, values_f)
        by_z = _by_known_forces(ev.contact)
    if layout.f:
        f, first = layout.f, layout.friction_v.start
        both = slice(first, layout.friction_a.stop)
        sticks = ev.kinematic[both]
        own = ev.friction.jacobian(np.zeros((2 * f, equations.n)), first)
        by_multipliers[both] = np.where(sticks[:, None], 0.0, own)
        # inside of its bounds the percussion of slip follows the torque itself
        i = np.arange(f)
        by_torque = np.where(sticks[:f] | (own[i, first + f + i] == 0.0), 0.0, 1.0)
    return LawDerivatives(by_y, by_multipliers, by_z, by_torque)


def _by_known_forces(laws: ContactResidual) -> np.ndarray:
    """Derivative of the residual by z = (kappa_hat_N, P, la) with the impulsive parts held; la has no known part."""
    sub, n_c = laws.sub, len(laws.R)
    k, m, o = sub.k, sub.m, sub.of_F
    by_z, slips = np.zeros((n_c, n_c)), np.zeros(n_c, dtype=bool)
    if laws.slips:
        slips[2 * k : 2 * k + m], slips[3 * k + m :] = laws.slip, laws.slip | laws.slip_a
    i = np.flatnonzero(~laws.kinematic & ~slips)
    i = i[i < 2 * k + m]
    by_z[i, i] = 1.0
    if not laws.slips or not laws.slip.any():
        return by_z
    every, P_N, P_F = np.arange(m), k + o, 2 * k + np.arange(m)
    c_P = (1.0 - laws.whole) * np.eye(m)
    c_N = np.zeros((m, n_c))
    c_N[every, P_N] = -laws.mu * laws.whole * laws.unit_v[0]
    rows = np.zeros((m, n_c))
    rows[every, P_F] = 1.0
    c = c_N.copy()
    c[:, P_F] += c_P
    free = rows - c
    if laws.capped.any():
        turn = laws.cap[:, None] * turning(laws)
        held = rows - turn @ c
        held[every, P_N] -= np.where(laws.z[P_N] > 0.0, sub.cones.mu_F * laws.unit_c[0], 0.0)
        free = np.where(laws.capped[:, None], held, free)
    s = np.flatnonzero(laws.slip)
    by_z[P_F[s]] = free[s]
    return by_z


def turning(laws: ContactResidual) -> np.ndarray:
    """Derivative of the direction of what is cut off at the cone, shape (m, m)."""
    d, norm = laws.unit_c
    turn: np.ndarray = (np.eye(len(d)) - d[:, None] * d * laws.sub.cones.same) / norm[:, None]
    return turn


def by_mu(laws: ContactResidual, d_mu: np.ndarray) -> np.ndarray:
    """Change of the residual with the friction coefficients.

    Args:
        laws: of the contacts.
        d_mu: change of the coefficient of every contact, shape (k, p).

    Returns:
        Shape (n_c, p).
    """
    sub = laws.sub
    k, m, o = sub.k, sub.m, sub.of_F
    change = np.zeros((len(laws.R), d_mu.shape[1]))
    if not laws.slips:
        return change
    P, la, La, d = laws.z[k : 2 * k + m], laws.z[2 * k + m :], laws.La, d_mu[o]
    if laws.slip.any():
        pushed = (La[:k] + laws.whole * (P - La)[:k])[o]
        c = -(pushed * laws.unit_v[0])[:, None] * d
        rows = -c
        if laws.capped.any():
            cut = (np.maximum(P[:k], 0.0)[o] * laws.unit_c[0])[:, None] * d
            rows = np.where(laws.capped[:, None], -(laws.cap[:, None] * turning(laws)) @ c - cut, rows)
        change[2 * k : 2 * k + m] = np.where(laws.slip[:, None], rows, 0.0)
    moves = laws.slip | laws.slip_a
    change[3 * k + m :] = np.where(moves[:, None], (la[:k][o] * laws.unit_a[0])[:, None] * d, 0.0)
    return change
