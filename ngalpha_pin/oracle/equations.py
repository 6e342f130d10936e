"""R(x) = 0 of one step, (127)-(142), in the order of the paper.

A `Step` is what is known at its start. R, its parts, its index sets and its Jacobian are functions of a step and of

    x = (a, U, Q, kappa_g, La_g, la_g, kappa_N, La_N, la_N, La_F, la_F)      (126)

at its end, at any x. Constraints gamma on velocity level do not occur in the systems of the paper and are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ngalpha_pin.oracle.kinematics import Motion, forces
from ngalpha_pin.oracle.laws import (
    PAPER,
    Forces,
    Kinematics,
    Sets,
    index_sets,
    residuals,
    restitution,
    time_since_impact,
)
from ngalpha_pin.oracle.problem import Problem

ALPHA_R = 0.3  # prox parameter r_k = ALPHA_R / (w_k^T M^-1 w_k) of a contact with the direction w_k
NUDGE = 1e-6  # change of the velocity in the differences of the Jacobian, in parts of the fastest one or of 1 m/s
OPEN = Sets(False, False, False, False, False)


@dataclass(frozen=True)
class Parameters:
    """Of the method.

    Attributes:
        rho_inf: spectral radius at infinite frequency (72), in [0, 1] [-].
        laws: "second-order" or "paper", see `laws`.
        tol: tolerance of R, relative to the typical force of the step [-].
        max_iter: Newton corrections (143).
        max_sweeps: fixed-point iterations (146).
        relaxes: the coefficients are those of implicit Euler, see `steps.averaged`.
    """

    rho_inf: float = 0.5
    laws: str = "second-order"
    tol: float = 1e-11
    max_iter: int = 30
    max_sweeps: int = 200
    relaxes: bool = False

    @property
    def coefficients(self) -> tuple[float, float, float, float]:
        """alpha_f, alpha_m, gamma and beta (72)."""
        if self.relaxes:
            return 0.0, 0.0, 1.0, 1.0
        rho = self.rho_inf
        alpha_m, alpha_f = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
        gamma = 0.5 + alpha_f - alpha_m
        return alpha_f, alpha_m, gamma, 0.25 * (0.5 + gamma) ** 2


@dataclass(frozen=True, eq=False)
class State:
    """What one step leaves to the next; arrays over all contacts, also over those that are open.

    Attributes:
        t, q, v, a: time, configuration, velocity and acceleration.
        a_bar: auxiliary acceleration (71), shape (nv,).
        la_N, la_N_bar: normal forces and their auxiliary variables (96), shape (n_N,) [N].
        la_F, la_F_bar: friction forces likewise (114), shape (n_F,) [N].
        la_g: constraint forces, shape (n_g,).
        dt: length of the last step; zero at the start of a motion [s].
        P_N, P_F, La_N, La_F: percussions of the last step and their impulsive parts [N s].
        relaxed: the last step has taken away what it does not resolve, see `steps.averaged`.
    """

    t: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    a_bar: np.ndarray
    la_N: np.ndarray
    la_N_bar: np.ndarray
    la_F: np.ndarray
    la_F_bar: np.ndarray
    la_g: np.ndarray
    dt: float
    P_N: np.ndarray
    P_F: np.ndarray
    La_N: np.ndarray
    La_F: np.ndarray
    relaxed: bool = False


class Unknowns(NamedTuple):
    """The parts of x (126)."""

    a: np.ndarray
    U: np.ndarray
    Q: np.ndarray
    kappa_g: np.ndarray
    La_g: np.ndarray
    la_g: np.ndarray
    kappa_N: np.ndarray
    La_N: np.ndarray
    la_N: np.ndarray
    La_F: np.ndarray
    la_F: np.ndarray


@dataclass(frozen=True, eq=False)
class Step:
    """A step before it is solved: R(x) depends on nothing else.

    Attributes:
        problem: what moves.
        parameters: of the method.
        start: state at t_i, whose dt has been made that of the step (see `steps.rescaled`).
        dt: length of the step [s].
        follows: contacts that take part, shape (n_N,); the others have no forces in this step.
        laws: "second-order" or "paper".
        r_N, r_F: prox parameters of every contact, shape (n_N,) each [kg].
        factors: on r_F where index sets are chosen, shape (n_N,) (see `steps.prox_factors`); by default one.
    """

    problem: Problem
    parameters: Parameters
    start: State
    dt: float
    follows: np.ndarray
    laws: str
    r_N: np.ndarray
    r_F: np.ndarray
    factors: np.ndarray | float = 1.0

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of entries of each part of x."""
        p = self.problem
        return (p.nv,) * 3 + (len(p.rows),) * 3 + (p.n_N,) * 3 + (p.n_F,) * 2

    @property
    def n_y(self) -> int:
        """Number of unknowns without contact forces (144)."""
        return 3 * self.problem.nv + 3 * len(self.problem.rows)

    def split(self, x: np.ndarray) -> Unknowns:
        """The parts of x."""
        return Unknowns(*np.split(x, np.cumsum(self.sizes)[:-1]))

    @property
    def first(self) -> np.ndarray:
        """x^0: accelerations and forces of the start of the step, no impulses."""
        s = self.start
        zero = Unknowns(*(np.zeros(n) for n in self.sizes))
        return np.concatenate(zero._replace(a=s.a, la_g=s.la_g, la_N=s.la_N, la_F=s.la_F))

    @cached_property
    def rebounds(self) -> list[tuple[float, np.ndarray]]:
        """What the velocities of the start add to xi_N and xi_F (44), (48) of every contact."""
        s, p = self.start, self.problem
        pairs = zip(p.contacts, Motion(p, s.t, s.q, s.v, s.a).contacts, strict=True)
        return [
            restitution(contact.law, k.g_N_dot, k.gamma_F, self.laws, la_N > 0.0)
            for (contact, k), la_N in zip(pairs, s.la_N, strict=True)
        ]


class End(NamedTuple):
    """What x makes of the end of the step.

    Attributes:
        motion: positions, velocities and accelerations at t_(i+1), with all that depends on them.
        a_bar, la_N_bar, la_F_bar: (71), (96), (114).
        forces: of every contact.
        kappa_F: displacement by friction, shape (n_F,) [N s^2].
    """

    motion: Motion
    a_bar: np.ndarray
    la_N_bar: np.ndarray
    la_F_bar: np.ndarray
    forces: list[Forces]
    kappa_F: np.ndarray


def make_step(p: Problem, parameters: Parameters, start: State, dt: float, follows: np.ndarray, laws: str) -> Step:
    """The step with prox parameters from the directions at the end that its first iterate has."""
    one = np.ones(p.n_N)
    step = Step(p, parameters, start, dt, follows, laws, one, one)
    motion = end_of_step(step, step.first).motion
    inverse = np.linalg.inv(motion.M)
    G_N = np.array([c.W_N @ inverse @ c.W_N for c in motion.contacts])
    G_F = np.array([(c.W_F.T @ inverse @ c.W_F)[0, 0] if c.W_F.size else 1.0 for c in motion.contacts])
    return Step(p, parameters, start, dt, follows, laws, ALPHA_R / G_N, ALPHA_R / G_F)


def end_of_step(step: Step, x: np.ndarray, motion: Motion | None = None) -> End:
    """Positions, velocities and percussions as functions of x; the motion is given where only forces differ."""
    s, u, dt, p = step.start, step.split(x), step.dt, step.problem
    alpha_f, alpha_m, gamma, beta = step.parameters.coefficients

    def auxiliary(bar: np.ndarray, old: np.ndarray, new: np.ndarray) -> np.ndarray:
        return (alpha_f * old + (1 - alpha_f) * new - alpha_m * bar) / (1 - alpha_m)  # (71), (96), (114)

    def once(bar: np.ndarray, new_bar: np.ndarray) -> np.ndarray:
        return dt * ((1 - gamma) * bar + gamma * new_bar)  # (70)

    def twice(bar: np.ndarray, new_bar: np.ndarray) -> np.ndarray:
        return dt**2 / 2 * ((1 - 2 * beta) * bar + 2 * beta * new_bar)  # (70)

    a_bar = auxiliary(s.a_bar, s.a, u.a)  # (71)
    la_N_bar, la_F_bar = auxiliary(s.la_N_bar, s.la_N, u.la_N), auxiliary(s.la_F_bar, s.la_F, u.la_F)  # (96), (114)
    if motion is None:
        v = s.v + once(s.a_bar, a_bar) + u.U  # (73)
        q = p.moved(s.q, dt * s.v + twice(s.a_bar, a_bar) + u.Q)  # (125)
        motion = Motion(p, s.t + dt, q, v, u.a)
    half = np.array([step.laws != PAPER and force > 0.0 for force in s.la_N], dtype=bool)
    in_step = once(s.la_N_bar, la_N_bar)
    kappa_hat_N = u.kappa_N + np.where(half, dt / 2 * in_step, twice(s.la_N_bar, la_N_bar))  # (102), or see `laws`
    P_N = u.La_N + in_step  # (95)
    P_F = u.La_F + once(s.la_F_bar, la_F_bar)  # (113)
    displaced = twice(s.la_F_bar, la_F_bar)
    of_contacts, kappa_F = [], np.zeros(p.n_F)
    for k, F in enumerate(p.friction):
        z = Forces(kappa_hat_N[k], P_N[k], P_F[F], u.la_N[k], u.la_F[F], u.La_N[k], u.La_F[F])
        tau = time_since_impact(z, dt, step.laws)
        kappa_F[F] = (
            dt / 2 * z.La_F if half[k] or step.laws == PAPER else tau * z.P_F - displaced[F]
        )  # (80), or see `laws`
        of_contacts.append(z)
    return End(motion, a_bar, la_N_bar, la_F_bar, of_contacts, kappa_F)


def contact_kinematics(step: Step, end: End) -> list[Kinematics]:
    """What the laws look at, of every contact."""
    return [
        Kinematics(c.g_N, c.g_N_dot + e_N, c.gamma_F + e_F, c.g_N_ddot, c.gamma_F_dot, c.gamma_F)  # (44), (48)
        for c, (e_N, e_F) in zip(end.motion.contacts, step.rebounds, strict=True)
    ]


def contact_sets(step: Step, end: End) -> list[Sets]:
    """Index sets (130)-(141) of every contact."""
    triples = zip(step.problem.contacts, contact_kinematics(step, end), end.forces, strict=True)
    r_N, r_F = step.r_N, step.r_F * step.factors
    return [
        index_sets(contact.law, y, z, r_N[k], r_F[k]) if step.follows[k] else OPEN
        for k, (contact, y, z) in enumerate(triples)
    ]


def smooth_residual(step: Step, x: np.ndarray, end: End) -> np.ndarray:
    """R_s (127)."""
    u, M, constraints = step.split(x), end.motion.M, end.motion.constraints
    R_a = M @ u.a - end.motion.h - constraints.W_g @ u.la_g  # (74)
    R_U = M @ u.U - constraints.W_g @ u.La_g  # (78)
    R_Q = M @ u.Q - constraints.W_g @ u.kappa_g  # (80)
    for k, (contact, F) in enumerate(zip(end.motion.contacts, step.problem.friction, strict=True)):
        R_a -= contact.W_N * u.la_N[k] + contact.W_F @ u.la_F[F]
        R_U -= contact.W_N * u.La_N[k] + contact.W_F @ u.La_F[F]
        R_Q -= contact.W_N * u.kappa_N[k] + contact.W_F @ end.kappa_F[F]
    return np.concatenate((R_a, R_U, R_Q, constraints.g, constraints.g_dot, constraints.g_ddot))  # (84)


def contact_residual(step: Step, end: End, sets: list[Sets]) -> np.ndarray:
    """R_c (129)-(142) on given index sets, in the order of the contact forces in x."""
    quadruples = zip(step.problem.contacts, contact_kinematics(step, end), end.forces, sets, strict=True)
    found = [residuals(contact.law, y, z, s, step.laws) for contact, y, z, s in quadruples]
    numbers = [np.array([getattr(R, name) for R in found]) for name in ("kappa_N", "La_N", "la_N")]
    vectors = [np.concatenate([np.zeros(0), *(getattr(R, name) for R in found)]) for name in ("La_F", "la_F")]
    return np.concatenate(numbers + vectors)


def residual(step: Step, x: np.ndarray, sets: list[Sets] | None = None, motion: Motion | None = None) -> np.ndarray:
    """R(x) on the index sets of x itself, or on given ones; `motion` as in `end_of_step`."""
    end = end_of_step(step, x, motion)
    sets = contact_sets(step, end) if sets is None else sets
    return np.concatenate((smooth_residual(step, x, end), contact_residual(step, end, sets)))


def jacobian(step: Step, x: np.ndarray, sets: list[Sets] | None = None) -> np.ndarray:
    """dR/dx by forward differences, on index sets that are held (143), shape (n, n)."""
    end = end_of_step(step, x)
    sets = contact_sets(step, end) if sets is None else sets
    R, nudge = residual(step, x, sets, end.motion), nudges(step, end.motion)
    J = np.empty((len(x), len(x)))
    for j in range(len(x)):
        moved = x.copy()
        moved[j] += nudge[j]
        forces_alone = j >= 3 * step.problem.nv  # q, v and a do not depend on the multipliers
        J[:, j] = (residual(step, moved, sets, end.motion if forces_alone else None) - R) / nudge[j]
    return J


def nudges(step: Step, motion: Motion) -> np.ndarray:
    """Differences of the Jacobian: of each unknown about what changes a velocity by `NUDGE`, shape (n,)."""
    p, dt = step.problem, step.dt
    of_F = np.repeat(step.r_F, [len(contact.rows) for contact in p.contacts])
    of_g = np.full(len(p.rows), motion.M.diagonal().max())
    one = np.ones(p.nv)
    parts = Unknowns(
        one / dt, one, one * dt, of_g * dt, of_g, of_g / dt, step.r_N * dt, step.r_N, step.r_N / dt, of_F, of_F / dt
    )
    return NUDGE * max(1.0, float(np.abs(step.start.v).max())) * np.concatenate(parts)


def stiffness(p: Problem, s: State) -> np.ndarray:
    """-dh/dq by central differences, shape (nv, nv)."""
    size = 1e-6
    pairs = [(p.moved(s.q, -e), p.moved(s.q, e)) for e in size * np.eye(p.nv)]
    return np.stack([forces(p, q, s.v) - forces(p, q_plus, s.v) for q, q_plus in pairs], axis=1) / (2 * size)


def damping(p: Problem, s: State) -> np.ndarray:
    """-dh/dv by central differences, shape (nv, nv)."""
    size = 1e-4
    pairs = [(s.v - e, s.v + e) for e in size * np.eye(p.nv)]
    return np.stack([forces(p, s.q, v) - forces(p, s.q, v_plus) for v, v_plus in pairs], axis=1) / (2 * size)
