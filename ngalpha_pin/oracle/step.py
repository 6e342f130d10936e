"""R(x) = 0 of one step, (127)-(142), and its two solvers: Newton's method (143) and fixed-point iterations (146).

A `Step` is what is known at its start; R, its parts and its Jacobian are functions of a step and of the unknowns

    x = (a, U, Q, kappa_g, La_g, la_g, kappa_N, La_N, la_N, La_F, la_F)      (126)

at its end. Velocity-level constraints gamma do not occur in the systems of the paper and are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .kinematics import Motion
from .laws import Forces, Kinematics, Sets, index_sets, prox_updates, residuals, restitution, time_since_impact
from .problem import Problem

ALPHA_R = 0.3  # prox parameter r_k = ALPHA_R / (w_k^T M^-1 w_k) of a contact with the normal direction w_k
NUDGE = 1e-6  # change of a velocity in the differences of the Jacobian, in parts of the fastest one [-]
ROUNDING = 4 * np.finfo(float).eps
FAST = 0.1  # part of a residual that one correction may leave without a new Jacobian
# sweeps of fixed-point iterations between two runs of Newton's method, and the corrections of each
CHECK_EVERY, NEWTON_CHECK = 10, 8
RCOND = 1e-9  # singular values of the scaled Jacobian below this part of the largest one count as zero


@dataclass(frozen=True)
class Parameters:
    """Of the method.

    Attributes:
        rho_inf: spectral radius at infinite frequency (72), in [0, 1] [-].
        laws: "second-order" or "paper", see `laws`.
        tol: tolerance of R, relative to the typical force of the step [-].
        max_iter: Newton corrections (143).
        max_sweeps: fixed-point iterations (146).
    """

    rho_inf: float = 0.5
    laws: str = "second-order"
    tol: float = 1e-12
    max_iter: int = 30
    max_sweeps: int = 200

    @property
    def coefficients(self) -> tuple[float, float, float, float]:
        """alpha_f, alpha_m, gamma and beta (72)."""
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

    @property
    def x(self) -> np.ndarray:
        """All of them in one vector."""
        return np.concatenate(self)


@dataclass(frozen=True, eq=False)
class Step:
    """A step before it is solved: R(x) depends on nothing else.

    Attributes:
        problem: what moves.
        parameters: of the method.
        start: state at t_i, whose dt has been made that of the step (see `run.rescaled`).
        dt: length of the step [s].
        follows: contacts that take part, shape (n_N,); the others have no forces in this step.
        laws: those of `parameters` unless the step has no solution with them.
        factors: on the prox parameters of friction, shape (n_N,), see `run.prox_factors`; None is one.
    """

    problem: Problem
    parameters: Parameters
    start: State
    dt: float
    follows: np.ndarray
    laws: str
    factors: np.ndarray | None = None

    @property
    def sizes(self) -> Unknowns:
        """Number of entries of each part of x."""
        p = self.problem
        n = (p.nv,) * 3 + (len(p.rows),) * 3 + (p.n_N,) * 3 + (p.n_F,) * 2
        return Unknowns(*n)  # type: ignore[arg-type]

    def split(self, x: np.ndarray) -> Unknowns:
        """The parts of x."""
        return Unknowns(*np.split(x, np.cumsum(self.sizes)[:-1]))

    @cached_property
    def first(self) -> np.ndarray:
        """x^0: accelerations and forces of the start of the step, no impulses."""
        s, n = self.start, self.sizes
        zero = Unknowns(*(np.zeros(int(count)) for count in n))
        return zero._replace(a=s.a, la_g=s.la_g, la_N=s.la_N, la_F=s.la_F).x

    @cached_property
    def rebounds(self) -> list[tuple[float, np.ndarray]]:
        """What the velocities of the start add to xi_N and xi_F (44), (48) of every contact."""
        s, p = self.start, self.problem
        pairs = zip(p.contacts, Motion(p, s.t, s.q, s.v, s.a).contacts, strict=True)
        return [restitution(contact.law, k.g_N_dot, k.gamma_F, self.laws) for contact, k in pairs]

    @cached_property
    def scales(self) -> Scales:
        """Units and prox parameters of the step."""
        return Scales(self)


class End(NamedTuple):
    """What x makes of the end of the step.

    Attributes:
        q, v: (125), (73).
        a_bar, la_N_bar, la_F_bar: (71), (96), (114).
        motion: of everything, at t_(i+1).
        forces: of every contact.
        kappa_F: displacement by friction, shape (n_F,) [N s^2].
    """

    q: np.ndarray
    v: np.ndarray
    a_bar: np.ndarray
    la_N_bar: np.ndarray
    la_F_bar: np.ndarray
    motion: Motion
    forces: list[Forces]
    kappa_F: np.ndarray


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
    v = s.v + once(s.a_bar, a_bar) + u.U  # (73)
    q = p.moved(s.q, dt * s.v + twice(s.a_bar, a_bar) + u.Q)  # (125)
    kappa_hat_N = u.kappa_N + twice(s.la_N_bar, la_N_bar)  # (102)
    P_N = u.La_N + once(s.la_N_bar, la_N_bar)  # (95)
    P_F = u.La_F + once(s.la_F_bar, la_F_bar)  # (113)
    displaced = twice(s.la_F_bar, la_F_bar)
    forces, kappa_F = [], np.zeros(p.n_F)
    for k, F in enumerate(p.friction):
        z = Forces(kappa_hat_N[k], P_N[k], P_F[F], u.la_N[k], u.la_F[F], u.La_N[k], u.La_F[F])
        tau = time_since_impact(z, dt, step.laws)
        kappa_F[F] = tau * u.La_F[F] if step.laws == "paper" else tau * P_F[F] - displaced[F]  # (80), or see `laws`
        forces.append(z)
    motion = Motion(p, s.t + dt, q, v, u.a) if motion is None else motion
    return End(q, v, a_bar, la_N_bar, la_F_bar, motion, forces, kappa_F)


def contact_kinematics(step: Step, end: End) -> list[Kinematics]:
    """What the laws look at, of every contact."""
    pairs = zip(end.motion.contacts, step.rebounds, strict=True)
    return [
        Kinematics(c.g_N, c.g_N_dot + e_N, c.gamma_F + e_F, c.g_N_ddot, c.gamma_F_dot, c.gamma_F)  # (44), (48)
        for c, (e_N, e_F) in pairs
    ]


def smooth_residual(step: Step, x: np.ndarray, end: End | None = None) -> np.ndarray:
    """R_s (127)."""
    end = end_of_step(step, x) if end is None else end
    u, p, constraints = step.split(x), step.problem, end.motion.constraints
    M, h, W_g = end.motion.M, end.motion.h, constraints.W_g
    R_a = M @ u.a - h - W_g @ u.la_g  # (74)
    R_U = M @ u.U - W_g @ u.La_g  # (78)
    R_Q = M @ u.Q - W_g @ u.kappa_g  # (80)
    for k, (contact, F) in enumerate(zip(end.motion.contacts, p.friction, strict=True)):
        R_a -= contact.W_N * u.la_N[k] + contact.W_F @ u.la_F[F]
        R_U -= contact.W_N * u.La_N[k] + contact.W_F @ u.La_F[F]
        R_Q -= contact.W_N * u.kappa_N[k] + contact.W_F @ end.kappa_F[F]
    return np.concatenate((R_a, R_U, R_Q, constraints.g, constraints.g_dot, constraints.g_ddot))  # (84)


def contact_sets(step: Step, x: np.ndarray, end: End | None = None) -> list[Sets]:
    """Index sets (130)-(141) of every contact."""
    end = end_of_step(step, x) if end is None else end
    kinematics, r_N = contact_kinematics(step, end), step.scales.r_N
    r_F = step.scales.r_F if step.factors is None else step.scales.r_F * step.factors
    return [
        index_sets(contact.law, kinematics[k], end.forces[k], r_N[k], r_F[k])
        if step.follows[k]
        else Sets(False, False, False, False, False)
        for k, contact in enumerate(step.problem.contacts)
    ]


def contact_residual(step: Step, x: np.ndarray, sets: list[Sets], end: End | None = None) -> np.ndarray:
    """R_c (128)-(142) on given index sets, in the order of the forces in x."""
    end = end_of_step(step, x) if end is None else end
    quadruples = zip(step.problem.contacts, contact_kinematics(step, end), end.forces, sets, strict=True)
    found = [residuals(contact.law, y, z, s, step.laws) for contact, y, z, s in quadruples]
    parts = [np.array([getattr(R, name) for R in found]) for name in ("kappa_N", "La_N", "la_N")]
    parts += [np.concatenate([np.zeros(0), *(getattr(R, name) for R in found)]) for name in ("La_F", "la_F")]
    return np.concatenate(parts)


def residual(step: Step, x: np.ndarray, sets: list[Sets] | None = None, motion: Motion | None = None) -> np.ndarray:
    """R(x) on the index sets of x itself, or on given ones; see `end_of_step`."""
    end = end_of_step(step, x, motion)
    sets = contact_sets(step, x, end) if sets is None else sets
    return np.concatenate((smooth_residual(step, x, end), contact_residual(step, x, sets, end)))


def jacobian(step: Step, x: np.ndarray, sets: list[Sets] | None = None) -> np.ndarray:
    """dR/dx by forward differences, on index sets that are held (143), shape (n, n)."""
    end = end_of_step(step, x)
    sets = contact_sets(step, x, end) if sets is None else sets
    R, nudge = residual(step, x, sets, end.motion), step.scales.nudge
    J = np.empty((len(x), len(x)))
    for j in range(len(x)):
        moved = x.copy()
        moved[j] += nudge[j]
        forces_alone = j >= 3 * step.problem.nv  # q, v and a do not depend on the multipliers
        J[:, j] = (residual(step, moved, sets, end.motion if forces_alone else None) - R) / nudge[j]
    return J


class Scales:
    """Units of R and x, and prox parameters, all from the first iterate of a step.

    Attributes:
        r_N, r_F: prox parameters, shape (n_N,) each [kg].
        x: typical size of each unknown.
        nudge: differences of the Jacobian: of each unknown what moves a velocity by `NUDGE`.
    """

    def __init__(self, step: Step):
        s, p, dt = step.start, step.problem, step.dt
        x = step.first
        end = end_of_step(step, x)
        u, M, h = step.split(x), end.motion.M, end.motion.h
        inverse, root = np.linalg.inv(M), np.sqrt(M.diagonal())
        speed = max(1.0, float(np.abs(s.v).max()))
        # typical force [sqrt(kg) m/s^2]: weight and other forces, inertia, and what the rounding of velocities is worth
        weight = np.sqrt(M.diagonal().max()) * np.linalg.norm(p.scene.model.gravity.linear)
        force = max(float((np.abs(h) / root).max()), float((root * np.abs(u.a)).max()), float(weight))
        G_N = np.array([c.W_N @ inverse @ c.W_N for c in end.motion.contacts])
        G_F = np.array([(c.W_F.T @ inverse @ c.W_F)[0, 0] if c.W_F.size else 1.0 for c in end.motion.contacts])
        G_g = np.einsum("ij,ik,kj->j", end.motion.constraints.W_g, inverse, end.motion.constraints.W_g)
        self.r_N, self.r_F = ALPHA_R / G_N, ALPHA_R / G_F
        of_F = np.repeat(np.arange(p.n_N), [len(contact.rows) for contact in p.contacts])
        inertia = (root, *(np.sqrt(G) for G in (1 / G_g, 1 / G_N, (1 / G_F)[of_F])))  # sqrt of the mass that resists
        levels = ((0, 0), (0, 1), (0, 2), (1, 2), (1, 1), (1, 0), (2, 2), (2, 1), (2, 0), (3, 1), (3, 0))
        power = [1.0 if kind else -1.0 for kind, _ in levels]
        self.x = force * np.concatenate(
            [dt**level * inertia[kind] ** sign for (kind, level), sign in zip(levels, power, strict=True)]
        )
        self.nudge = NUDGE * speed / (dt * force) * self.x
        # the unit of a row: the force that makes the unknown, or the motion that answers it
        kinematic = np.concatenate([force * dt**level / inertia[kind] for kind, level in levels[3:]])
        direct = np.concatenate((force * root, force * dt * root, force * dt**2 * root, self.x[3 * p.nv :]))
        self.direct = direct
        self.kinematic = np.concatenate((direct[: 3 * p.nv], kinematic))
        # rounding: of forces of stiff bodies, of velocities, of positions
        K = stiffness(p, s) if p.scene.beams else np.zeros_like(M)
        size = float(np.abs(s.q).max()), speed
        of_forces = ROUNDING * (np.abs(K).sum(axis=1) * size[0] + np.abs(h))
        floor = (0.0, ROUNDING * size[1], ROUNDING * size[0])
        rows = [np.full(int(n), floor[level]) for n, (_, level) in zip(step.sizes[3:], levels[3:], strict=True)]
        self.floor = np.concatenate((of_forces, dt * of_forces, dt**2 * of_forces, *rows))

    def error(self, step: Step, R: np.ndarray, sets: list[Sets]) -> float:
        """Largest residual in units of its tolerance; the step is solved where it is at most one."""
        tol = step.parameters.tol
        kinematic = tol * self.kinematic + self.floor
        asks = np.concatenate((np.ones(n_y(step), dtype=bool), _motion_rows(step, sets)))
        error = float((np.abs(R) / np.where(asks, kinematic, tol * self.direct)).max())
        return error if np.isfinite(error) else np.inf


def _motion_rows(step: Step, sets: list[Sets]) -> np.ndarray:
    """Rows of R_c that ask a motion to vanish, not a force."""
    n = [len(contact.rows) for contact in step.problem.contacts]
    of_F = np.repeat(np.arange(len(n)), n)
    A, B, C, D_st, E_st = np.array(sets, dtype=bool).reshape(-1, 5).T
    return np.concatenate((A, B, C, D_st[of_F], E_st[of_F]))


def stiffness(p: Problem, s: State) -> np.ndarray:
    """-dh/dq by central differences, shape (nv, nv)."""
    size = 1e-6
    pairs = [(p.moved(s.q, -e), p.moved(s.q, e)) for e in size * np.eye(p.nv)]
    return np.stack([_h(p, s.t, q, s.v) - _h(p, s.t, q_plus, s.v) for q, q_plus in pairs], axis=1) / (2 * size)


def damping(p: Problem, s: State) -> np.ndarray:
    """-dh/dv by central differences, shape (nv, nv)."""
    size = 1e-4
    pairs = [(s.v - e, s.v + e) for e in size * np.eye(p.nv)]
    return np.stack([_h(p, s.t, s.q, v) - _h(p, s.t, s.q, v_plus) for v, v_plus in pairs], axis=1) / (2 * size)


def _h(p: Problem, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return Motion(p, t, q, v, np.zeros(p.nv)).h


class Solution(NamedTuple):
    """Where a solver has arrived.

    Attributes:
        x: the unknowns.
        converged: R(x) is below the tolerance.
        n_iter: corrections, or sweeps and corrections.
    """

    x: np.ndarray
    converged: bool
    n_iter: int


def newton(step: Step, x: np.ndarray, max_iter: int) -> Solution:
    """Semi-smooth Newton method (143); its Jacobian is kept while the index sets stay and the residual falls fast."""
    last: tuple[list[Sets], float] | None = None
    for n in range(max_iter + 1):
        end = end_of_step(step, x)
        sets = contact_sets(step, x, end)
        R = np.concatenate((smooth_residual(step, x, end), contact_residual(step, x, sets, end)))
        error = step.scales.error(step, R, sets)
        if error <= 1.0 or error == np.inf or n == max_iter:
            break
        if last is None or sets != last[0] or error > FAST * last[1]:
            J = jacobian(step, x, sets)
        x, last = x - correction(step, J, R), (sets, error)
    return Solution(x, error <= 1.0, n)


def correction(step: Step, J: np.ndarray, R: np.ndarray) -> np.ndarray:
    """J^-1 R, split into y and z (144): where force directions depend on each other, the one with the smallest forces.

    The bodies y follow their forces z, dR_s/dy is regular; what is left for z may be singular.
    """
    n = n_y(step)
    by_forces = np.linalg.solve(J[:n, :n], np.column_stack((J[:n, n:], R[:n])))  # y by z, and by R_s
    A = (J[n:, n:] - J[n:, :n] @ by_forces[:, :-1]) * step.scales.x[n:]
    b = R[n:] - J[n:, :n] @ by_forces[:, -1]
    rows = np.maximum(np.abs(A).max(axis=1, initial=0.0), 1e-300)
    z = step.scales.x[n:] * np.linalg.lstsq(A / rows[:, None], b / rows, rcond=RCOND)[0]
    return np.concatenate((by_forces[:, -1] - by_forces[:, :-1] @ z, z))


def n_y(step: Step) -> int:
    """Number of unknowns without contact forces (144)."""
    return 3 * step.problem.nv + 3 * len(step.problem.rows)


def fixed_point(step: Step, x: np.ndarray, max_sweeps: int) -> Solution:
    """Fixed-point iterations (144)-(146), and Newton's method from where they have got to now and then.

    The iterations converge linearly, Newton's method only from index sets close to the right ones: together they are
    exact where Newton's method alone runs in circles.
    """
    n_iter, J = 0, None
    for sweep in range(1, max_sweeps + 1):
        x, J = _bodies_for_forces(step, x, J)
        if sweep % CHECK_EVERY == 0:
            checked = newton(step, x, NEWTON_CHECK)
            n_iter += checked.n_iter
            if checked.converged:
                return checked._replace(n_iter=n_iter + sweep)
        x = _forces_for_bodies(step, x)
    return Solution(x, False, n_iter + max_sweeps)


def _bodies_for_forces(step: Step, x: np.ndarray, J: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
    """Y = F(z): Newton's method (145) on R_s(y, z) = 0 with the contact forces z held, and its Jacobian."""
    scale, n, last = step.scales, n_y(step), np.inf
    tol = step.parameters.tol * scale.kinematic[:n] + scale.floor[:n]
    for _ in range(step.parameters.max_iter):
        R = smooth_residual(step, x)
        error = float((np.abs(R) / tol).max())
        if error <= 1.0 or not np.isfinite(error):
            break
        if J is None or error > FAST * last:
            J = np.empty((n, n))
            for j in range(n):
                moved = x.copy()
                moved[j] += scale.nudge[j]
                J[:, j] = (smooth_residual(step, moved) - R) / scale.nudge[j]
        x, last = x.copy(), error
        x[:n] -= np.linalg.solve(J, R)
    return x, J


def _forces_for_bodies(step: Step, x: np.ndarray) -> np.ndarray:
    """Z = p(y, z) (146): the laws with prox, solved for the unknowns behind kappa_hat_N, P_N and P_F."""
    end, u, scale = end_of_step(step, x), step.split(x), step.scales
    new = u._replace(**{name: getattr(u, name).copy() for name in ("kappa_N", "La_N", "la_N", "La_F", "la_F")})
    wanted: list[tuple[float, float, np.ndarray]] = []
    kinematics = contact_kinematics(step, end)
    for k, (contact, F) in enumerate(zip(step.problem.contacts, step.problem.friction, strict=True)):
        kappa_hat_N, P_N, P_F = 0.0, 0.0, np.zeros(len(contact.rows))
        new.la_N[k], new.la_F[F] = 0.0, 0.0
        if step.follows[k]:
            kappa_hat_N, P_N, new.la_N[k], P_F, new.la_F[F] = prox_updates(
                contact.law, kinematics[k], end.forces[k], scale.r_N[k], scale.r_F[k], step.laws
            )
        wanted.append((kappa_hat_N, P_N, P_F))
    # the known parts of (102), (95) and (113) with the new forces
    known = end_of_step(step, new.x).forces
    for k, (F, (kappa_hat_N, P_N, P_F)) in enumerate(zip(step.problem.friction, wanted, strict=True)):
        new.kappa_N[k] += kappa_hat_N - known[k].kappa_hat_N
        new.La_N[k] += P_N - known[k].P_N
        new.La_F[F] += P_F - known[k].P_F
    return new.x
