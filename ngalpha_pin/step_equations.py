"""The nonlinear equations R(x) = 0 of one step, (127)-(142), and their Newton correction reduced to the multipliers.

The unknowns (126) are x = (a, U, Q, multipliers) at the end of the step, with the multipliers of the contacts of one
subset, of dry friction in joints and of the bilateral constraints (see `layout`). On the Lie group the position update
(125) is q1 = q0 (+) dq with the tangent step dq = dt v0 + dt^2/2 ((1 - 2 beta) a_bar0 + 2 beta a_bar1) + Q.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from scipy.linalg.lapack import dgesv, dposv

from .contact_kinematics import Motion, Rows
from .contact_laws import ContactResidual
from .contact_table import Subset
from .joint_friction import FrictionResidual
from .state import State
from .system import Dynamics, System

if TYPE_CHECKING:
    from .generalized_alpha import GeneralizedAlpha

ALPHA_R = 0.3  # prox parameter r_k = ALPHA_R / (w_k^T M^-1 w_k)
ROUNDING = 64 * np.finfo(float).eps
SINGULAR = 1e-11  # smallest pivot of the scaled Newton matrix, relative to the largest
RCOND = 1e-10  # singular values below this are left out by the minimum-norm correction
ALL_CHOICES = 4  # contacts for which every pattern of prox parameters is tried; with more, the simple ones
PREFER = 1e12  # factor on the prox parameter of a contact that prefers slip; zero prefers stick


class Choice(NamedTuple):
    """How Newton treats friction: factors on the prox parameters, shape (k,), and whether with the laws of the paper.

    A large factor keeps any slip, a small one keeps a contact sticking as long as its cone allows. Friction that acts
    from the moment of impact and follows the slip with its impulses alone can leave an impact with dependent
    directions, or a frictional catastrophe, without a solution; (80) and (112) have one.
    """

    factors: np.ndarray | None
    paper: bool


class Evaluation:
    """R(x) and what it was computed from.

    Attributes:
        x: the iterate.
        q, v, dq: configuration, velocity and tangent step at the end of the step.
        dynamics: equations of motion there.
        R: residuals of a, U and Q, shape (3, nv).
        rows, contact: contact kinematics and laws, where the step has contacts.
        parts: the kinematics of contacts, joint friction and constraints, those that the step has.
        friction: laws of joint friction, where the scene has it.
        W: generalized force directions of all rows, transposed, shape (rows, nv).
        y, kinematic, law: kinematics of all multipliers, where they have to vanish, and the residual, shape (n,).
        z: forces of the contact laws (see `contact_laws`), shape (n_c,).
        ratio, share: kappa_hat_N / P_N and, where that ratio is free to move, P_F / P_N.
        error: largest scaled residual; the step has converged at <= 1.
    """

    x: np.ndarray
    q: np.ndarray
    v: np.ndarray
    dq: np.ndarray
    dynamics: Dynamics
    R: np.ndarray
    rows: Rows
    parts: list[KinematicRows]
    contact: ContactResidual
    friction: FrictionResidual
    W: np.ndarray
    y: np.ndarray
    kinematic: np.ndarray
    law: np.ndarray
    z: np.ndarray
    ratio: np.ndarray
    share: np.ndarray
    error: float


class KinematicRows(Protocol):
    """Rows of one kind: of contacts, joint friction or constraints.

    Attributes:
        W: generalized force directions, transposed, shape (rows, nv).
        rate, acceleration: rates of position-level rows or velocity-level quantities, and their derivatives by time.
        sizes: of the positions and of the velocities that the rows subtract, whose rounding is felt [m], [m/s].
    """

    W: np.ndarray
    sizes: tuple[float, float]
    rate: np.ndarray
    acceleration: np.ndarray

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each of the shape of W."""


class StepEquations:
    """R(x) of one step.

    Args:
        system: compiled scene.
        method: coefficients (72), tolerance and laws.
        state: start of the step; its dt has been made equal to `dt` (see `rescale`).
        dt: step [s].
        sub: contacts that are unknowns.
        memory: la and la_bar of those contacts at the start of the step, normal entries first, shape (k + m,) each.
    """

    def __init__(
        self,
        system: System,
        method: GeneralizedAlpha,
        state: State,
        dt: float,
        sub: Subset,
        memory: tuple[np.ndarray, np.ndarray],
    ):
        self.system, self.method, self.sub, self.state, self.dt = system, method, sub, state, dt
        self.paper = method.paper
        af, am, gamma, beta = method.alpha_f, method.alpha_m, method.gamma, method.beta
        self._c = c = (1 - af) / (1 - am)
        self.gamma_c, self.beta_c = dt * gamma * c, dt * dt * beta * c
        self._weights: tuple[np.ndarray, ...] = ()
        self.smallest_forces = False
        self.nv = nv = system.nv
        self.layout = layout = system.layout(sub)
        self.n = layout.n
        # the known part of a_bar1 (71), la_bar1 (96), (114), and of their quadratures (70)
        y = np.concatenate((state.a, memory[0], state.tau_f))
        y_bar = np.concatenate((state.a_bar, memory[1], state.tau_f_bar))
        self._known = (af * y - am * y_bar) / (1 - am)
        once = dt * ((1 - gamma) * y_bar + gamma * self._known)
        twice = (dt * dt) * ((0.5 - beta) * y_bar + beta * self._known)
        self.v_free, self.dq_free = state.v + once[:nv], dt * state.v + twice[:nv]  # (73) without a1, U, Q
        k, m = sub.k, sub.m
        j = nv + k + m
        self._z_known = np.concatenate((twice[nv : nv + k], once[nv:j], np.zeros(k + m)))
        self._kappa_F_known = twice[nv + k : j]
        self._friction_known = once[j:]
        self._la_start = memory[0]
        self._start_rates = sub.e * system.contact_rates(sub, state.q, state.v) if sub.bounces else None  # (44), (48)

    def start(self) -> np.ndarray:
        """First iterate: the acceleration and the forces of the start of the step, no impulses."""
        nv, layout = self.nv, self.layout
        x = np.zeros(3 * nv + self.n)
        x[:nv] = self.state.a
        if self.n:
            x[3 * nv :][layout.at_a] = np.concatenate((self._la_start, self.state.tau_f, self.state.la_b))
        return x

    def bars(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """a_bar (nv,), la_bar (k + m,) and tau_f_bar (f,) at the end of the step (71), (96), (114)."""
        nv, j, layout = self.nv, self.sub.k + self.sub.m, self.layout
        la = x[3 * nv :][layout.at_a][: j + layout.f]
        bar = self._known + self._c * np.concatenate((x[:nv], la))
        return bar[:nv], bar[nv : nv + j], bar[nv + j :]

    def evaluate(self, x: np.ndarray) -> Evaluation:
        """R(x) (127)-(142)."""
        ev, nv = Evaluation(), self.nv
        a = x[:nv]
        ev.x = x
        ev.v = self.v_free + self.gamma_c * a + x[nv : 2 * nv]  # (73)
        ev.dq = self.dq_free + self.beta_c * a + x[2 * nv : 3 * nv]
        ev.q = self.system.integrate(self.state.q, ev.dq)  # (125)
        ev.dynamics = dynamics = self.system.dynamics(self.state.t + self.dt, ev.q, ev.v, a)
        if self.n == 0:
            ev.R = dynamics.residual[None]
            if not self._weights:
                self._set_weights(ev)
            ev.error = float((np.abs(dynamics.residual) * self._weights[0]).max())
            return ev
        self._kinematics(ev)
        multipliers = x[3 * nv :]
        forces = self._forces(ev, multipliers)
        ev.R = np.empty((3, nv))
        ev.R[0] = dynamics.residual  # (74), (78), (80)
        ev.R[1:] = x[nv : 3 * nv].reshape(2, nv) @ dynamics.M
        ev.R -= forces @ ev.W
        if not self._weights:
            self._set_weights(ev)
        self._laws(ev, multipliers)
        ev.error = self._error(ev)
        return ev

    def _forces(self, ev: Evaluation, multipliers: np.ndarray) -> np.ndarray:
        """Forces la, La and kappa of all rows, shape (3, rows); z, ratio and share are kept in `ev`."""
        sub, layout = self.sub, self.layout
        forces = np.zeros((3, layout.rows))
        forces[0], forces[1] = multipliers[layout.at_a], multipliers[layout.at_v]
        forces[2, layout.position_rows] = multipliers[layout.at_g]
        forces[2, layout.half_rows] = self.dt / 2 * multipliers[layout.half_v]  # (80)
        if sub.k:
            ev.z = z = multipliers[: layout.n_c] + self._z_known
            la, La = forces[:2, layout.contacts]
            z[: 2 * sub.k + sub.m] += self._quadrature(la)  # (102), (95), (113)
            if sub.m:
                forces[2, sub.k : sub.k + sub.m] = self._friction_displacement(ev, z, La, la)
        return forces

    def _kinematics(self, ev: Evaluation) -> None:
        """Rows of contacts, joint friction and constraints, and what they make of q, v and a."""
        system, sub, layout, a = self.system, self.sub, self.layout, ev.x[: self.nv]
        ev.parts, ev.y, gaps = [], np.empty(self.n), []
        if sub.k:
            ev.rows = system.contact_rows(sub, ev.q, ev.v, a)
            ev.parts.append(ev.rows)
            gaps.append(ev.rows.g_N)
        if layout.f:
            ev.parts.append(system.joint_friction.rows(ev.v, a))
        if layout.rows > sub.k + sub.m + layout.f:
            constraints = system.constraint_rows(self.state.t + self.dt, ev.q, ev.v, a)
            ev.parts.append(constraints)
            gaps.append(constraints.g)
        ev.W = _stacked([part.W for part in ev.parts])
        ev.y[layout.at_g] = _stacked(gaps) if gaps else 0.0
        ev.y[layout.at_v] = _stacked([part.rate for part in ev.parts])
        ev.y[layout.at_a] = _stacked([part.acceleration for part in ev.parts])
        if self._start_rates is not None:
            ev.y[sub.k : sub.k + len(self._start_rates)] += self._start_rates  # (44), (48)

    def _laws(self, ev: Evaluation, multipliers: np.ndarray) -> None:
        """Residual of the force laws; constraints ask for their kinematics to vanish, (84) and (85)."""
        sub, layout, n_c = self.sub, self.layout, self.layout.n_c
        if sub.k:
            La, gamma_F = multipliers[sub.k : 2 * sub.k + sub.m], ev.rows.rate[sub.k :]
            ev.contact = ContactResidual(sub, ev.y[:n_c], ev.z, La, gamma_F, self._r[:n_c], self.paper)
            if layout.n == n_c:
                ev.law, ev.kinematic = ev.contact.R, ev.contact.kinematic
                return
        ev.law, ev.kinematic = ev.y.copy(), np.ones(self.n, dtype=bool)
        if sub.k:
            ev.law[:n_c], ev.kinematic[:n_c] = ev.contact.R, ev.contact.kinematic
        if layout.f:
            v, a = layout.friction_v, layout.friction_a
            both = slice(v.start, a.stop)
            ev.friction = FrictionResidual(
                self.system.joint_friction, ev.y[both], multipliers[both], self._r[both], self._friction_known,
                self.dt, self.gamma_c, self.paper,
            )  # fmt: skip
            ev.law[both], ev.kinematic[both] = ev.friction.R, ev.friction.kinematic

    def _quadrature(self, la: np.ndarray) -> np.ndarray:
        """What la adds to kappa_hat_N and P, shape (2 k + m,)."""
        return np.concatenate((self.beta_c * la[: self.sub.k], self.gamma_c * la))

    def _friction_displacement(self, ev: Evaluation, z: np.ndarray, La: np.ndarray, la: np.ndarray) -> np.ndarray:
        """kappa_F, with its derivatives kept in `ev`.

        The paper lets an impulsive friction force act for dt/2 (80). The normal law knows better: kappa_hat_N / P_N is
        the time since the impact, so kappa_hat_F = (kappa_hat_N / P_N) P_F.
        """
        sub, k, dt = self.sub, self.sub.k, self.dt
        if self.paper:
            ev.ratio = np.full(k, dt / 2)
            return dt / 2 * La[k:]
        P_N, P_F = z[k : 2 * k], z[2 * k : 2 * k + sub.m]
        carries = P_N > 1e-300
        safe = np.where(carries, P_N, 1.0)
        free = np.where(carries, z[:k] / safe, dt / 2)
        ev.ratio = np.minimum(np.maximum(free, 0.0), dt)
        ev.share = P_F * ((carries & (free == ev.ratio)) / safe)[sub.of_F]
        return ev.ratio[sub.of_F] * P_F - self.beta_c * la[k:] - self._kappa_F_known

    def _set_weights(self, ev: Evaluation) -> None:
        """Scales of all rows and the prox parameters, fixed for the step.

        The force unit f [sqrt(kg) m/s^2] is the weight or the largest h, in kinetic scaling. A contact row w has the
        inverse mass G = w M^-1 w^T; sqrt(G) f is its unit of acceleration, f / sqrt(G) its unit of force, in any units.
        """
        tol, dt, dynamics = self.method.tol, self.dt, ev.dynamics
        root_M = np.sqrt(dynamics.M.diagonal())
        h = dynamics.residual - dynamics.M @ ev.x[: self.nv]
        f = max(self.system.weight, float((np.abs(h) / root_M).max()), 1e-300)
        by_dof = 1.0 / (tol * f * root_M)
        if self.n == 0:
            self._weights = (by_dof, by_dof)
            return
        self._by_dof = by_dof * np.array([[1.0], [1.0 / dt], [1.0 / (dt * dt)]])
        layout = self.layout
        G = np.einsum("ij,ji->i", ev.W, dposv(dynamics.M, ev.W.T)[1])
        if layout.rows > layout.constraints.start:
            G[layout.constraints] = self.system.constraints.by_group(G[layout.constraints])
        G = G[layout.scale_rows]
        self._r = self.r = ALPHA_R / G
        root, level = np.sqrt(G), np.array([1.0, dt, dt * dt])[layout.levels]
        sizes = np.array([part.sizes for part in ev.parts]).max(axis=0)
        floor = ROUNDING * np.array([0.0, sizes[1], sizes[0]])[layout.levels]
        self.force_scale = f / root[: layout.k]
        self.row_scale, self.column_scale = 1.0 / (level * root), level / root
        self._weights = 1.0 / (tol * f / self.row_scale + floor), 1.0 / (tol * f * self.column_scale)

    def _error(self, ev: Evaluation) -> float:
        """Largest residual in units of its tolerance; infinite where it is not a number."""
        kinematic, direct = self._weights
        smooth = float((np.abs(ev.R) * self._by_dof).max())
        laws = float((np.abs(ev.law) * np.where(ev.kinematic, kinematic, direct)).max())
        return max(smooth, laws) if smooth == smooth and laws == laws else np.inf

    def linearise(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """Response of the step to the multipliers.

        With S = M + gamma_c D + beta_c K T the blocks of a, U and Q are eliminated:
        da = S^-1 (W dla - R_a - D dU - K T dQ), dU = M^-1 (W dLa - R_U), dQ = M^-1 (W dkappa - R_Q).
        Derivatives of M and W by q, which enter multiplied by dt^2, are left out.

        Returns:
            Z: (da, dU, dQ) per unit of each multiplier, in the last column what the residuals ask for, (3 nv, n + 1).
            H: change of y (see `contact_laws`) with the columns of Z, (n, n + 1).
        """
        layout, nv, n = self.layout, self.nv, self.n
        M = ev.dynamics.M
        S, D, KT, T = self._stiffness(ev)
        if n == 0:
            Z = np.zeros((3 * nv, 1))
            Z[:nv, 0] = -dgesv(S, ev.R[0])[2]
            return Z, np.zeros((0, 1))
        W, rows = ev.W, layout.rows
        right = np.empty((nv, rows + 2))
        right[:, :rows], right[:, rows:] = W.T, ev.R[1:].T
        by_M = dposv(M, right)[1]
        Z = np.zeros((3 * nv, n + 1))
        dU, dQ = Z[nv : 2 * nv], Z[2 * nv :]
        dU[:, layout.at_v] = by_M[:, :rows]
        dQ[:, :n] = by_M[:, :rows] @ self._displacements(ev)
        dU[:, n], dQ[:, n] = -by_M[:, rows], -by_M[:, rows + 1]
        right = -(D @ dU) - KT @ dQ
        right[:, layout.at_a] += W.T
        right[:, n] -= ev.R[0]
        Z[:nv] = da = dgesv(S, right)[2]
        motion = self.system.motion(ev.v, ev.x[:nv])
        X, Y = (_stacked(list(blocks)) for blocks in zip(*(p.derivatives(motion) for p in ev.parts), strict=True))
        dv, dq = self.gamma_c * da + dU, self.beta_c * da + dQ
        if T is not None:
            dq = T @ dq
        H = np.empty((n, n + 1))
        H[layout.at_g] = W[layout.position_rows] @ dq
        H[layout.at_v] = W @ dv + X @ dq
        H[layout.at_a] = W @ da + Y @ dv
        return Z, H

    def _displacements(self, ev: Evaluation) -> np.ndarray:
        """Derivative of kappa, the forces on position level, by the multipliers, shape (rows, n)."""
        sub, k, m, layout = self.sub, self.sub.k, self.sub.m, self.layout
        E = np.zeros((layout.rows, self.n))
        E[layout.position_rows, layout.at_g] = np.eye(k + layout.kb)
        E[layout.half_rows, layout.half_v] = self.dt / 2 * np.eye(layout.f + layout.mb)  # (80)
        if m:
            i, ratio = np.arange(m), ev.ratio[sub.of_F]
            E[k + i, 2 * k + i] = ratio
            if not self.paper:
                E[k + i, 3 * k + m + i] = ratio * self.gamma_c - self.beta_c
                # the time since impact moves with the normal multipliers
                share, N = ev.share, sub.of_F
                E[k + i, N] = share
                E[k + i, k + N] = -ratio * share
                E[k + i, 2 * k + m + N] = (self.beta_c - self.gamma_c * ratio) * share
        return E

    def _stiffness(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]:
        """S = M + gamma_c D + beta_c K T, D, K T and T = d q1 / d dq; None stands for the identity."""
        T = None if self.system.flat else self.system.d_integrate(self.state.q, ev.dq)
        M, K, D = ev.dynamics.M, ev.dynamics.K, ev.dynamics.D
        KT = K if T is None else K @ T
        return M + self.gamma_c * D + self.beta_c * KT, D, KT, T

    def _force_derivative(self) -> np.ndarray:
        """Derivative of z by the multipliers, shape (n_c, n + 1)."""
        k, j, n = self.sub.k, self.sub.k + self.sub.m, self.n
        Dz = np.eye(self.layout.n_c, n + 1)
        i = np.arange(j)
        Dz[k + i, k + j + i] = self.gamma_c
        Dz[i[:k], k + j + i[:k]] = self.beta_c
        return Dz

    def _jacobian(self, ev: Evaluation, H: np.ndarray) -> np.ndarray:
        """Derivative of the residual of the laws by the multipliers, shape (n, n + 1); see `linearise`."""
        if ev.kinematic.all():
            return H
        n_c, layout = self.layout.n_c, self.layout
        J = H.copy()
        if n_c:
            J[:n_c] = ev.contact.jacobian(H[:n_c], self._force_derivative())
        if layout.f:
            both = slice(layout.friction_v.start, layout.friction_a.stop)
            J[both] = ev.friction.jacobian(H[both], both.start)
        return J

    def correction(self, ev: Evaluation) -> tuple[np.ndarray, bool]:
        """Newton correction dx (143), and whether directions were dependent so that the minimum norm was taken."""
        Z, H = self.linearise(ev)
        if self.n == 0:
            return Z[:, 0], False
        n, J, row_scale = self.n, self._jacobian(ev, H), self.row_scale
        if not ev.kinematic.all():
            row_scale = np.where(ev.kinematic, row_scale, 1.0 / self.column_scale)
        A = J[:, :n] * row_scale[:, None] * self.column_scale
        b = -(ev.law + J[:, n]) * row_scale
        lu, _, y, info = dgesv(A, b)
        pivots = np.abs(lu.diagonal())
        dependent = info != 0 or not pivots.min() > SINGULAR * pivots.max()
        if dependent:
            if not np.isfinite(A).all():
                return np.full(3 * self.nv + n, np.nan), False
            # the smallest change, so that forces that are not unique stay as they are from step to step; or, where that
            # has led nowhere, the smallest forces
            z = self.smallest_forces * ev.x[3 * self.nv :] / self.column_scale
            y = np.linalg.lstsq(A, b + A @ z, rcond=RCOND)[0] - z
        dz = y * self.column_scale
        return np.concatenate((Z[:, :n] @ dz + Z[:, n], dz)), dependent

    def row_forces(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Whole forces on the three levels: of the contacts and of g (kappa_hat), of all rows (P), of all rows (la).

        Those of the constraints are without their known part, which no law looks at; a share of friction in the gaps
        stands behind the normal percussions.
        """
        k, m, layout = self.sub.k, self.sub.m, self.layout
        multipliers = ev.x[3 * self.nv :]
        P, la = multipliers[layout.at_v].copy(), multipliers[layout.at_a]
        P[layout.constraints] += self.gamma_c * la[layout.constraints]
        P[: k + m] = ev.z[k : 2 * k + m]
        if layout.f:
            P[layout.friction] = ev.friction.P
        kappa_g = multipliers[layout.at_g][k:] + self.beta_c * la[layout.constraints][: layout.kb]
        shift = np.zeros(m) if self.paper else ev.ratio[self.sub.of_F] * P[k : k + m]
        return np.concatenate((ev.z[:k], shift, kappa_g)), P, la

    def with_forces(self, ev: Evaluation, kappa: np.ndarray, P: np.ndarray, la: np.ndarray) -> np.ndarray:
        """The iterate with the forces of `row_forces`, with a, U and Q that fulfil (127) to first order."""
        k, m, nv, layout = self.sub.k, self.sub.m, self.nv, self.layout
        multipliers = np.empty(self.n)
        multipliers[layout.at_a] = la
        La = P - self.gamma_c * la
        La[: k + m] -= self._z_known[k : 2 * k + m]
        La[layout.friction] -= self._friction_known
        multipliers[layout.at_v] = La
        on_position = np.concatenate((kappa[:k] - self._z_known[:k], kappa[k + m :]))
        multipliers[layout.at_g] = on_position - self.beta_c * la[layout.position_rows]
        forces = self._forces(Evaluation(), multipliers)
        M, W = ev.dynamics.M, ev.W
        UQ = np.linalg.solve(M, (forces[1:] @ W).T)
        S, D, KT, _ = self._stiffness(ev)
        old = ev.x[nv : 3 * nv].reshape(2, nv)
        more = ev.x[3 * nv :][layout.at_a] - la
        R_a = ev.R[0] + more @ W + D @ (UQ[:, 0] - old[0]) + KT @ (UQ[:, 1] - old[1])
        return np.concatenate((ev.x[:nv] - np.linalg.solve(S, R_a), UQ[:, 0], UQ[:, 1], multipliers))

    def choices(self) -> Iterator[Choice]:
        """Prox parameters of friction to try where the usual ones do not lead to a solution.

        Any r > 0 has the same solutions, but not the same way there: with dependent directions r decides which contact
        gives up sticking where not all of them can stick; in a frictional catastrophe, which contact stops slipping.
        """
        with_friction = np.unique(self.sub.of_F)
        n = len(with_friction)
        if n == 0:
            return
        if n <= ALL_CHOICES:
            patterns = np.array(sorted(product((False, True), repeat=n), key=sum)[1:]).reshape(-1, n)
        else:
            patterns = np.vstack((np.eye(n, dtype=bool)[: 4 * ALL_CHOICES], np.ones((1, n), dtype=bool)))
        for factor in (PREFER, 0.0):
            for pattern in patterns:
                factors = np.ones(self.sub.k)
                factors[with_friction[pattern]] = factor
                yield Choice(factors, self.paper)

    def choose(self, choice: Choice) -> None:
        """Prox parameters and slip law of the next evaluations."""
        self.paper = choice.paper
        self._r = self.r.copy()
        if choice.factors is not None:
            self._r[self.sub.friction_places] *= np.tile(choice.factors[self.sub.of_F], 2)


def _stacked(parts: list[np.ndarray]) -> np.ndarray:
    """Rows of all parts in one array; nothing is copied where there is but one."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
