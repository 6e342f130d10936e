"""How R(x) = 0 of a step is solved: Newton's method (143) and fixed-point iterations (146)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.oracle.equations import (
    Step,
    contact_kinematics,
    contact_residual,
    contact_sets,
    end_of_step,
    jacobian,
    nudges,
    smooth_residual,
    stiffness,
)
from ngalpha_pin.oracle.laws import Sets, prox_updates

ROUNDING = 32 * np.finfo(float).eps
RCOND = 1e-9  # singular values below this part of the largest one count as zero
FAST = 0.1  # part of a residual that one correction may leave without a new Jacobian
# sweeps of fixed-point iterations between two runs of Newton's method, and the corrections of each
CHECK_EVERY, NEWTON_CHECK = 10, 8


class Solution(NamedTuple):
    """Where a solver has arrived.

    Attributes:
        x: the unknowns.
        converged: R(x) is below the tolerance.
        n_iter: corrections and sweeps.
    """

    x: np.ndarray
    converged: bool
    n_iter: int


class Scales:
    """Units of R and x, from the first iterate of a step.

    Attributes:
        x: typical size of each unknown, shape (n,).
        kinematic: typical size of each row of R where it is an equation of motion or asks a motion to vanish, (n,).
        floor: what rounding leaves of these rows, shape (n,).
    """

    def __init__(self, step: Step):
        s, p, dt = step.start, step.problem, step.dt
        motion = end_of_step(step, step.first).motion
        root = np.sqrt(motion.M.diagonal())
        # the typical force is the largest of weight, other forces and inertia [sqrt(kg) m/s^2]
        weight = root.max() * float(np.linalg.norm(p.scene.model.gravity.linear))
        force = max(weight, float((np.abs(motion.h) / root).max()), float((root * np.abs(s.a)).max()))
        W_g = motion.constraints.W_g
        G_g = np.einsum("ij,ik,kj->j", W_g, np.linalg.inv(motion.M), W_g)
        of_F = np.repeat(step.r_F, [len(contact.rows) for contact in p.contacts])
        resists = (root, 1 / np.sqrt(G_g), np.sqrt(step.r_N), np.sqrt(of_F))  # sqrt of the mass behind a row
        # of each part of x: what resists it, and its level: position 2, velocity 1, acceleration 0
        parts = ((0, 0), (0, 1), (0, 2), (1, 2), (1, 1), (1, 0), (2, 2), (2, 1), (2, 0), (3, 1), (3, 0))
        motions = [force * dt**level / resists[kind] for kind, level in parts]
        impulses = [force * dt**level * resists[kind] for kind, level in parts]
        self.x = np.concatenate(motions[:3] + impulses[3:])
        self.kinematic = np.concatenate(impulses[:3] + motions[3:])
        of_forces = ROUNDING * np.abs(motion.h)
        if p.beams:  # forces of stiff bodies are differences of positions
            of_forces += ROUNDING * np.abs(stiffness(p, s)).sum(axis=1) * np.abs(s.q).max()
        size = (0.0, ROUNDING * max(1.0, float(np.abs(s.v).max())), ROUNDING * float(np.abs(s.q).max()))
        rows = [np.full(n, size[level]) for n, (_, level) in zip(step.sizes[3:], parts[3:], strict=True)]
        self.floor = np.concatenate((of_forces, dt * of_forces, dt**2 * of_forces, *rows))

    def error(self, step: Step, R: np.ndarray, sets: list[Sets]) -> float:
        """Largest residual in units of its tolerance; the step is solved where it is at most one."""
        n = [len(contact.rows) for contact in step.problem.contacts]
        A, B, C, D_st, E_st = np.array(sets, dtype=bool).reshape(-1, 5).T
        moves = np.concatenate((np.ones(step.n_y, dtype=bool), A, B, C, np.repeat(D_st, n), np.repeat(E_st, n)))
        tol = step.parameters.tol * np.where(moves, self.kinematic, self.x) + np.where(moves, self.floor, 0.0)
        error = float((np.abs(R) / tol).max())
        return error if np.isfinite(error) else np.inf


def newton(step: Step, x: np.ndarray, max_iter: int) -> Solution:
    """Semi-smooth Newton method (143); its Jacobian is kept while the index sets stay and the residual falls fast.

    One correction more than the tolerance asks for, which is cheap then, leaves nothing but rounding.
    """
    scales, J, last_sets, last_error, converged = Scales(step), np.zeros(0), None, np.inf, False
    for n in range(max_iter + 1):
        end = end_of_step(step, x)
        sets = contact_sets(step, end)
        R = np.concatenate((smooth_residual(step, x, end), contact_residual(step, end, sets)))
        error = scales.error(step, R, sets)
        if (error <= 1.0 and (converged or n == 0)) or error == np.inf or n == max_iter:
            break
        converged = error <= 1.0
        if not converged and (sets != last_sets or error > FAST * last_error):
            J = jacobian(step, x, sets)
        try:
            x, last_sets, last_error = x - correction(step, scales, J, R), sets, error
        except np.linalg.LinAlgError:  # bodies without a solution, or numbers that are none
            return Solution(x, False, n)
    return Solution(x, error <= 1.0, n)


def correction(step: Step, scales: Scales, J: np.ndarray, R: np.ndarray) -> np.ndarray:
    """J^-1 R, split into y and z (144): where force directions depend on each other, the one with the smallest forces.

    The bodies y follow their forces z, dR_s/dy is regular; what is left for z may be singular.
    """
    n = step.n_y
    by_forces = np.linalg.solve(J[:n, :n], np.column_stack((J[:n, n:], R[:n])))  # y by z, and by R_s
    A = (J[n:, n:] - J[n:, :n] @ by_forces[:, :-1]) * scales.x[n:]
    b = R[n:] - J[n:, :n] @ by_forces[:, -1]
    rows = np.maximum(np.abs(A).max(axis=1, initial=0.0), 1e-300)
    z = scales.x[n:] * np.linalg.lstsq(A / rows[:, None], b / rows, rcond=RCOND)[0]
    return np.concatenate((by_forces[:, -1] - by_forces[:, :-1] @ z, z))


def fixed_point(step: Step, x: np.ndarray, max_sweeps: int) -> Solution:
    """Fixed-point iterations (144)-(146), and Newton's method from where they have got to now and then.

    The iterations converge linearly, Newton's method only from index sets close to the right ones: together they are
    exact where Newton's method alone runs in circles.
    """
    n_iter, J, scales = 0, None, Scales(step)
    for sweep in range(1, max_sweeps + 1):
        x, J = _bodies_for_forces(step, scales, x, J)
        if sweep % CHECK_EVERY == 0:
            checked = newton(step, x, NEWTON_CHECK)
            n_iter += checked.n_iter
            if checked.converged:
                return checked._replace(n_iter=n_iter + sweep)
        x = _forces_for_bodies(step, x)
    return Solution(x, False, n_iter + max_sweeps)


def _bodies_for_forces(
    step: Step, scales: Scales, x: np.ndarray, J: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None]:
    """Y = F(z): Newton's method (145) on R_s(y, z) = 0 with the contact forces z held, and its Jacobian."""
    n, last = step.n_y, np.inf
    tol = step.parameters.tol * scales.kinematic[:n] + scales.floor[:n]
    for _ in range(step.parameters.max_iter):
        end = end_of_step(step, x)
        R = smooth_residual(step, x, end)
        error = float((np.abs(R) / tol).max())
        if error <= 1.0 or not np.isfinite(error):
            break
        if J is None or error > FAST * last:
            J, nudge = np.empty((n, n)), nudges(step, end.motion)
            for j in range(n):
                moved = x.copy()
                moved[j] += nudge[j]
                J[:, j] = (smooth_residual(step, moved, end_of_step(step, moved)) - R) / nudge[j]
        x, last = x.copy(), error
        x[:n] -= np.linalg.solve(J, R)
    return x, J


def _forces_for_bodies(step: Step, x: np.ndarray) -> np.ndarray:
    """Z = p(y, z) (146): the laws with prox, solved for the unknowns behind kappa_hat_N, P_N and P_F."""
    end, u = end_of_step(step, x), step.split(x.copy())
    kinematics, wanted = contact_kinematics(step, end), []
    for k, (contact, F) in enumerate(zip(step.problem.contacts, step.problem.friction, strict=True)):
        new = prox_updates(contact.law, kinematics[k], end.forces[k], step.r_N[k], step.r_F[k], step.laws)
        if not step.follows[k]:
            new = (0.0, 0.0, 0.0, np.zeros(len(contact.rows)), np.zeros(len(contact.rows)))
        kappa_hat_N, P_N, u.la_N[k], P_F, u.la_F[F] = new
        wanted.append((kappa_hat_N, P_N, P_F))
    # the known parts of (102), (95) and (113) with the new forces
    known = end_of_step(step, np.concatenate(u), end.motion).forces
    for k, (F, (kappa_hat_N, P_N, P_F)) in enumerate(zip(step.problem.friction, wanted, strict=True)):
        u.kappa_N[k] += kappa_hat_N - known[k].kappa_hat_N
        u.La_N[k] += P_N - known[k].P_N
        u.La_F[F] += P_F - known[k].P_F
    return np.concatenate(u)
