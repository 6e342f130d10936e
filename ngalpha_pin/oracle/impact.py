"""One level of the laws alone: impacts (43)-(53), and accelerations with their forces (52), (60), (117).

Both are the frictional contact problem of the contacts that are closed: y = b + G P with the velocities y after an
impact and percussions P, or with accelerations y and forces P. It is solved by Gauss-Seidel sweeps, contact by contact,
with the prox functions of (131), (134), (137), (140).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.oracle.equations import State
from ngalpha_pin.oracle.kinematics import Motion
from ngalpha_pin.oracle.laws import prox_ball, unit
from ngalpha_pin.oracle.problem import Problem

CLOSED = 1e-12  # gap of contacts that touch [m]
STILL = 1e-10  # velocity of contacts that neither open nor slip, in parts of the fastest one or of 1 m/s
SWEEPS, CHANGE = 20000, 1e-14  # limit of the sweeps, and change of the forces at which they end


class Impact(NamedTuple):
    """An impact: velocity after it, shape (nv,), and the percussions of all contacts, shapes (n_N,) and (n_F,)."""

    v: np.ndarray
    P_N: np.ndarray
    P_F: np.ndarray


def impact(p: Problem, t: float, q: np.ndarray, v: np.ndarray) -> Impact | None:
    """The impact (43)-(49), (53) of a motion that arrives at (t, q) with the velocity v; None if it is not solved."""
    motion = Motion(p, t, q, v, np.zeros(p.nv))
    touching = [k for k, c in enumerate(motion.contacts) if c.g_N <= CLOSED]
    response = Response(motion.M, motion.constraints.W_g)
    back = response.to(np.zeros(p.nv), motion.constraints.g_dot)  # (57): constraints keep their velocity
    b, no_slip = {}, {}
    for k in touching:  # xi_N (44) and xi_F (48) without percussions
        c, law = motion.contacts[k], p.contacts[k].law
        b_N = (1.0 + law.e_N) * c.g_N_dot + c.W_N @ back
        b[k], no_slip[k] = (b_N, (1.0 + law.e_F) * c.gamma_F + c.W_F.T @ back), np.zeros(len(c.gamma_F))
    found = contact_problem(motion, response, b, no_slip)
    if found is None:
        return None
    P_N, P_F = found
    return Impact(v + back + response.to(force_of(motion, P_N, P_F)), P_N, P_F)


def consistent(p: Problem, t: float, q: np.ndarray, v: np.ndarray, inertia: np.ndarray | None = None) -> State:
    """The state just after t with the accelerations and forces (52), (56), (60), (117) that belong to (q, v).

    Args:
        p: what moves.
        t: time [s].
        q: configuration, shape (nq,).
        v: velocity, shape (nv,).
        inertia: what resists the forces, shape (nv, nv); by default M (see `steps.averaged`).
    """
    at_rest = Motion(p, t, q, v, np.zeros(p.nv))
    M = at_rest.M if inertia is None else inertia
    free = np.linalg.solve(M, at_rest.h)
    motion = Motion(p, t, q, v, free)
    response = Response(M, motion.constraints.W_g)
    back = response.to(np.zeros(p.nv), motion.constraints.g_ddot)  # (56)
    speed = STILL * max(1.0, float(np.abs(v).max()))
    resting = [k for k, c in enumerate(motion.contacts) if c.g_N <= CLOSED and c.g_N_dot <= speed]  # (61)
    b, slip, no_slip = {}, {}, {}
    for k in resting:
        c = motion.contacts[k]
        b[k] = c.g_N_ddot + c.W_N @ back, c.gamma_F_dot + c.W_F.T @ back
        no_slip[k] = np.zeros(len(c.gamma_F))
        slip[k] = c.gamma_F if np.linalg.norm(c.gamma_F) > speed else no_slip[k]
    found = contact_problem(motion, response, b, slip)
    if found is None:  # much friction against this slip has no solution: the forces as if it had just stopped
        found = contact_problem(motion, response, b, no_slip)
    la_N, la_F = (np.zeros(p.n_N), np.zeros(p.n_F)) if found is None else found
    force = force_of(motion, la_N, la_F)
    a, la_g = free + back + response.to(force), response.multipliers(force, motion.constraints.g_ddot)
    zero_N, zero_F = np.zeros(p.n_N), np.zeros(p.n_F)
    return State(t, q, v, a, a, la_N, la_N, la_F, la_F, la_g, 0.0, zero_N, zero_F, zero_N, zero_F)


class Response:
    """Change y of velocities or accelerations by forces f, with constraints kept: M y - W_g P_g = f, W_g^T y = -g."""

    def __init__(self, M: np.ndarray, W_g: np.ndarray):
        self._nv, self._n_g = W_g.shape
        self._A = np.block([[M, -W_g], [W_g.T, np.zeros((self._n_g, self._n_g))]])

    def _both(self, force: np.ndarray, error: np.ndarray | None) -> np.ndarray:
        error = np.zeros(self._n_g) if error is None else error
        return np.linalg.solve(self._A, np.concatenate((force, -error)))

    def to(self, force: np.ndarray, error: np.ndarray | None = None) -> np.ndarray:
        """Y, shape (nv,), for a force and for what the constraints are off by without it."""
        return self._both(force, error)[: self._nv]

    def multipliers(self, force: np.ndarray, error: np.ndarray) -> np.ndarray:
        """P_g for the same, shape (n_g,)."""
        return self._both(force, error)[self._nv :]


def force_of(motion: Motion, P_N: np.ndarray, P_F: np.ndarray) -> np.ndarray:
    """W_N P_N + W_F P_F (50), shape (nv,)."""
    force = np.zeros(motion.problem.nv)
    for k, F in enumerate(motion.problem.friction):
        force += motion.contacts[k].W_N * P_N[k] + motion.contacts[k].W_F @ P_F[F]
    return force


def contact_problem(
    motion: Motion, response: Response, b: dict[int, tuple[float, np.ndarray]], slip: dict[int, np.ndarray]
) -> tuple[np.ndarray, np.ndarray] | None:
    """P_N and P_F of all contacts that fulfil the laws on y = b + G P; None where the sweeps do not find them.

    Args:
        motion: where the contacts are.
        response: of the bodies.
        b: y_N and y_F without forces, of every contact that takes part.
        slip: direction in which a contact slips already, to which its friction is tied (120); zero elsewhere.
    """
    p = motion.problem
    P_N, P_F, y = np.zeros(p.n_N), np.zeros(p.n_F), np.zeros(p.nv)
    by_N = {k: response.to(motion.contacts[k].W_N) for k in b}
    by_F = {k: np.stack([response.to(w) for w in motion.contacts[k].W_F.T], axis=1) for k in b if p.contacts[k].rows}
    tied = {k: -p.contacts[k].law.mu * unit(slip[k]) for k in b if slip[k].any()}  # (120)
    for _ in range(SWEEPS):
        before = np.concatenate((P_N, P_F))
        for k, (b_N, b_F) in b.items():
            c, F, mu = motion.contacts[k], p.friction[k], p.contacts[k].law.mu
            direction = by_N[k] + by_F[k] @ tied[k] if k in tied else by_N[k]
            G_N = float(c.W_N @ direction)
            if not G_N > 0.0:
                return None
            new_N = max(0.0, P_N[k] - (b_N + c.W_N @ y) / G_N)  # (131), (134)
            y, P_N[k] = y + direction * (new_N - P_N[k]), new_N
            if k in tied:
                P_F[F] = tied[k] * new_N
            elif p.contacts[k].rows:
                r = 1.0 / float((c.W_F * by_F[k]).sum(axis=0).max())
                new_F = -prox_ball(r * (b_F + c.W_F.T @ y) - P_F[F], mu * new_N)  # (137), (140)
                y, P_F[F] = y + by_F[k] @ (new_F - P_F[F]), new_F
        now = np.concatenate((P_N, P_F))
        change = float(np.abs(now - before).max(initial=0.0))
        if change <= CHANGE * float(np.abs(now).max(initial=0.0)):
            return P_N, P_F
        if not np.isfinite(change):
            return None
    return None
