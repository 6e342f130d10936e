"""The discrete laws of one contact, (128)-(142): index sets, residuals, and the same laws as fixed-point updates.

To try another law, change this file: nothing else knows what a contact force is like. `Kinematics` is what a contact
sees of the motion, `Forces` what it does to it; each law ties one to the other.

Two laws of the paper are of first order, and both of their versions are here. With `laws="paper"` they are those of the
paper. With `laws="second-order"`

* friction displaces the bodies from the moment of impact on, which the normal law knows: tau = kappa_hat_N / P_N ago.
  So M Q = W_N kappa_N + W_F kappa_F with kappa_hat_F = tau P_F, where (80) lets the impulsive part act for dt/2. A
  contact with a force at the start of the step has no such moment and keeps (80), with which it does not creep, and
  its normal force displaces the bodies alike, kappa_hat_N = kappa_N + dt/2 (P_N - La_N): where one contact of a body
  opens, the others that stick stay;
* only impulses follow the direction of slip at the end of the step, La_F = -mu La_N xi_F/|xi_F|, where (112) asks it of
  the whole percussion; forces within the step enter by the quadrature (113) of the directions that they have had. The
  percussion stays within its cone, out of which a slip that turns or begins within the step would take it;
* a contact that opens at the start of a step and closes in it has bounced within the step, and comes to rest;
* a contact with a force at the start has no impact of its own: e_F does not turn its slip back.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.oracle.problem import Law

PAPER, SECOND_ORDER = LAWS = ("paper", "second-order")


class Kinematics(NamedTuple):
    """What the laws of one contact look at.

    Attributes:
        g_N: gap at the end of the step [m].
        xi_N, xi_F: (44) and (48), a number and shape (n_F,) [m/s].
        g_N_ddot, gamma_F_dot: (58) and (119) at the end of the step [m/s^2].
        gamma_F: slip velocity at the end of the step [m/s].
    """

    g_N: float
    xi_N: float
    xi_F: np.ndarray
    g_N_ddot: float
    gamma_F_dot: np.ndarray
    gamma_F: np.ndarray


class Forces(NamedTuple):
    """Forces of one contact.

    Attributes:
        kappa_hat_N: (102) [N s^2].
        P_N, P_F: percussions (95), (113), a number and shape (n_F,) [N s].
        la_N, la_F: forces at the end of the step [N].
        La_N, La_F: impulsive parts of the percussions [N s].
    """

    kappa_hat_N: float
    P_N: float
    P_F: np.ndarray
    la_N: float
    la_F: np.ndarray
    La_N: float
    La_F: np.ndarray


class Sets(NamedTuple):
    """Membership of one contact in A (130), B (133), C (136), D^st (139) and E^st (141)."""

    A: bool
    B: bool
    C: bool
    D_st: bool
    E_st: bool


class LawResiduals(NamedTuple):
    """R_c of one contact: (129), (132), (135), (138), (142)."""

    kappa_N: float
    La_N: float
    la_N: float
    La_F: np.ndarray
    la_F: np.ndarray


def restitution(law: Law, g_N_dot: float, gamma_F: np.ndarray, laws: str, carried: bool) -> tuple[float, np.ndarray]:
    """What the velocities at the start of a step add to xi_N (44) and xi_F (48), with the directions of the start.

    A contact that has a force at the start (`carried`) has no impact of its own: its slip does not turn back.
    """
    bounce = law.e_N * g_N_dot
    if laws == PAPER:
        return bounce, law.e_F * gamma_F
    return min(bounce, 0.0), law.e_F * gamma_F * (not carried)


def index_sets(law: Law, y: Kinematics, z: Forces, r_N: float, r_F: float) -> Sets:
    """Which piece of each law the prox functions choose, with the prox parameters r_N and r_F [kg]."""
    A = r_N * y.g_N - z.kappa_hat_N <= 0.0  # (130)
    B = A and r_N * y.xi_N - z.P_N <= 0.0  # (133)
    C = B and r_N * y.g_N_ddot - z.la_N <= 0.0  # (136)
    D_st = A and in_cone(r_F * y.xi_F - z.P_F, law.mu * z.P_N)  # (139)
    E_st = D_st and in_cone(r_F * y.gamma_F_dot - z.la_F, law.mu * z.la_N)  # (141)
    return Sets(bool(A), bool(B), bool(C), D_st, E_st)


def residuals(law: Law, y: Kinematics, z: Forces, sets: Sets, laws: str) -> LawResiduals:
    """R_c of one contact on given index sets."""
    R_kappa_N = y.g_N if sets.A else z.kappa_hat_N  # (129)
    R_La_N = y.xi_N if sets.B else z.P_N  # (132)
    R_la_N = y.g_N_ddot if sets.C else z.la_N  # (135)
    if not sets.A:  # (138), (142)
        return LawResiduals(R_kappa_N, R_La_N, R_la_N, z.P_F, z.la_F)
    R_La_F = y.xi_F if sets.D_st else z.P_F - slipping_percussion(law, y, z, laws)  # (138)
    if sets.E_st:
        R_la_F = y.gamma_F_dot  # (142)
    else:  # along the slip, or, where it has just stopped, along the slip that begins
        direction = unit(y.gamma_F_dot if sets.D_st else y.gamma_F)
        R_la_F = z.la_F + law.mu * z.la_N * direction  # (142)
    return LawResiduals(R_kappa_N, R_La_N, R_la_N, R_La_F, R_la_F)


def slipping_percussion(law: Law, y: Kinematics, z: Forces, laws: str) -> np.ndarray:
    """P_F of a slipping contact, shape (n_F,); C_F(P_N) (49) is taken as a point where P_N is negative."""
    radius = law.mu * max(z.P_N, 0.0)
    if laws == PAPER:
        return -radius * unit(y.xi_F)  # (112), (138)
    P_F = (z.P_F - z.La_F) - law.mu * z.La_N * unit(y.xi_F)
    return P_F if in_cone(P_F, radius) else radius * unit(P_F)


def time_since_impact(z: Forces, dt: float, laws: str) -> float:
    """How long before the end of the step the percussion has acted [s]: dt/2 (83), or kappa_hat_N / P_N."""
    if laws == PAPER or not z.P_N > 0.0:
        return dt / 2
    return float(np.clip(z.kappa_hat_N / z.P_N, 0.0, dt))


def prox_updates(
    law: Law, y: Kinematics, z: Forces, r_N: float, r_F: float, laws: str
) -> tuple[float, float, float, np.ndarray, np.ndarray]:
    """p(y, z) of the fixed-point iterations (146): kappa_hat_N, P_N, la_N, P_F and la_F from the laws with prox."""
    sets = index_sets(law, y, z, r_N, r_F)
    kappa_hat_N = -prox_negative(r_N * y.g_N - z.kappa_hat_N)  # (128)
    P_N = -prox_negative(r_N * y.xi_N - z.P_N) if sets.A else 0.0  # (131)
    la_N = -prox_negative(r_N * y.g_N_ddot - z.la_N) if sets.B else 0.0  # (134)
    if not sets.A:  # (137), (140)
        return kappa_hat_N, P_N, la_N, np.zeros_like(z.P_F), np.zeros_like(z.la_F)
    if sets.D_st or laws == PAPER:
        P_F = -prox_ball(r_F * y.xi_F - z.P_F, law.mu * P_N)  # (137)
    else:
        P_F = slipping_percussion(law, y, z, laws)
    if sets.D_st:
        la_F = -prox_ball(r_F * y.gamma_F_dot - z.la_F, law.mu * la_N)  # (140)
    else:
        la_F = -law.mu * la_N * unit(y.gamma_F)  # (140)
    return kappa_hat_N, P_N, la_N, P_F, la_F


def prox_negative(p: float) -> float:
    """The closest number that is not positive (25)."""
    return min(p, 0.0)


def prox_ball(p: np.ndarray, radius: float) -> np.ndarray:
    """The closest point of a ball around zero (25)."""
    return p if in_cone(p, radius) else radius * unit(p)


def in_cone(p: np.ndarray, radius: float) -> bool:
    """Whether p is in C_F (49)."""
    return bool(np.linalg.norm(p) <= radius)


def unit(p: np.ndarray) -> np.ndarray:
    """The direction p / |p|; zero for zero."""
    return p / max(float(np.linalg.norm(p)), 1e-300)
