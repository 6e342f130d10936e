"""One level of the laws alone: impacts (43)-(53) and consistent forces (52), (60), contact by contact.

Both are the frictional contact problem y = b + G P of the contacts that are closed, where y are velocities after an
impact and P percussions, or y accelerations and P forces. It is solved by Gauss-Seidel sweeps of the prox functions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .kinematics import ContactKinematics, Motion
from .laws import prox_ball, unit
from .problem import Problem
from .step import State

CLOSED = 1e-12  # gap of contacts that touch [m]
STILL = 1e-10  # velocity of contacts that neither open nor slip, in parts of the fastest one or of 1 m/s
SWEEPS, CHANGE = 20000, 1e-14  # limit of the sweeps, and change of the forces at which they end


class Impact(NamedTuple):
    """An impact: velocity after it, and the percussions of all contacts, shapes (nv,), (n_N,) and (n_F,)."""

    v: np.ndarray
    P_N: np.ndarray
    P_F: np.ndarray


def closed(problem: Problem, q: np.ndarray) -> np.ndarray:
    """Which contacts touch, shape (n_N,)."""
    still = np.zeros(problem.nv)
    return np.array([c.g_N <= CLOSED for c in Motion(problem, 0.0, q, still, still).contacts], dtype=bool)


def impact(problem: Problem, t: float, q: np.ndarray, v: np.ndarray) -> Impact | None:
    """The impact (43)-(49), (53) of a motion that arrives at (t, q) with the velocity v; None if it is not solved."""
    motion = Motion(problem, t, q, v, np.zeros(problem.nv))
    contacts, constraints = motion.contacts, motion.constraints
    touching = [int(k) for k in np.flatnonzero(closed(problem, q))]
    b_N = [(1.0 + problem.contacts[k].law.e_N) * contacts[k].g_N_dot for k in touching]  # (44) without percussions
    b_F = [(1.0 + problem.contacts[k].law.e_F) * contacts[k].gamma_F for k in touching]  # (48)
    response = _Response(motion.M, constraints.W_g)
    slip = [np.zeros_like(contacts[k].gamma_F) for k in touching]
    P = _sweeps(problem, contacts, touching, b_N, b_F, slip, response)
    if P is None:
        return None
    P_N, P_F = P
    v_after = v + response.to(_force(problem, contacts, P_N, P_F), constraints.g_dot)
    return Impact(v_after, P_N, P_F)


def consistent(problem: Problem, t: float, q: np.ndarray, v: np.ndarray, inertia: np.ndarray | None = None) -> State:
    """The state just after t with the accelerations and forces (52), (56), (60), (117) that belong to (q, v).

    Args:
        problem: what moves.
        t: time [s].
        q: configuration, shape (nq,).
        v: velocity, shape (nv,).
        inertia: what resists the forces, by default M (see `run.averaged`), shape (nv, nv).
    """
    at_rest = Motion(problem, t, q, v, np.zeros(problem.nv))
    M = at_rest.M if inertia is None else inertia
    free = np.linalg.solve(M, at_rest.h)
    motion = Motion(problem, t, q, v, free)
    contacts, constraints = motion.contacts, motion.constraints
    response = _Response(M, constraints.W_g)
    held = response.to(np.zeros(problem.nv), constraints.g_ddot)
    speed = STILL * max(1.0, float(np.abs(v).max()))
    resting = [int(k) for k in np.flatnonzero(closed(problem, q)) if contacts[k].g_N_dot <= speed]  # (61)
    b_N = [contacts[k].g_N_ddot + contacts[k].W_N @ held for k in resting]
    b_F = [contacts[k].gamma_F_dot + contacts[k].W_F.T @ held for k in resting]
    slip = [np.where(np.linalg.norm(contacts[k].gamma_F) > speed, contacts[k].gamma_F, 0.0) for k in resting]
    la = _sweeps(problem, contacts, resting, b_N, b_F, slip, response)
    if la is None:  # much friction against this slip has no solution: the forces as if it had just stopped
        la = _sweeps(problem, contacts, resting, b_N, b_F, [np.zeros_like(s) for s in slip], response)
    la_N, la_F = (np.zeros(problem.n_N), np.zeros(problem.n_F)) if la is None else la
    force = _force(problem, contacts, la_N, la_F)
    a = free + response.to(force, constraints.g_ddot)
    la_g = response.multipliers(force, constraints.g_ddot)
    zero_N, zero_F = np.zeros(problem.n_N), np.zeros(problem.n_F)
    return State(t, q, v, a, a, la_N, la_N, la_F, la_F, la_g, 0.0, zero_N, zero_F, zero_N, zero_F)


class _Response:
    """Change of the motion by forces, with the constraints kept: M a - W_g la_g = f, W_g^T a = -g_ddot."""

    def __init__(self, M: np.ndarray, W_g: np.ndarray):
        n = W_g.shape[1]
        self._A = np.block([[M, -W_g], [W_g.T, np.zeros((n, n))]])
        self._nv = len(M)

    def _both(self, force: np.ndarray, error: np.ndarray) -> np.ndarray:
        return np.linalg.solve(self._A, np.concatenate((force, -error)))

    def to(self, force: np.ndarray, error: np.ndarray) -> np.ndarray:
        """To a force, shape (nv,), and to what the constraints are off by without it."""
        return self._both(force, error)[: self._nv]

    def multipliers(self, force: np.ndarray, error: np.ndarray) -> np.ndarray:
        """Of the constraints."""
        return self._both(force, error)[self._nv :]


def _force(problem: Problem, contacts: list[ContactKinematics], P_N: np.ndarray, P_F: np.ndarray) -> np.ndarray:
    """W_N P_N + W_F P_F (50), shape (nv,)."""
    force = np.zeros(problem.nv)
    for k, F in enumerate(problem.friction):
        force += contacts[k].W_N * P_N[k] + contacts[k].W_F @ P_F[F]
    return force


def _sweeps(
    problem: Problem,
    contacts: list[ContactKinematics],
    touching: list[int],
    b_N: list[float],
    b_F: list[np.ndarray],
    slip: list[np.ndarray],
    response: _Response,
) -> tuple[np.ndarray, np.ndarray] | None:
    """P_N and P_F of all contacts, with (131), (137) for the contacts that touch; None where they are not found.

    Where a contact slips in a known direction its friction is tied to the normal force (120).
    """
    P_N, P_F, friction = np.zeros(problem.n_N), np.zeros(problem.n_F), problem.friction
    motion = np.zeros(problem.nv)  # that the forces so far have made
    n_g = np.zeros(len(problem.rows))
    by_N = {k: response.to(contacts[k].W_N, n_g) for k in touching}
    by_F = {k: np.stack([response.to(w, n_g) for w in contacts[k].W_F.T], axis=1) for k in touching if len(contacts[k].W_F.T)}
    for _ in range(SWEEPS):
        before_N, before_F = P_N.copy(), P_F.copy()
        for i, k in enumerate(touching):
            law, c, F = problem.contacts[k].law, contacts[k], friction[k]
            direction, tied = by_N[k], np.zeros(len(contacts[k].gamma_F))
            if slip[i].any():
                tied = -law.mu * unit(slip[i])  # (120)
                direction = direction + by_F[k] @ tied
            G = float(c.W_N @ direction)
            if not G > 0.0:
                return None
            new_N = max(0.0, P_N[k] - (b_N[i] + c.W_N @ motion) / G)  # (131), (134)
            motion = motion + direction * (new_N - P_N[k])
            P_N[k] = new_N
            if slip[i].any():
                P_F[F] = tied * new_N
            elif len(c.gamma_F):
                r = 1.0 / float((c.W_F * by_F[k]).sum(axis=0).max())
                new_F = -prox_ball(r * (b_F[i] + c.W_F.T @ motion) - P_F[F], law.mu * new_N)  # (137), (140)
                motion = motion + by_F[k] @ (new_F - P_F[F])
                P_F[F] = new_F
        change = max(np.abs(P_N - before_N).max(initial=0.0), np.abs(P_F - before_F).max(initial=0.0))
        if change <= CHANGE * max(np.abs(P_N).max(initial=0.0), np.abs(P_F).max(initial=0.0)):
            return P_N, P_F
        if not np.isfinite(change):
            return None
    return None
