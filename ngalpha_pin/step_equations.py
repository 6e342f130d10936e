"""The nonlinear equations R(x) = 0 of one step, (127)-(142), and their Newton correction reduced to the multipliers.

The unknowns (126) are x = (a, U, Q, kappa_N, La_N, la_N, La_F, la_F) at the end of the step, of the contacts of one subset.
On the Lie group the position update (125) is q1 = q0 (+) dq with dq = dt v0 + dt^2/2 ((1 - 2 beta) a_bar0 + 2 beta a_bar1) + Q.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dgesv, dposv

from .contact_kinematics import Rows
from .contact_laws import ContactResidual, Multipliers
from .contact_table import Subset
from .state import State
from .system import Dynamics, System

if TYPE_CHECKING:
    from .generalized_alpha import GeneralizedAlpha

ALPHA_R = 0.3  # prox parameter r_k = ALPHA_R / (w_k^T M^-1 w_k)
ROUNDING = 64 * np.finfo(float).eps
SINGULAR = 1e-11  # smallest pivot of the scaled Newton matrix, relative to the largest
ALL_CHOICES = 4  # contacts for which every pattern of preferred slip is tried; with more, the simple ones
SLIP = 1e12  # factor on the prox parameter of friction of a contact that prefers slip
RCOND = 1e-10  # singular values below this are left out by the minimum-norm correction


class Choice(NamedTuple):
    """How Newton treats friction: contacts that keep any slip, shape (k,), and whether slip rules the whole percussion.

    Impulses alone following the slip at the end of the step can leave an impact with dependent directions without a
    solution; (112), which takes the whole percussion along, always has one.
    """

    prefers_slip: np.ndarray | None
    whole_percussion: bool


class Evaluation:
    """R(x) and what it was computed from.

    Attributes:
        x: the iterate.
        q, v: configuration and velocity at the end of the step.
        error: largest scaled residual; the step has converged at <= 1.
    """

    __slots__ = (
        "R_a", "R_U", "R_Q", "contact", "dq", "dynamics", "error", "q", "ratio", "rows", "share", "v", "x", "xi", "z"
    )  # fmt: skip


class StepEquations:
    """R(x) of one step.

    Args:
        system: compiled scene.
        method: coefficients (72), tolerance and laws.
        state: start of the step; its dt has been made equal to `dt` (see `GeneralizedAlpha.rescale`).
        dt: step [s].
        sub: contacts that are unknowns.
        memory: la_N, la_N_bar (k,), la_F, la_F_bar (m,) of those contacts at the start of the step.
    """

    def __init__(
        self,
        system: System,
        method: GeneralizedAlpha,
        state: State,
        dt: float,
        sub: Subset,
        memory: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    ):
        self.system, self.method, self.sub, self.state, self.dt = system, method, sub, state, dt
        self.paper = self.whole_percussion = method.paper
        af, am, gamma, beta = method.alpha_f, method.alpha_m, method.gamma, method.beta
        c = (1 - af) / (1 - am)
        self.gamma_c, self.beta_c = dt * gamma * c, dt * dt * beta * c
        self._weights: tuple[np.ndarray, ...] | None = None

        def start(y: np.ndarray, y_bar: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            """The part of y_bar1 (71) that is known, and of its two quadratures (70)."""
            known = (af * y - am * y_bar) / (1 - am)
            once = dt * ((1 - gamma) * y_bar + gamma * known)
            return known, once, dt * dt * ((0.5 - beta) * y_bar + beta * known)

        self._known_a, once, twice = start(state.a, state.a_bar)
        self.v_free, self.dq_free = state.v + once, dt * state.v + twice  # (73) without a1, U, Q
        la_N, la_N_bar, la_F, la_F_bar = memory
        self._known_N, self._P_N_known, self._kappa_known = start(la_N, la_N_bar)
        self._known_F, self._P_F_known, self._kappa_F_known = start(la_F, la_F_bar)
        self._c, self._la_start = c, (la_N, la_F)
        nv, k, m = system.model.nv, sub.k, sub.m
        ends = np.cumsum([0, nv, nv, nv, k, k, k, m, m])
        self.slices = tuple(slice(int(i), int(j)) for i, j in zip(ends[:-1], ends[1:], strict=True))
        self.size = int(ends[-1])
        self._restitution = self._start_rates()

    def _start_rates(self) -> np.ndarray | None:
        """e_N g_N_dot and e_F gamma_F at the start of the step (44), (48), or None where all are zero."""
        sub = self.sub
        e = np.concatenate((sub.e_N, sub.e_F))
        if not e.any():
            return None
        return e * self.system.contact_rates(sub, self.state.q, self.state.v)

    def start(self) -> np.ndarray:
        """First iterate: the acceleration and the forces of the start of the step, no impulses."""
        x = np.zeros(self.size)
        x[self.slices[0]] = self.state.a
        x[self.slices[5]], x[self.slices[7]] = self._la_start
        return x

    def bars(self, a: np.ndarray, la_N: np.ndarray, la_F: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """a_bar, la_N_bar, la_F_bar at the end of the step (71), (96), (114)."""
        return self._known_a + self._c * a, self._known_N + self._c * la_N, self._known_F + self._c * la_F

    def evaluate(self, x: np.ndarray) -> Evaluation:
        """R(x) (127)-(142)."""
        ev = Evaluation()
        sub, dt = self.sub, self.dt
        a, U, Q, kappa_N, La_N, la_N, La_F, la_F = (x[s] for s in self.slices)
        ev.x = x
        ev.v = self.v_free + self.gamma_c * a + U  # (73)
        ev.dq = self.dq_free + self.beta_c * a + Q
        ev.q = pin.integrate(self.system.model, self.state.q, ev.dq)  # (125)
        ev.dynamics = dynamics = self.system.dynamics(self.state.t + dt, ev.q, ev.v, a)
        ev.R_a, ev.R_U, ev.R_Q = dynamics.residual, dynamics.M @ U, dynamics.M @ Q
        if sub.k == 0:
            ev.error = self._error(ev)
            return ev
        ev.rows = rows = self.system.contact_rows(sub, ev.v, a)
        W_N, W_F = rows.W[: sub.k], rows.W[sub.k :]
        kappa_hat, P_N, P_F = self._percussions(kappa_N, La_N, la_N, La_F, la_F)
        ev.z = z = Multipliers(kappa_hat, P_N, La_N, la_N, P_F, La_F, la_F)
        kappa_F = self._friction_displacement(ev, z)
        ev.R_a = ev.R_a - la_N @ W_N - la_F @ W_F  # (74)
        ev.R_U = ev.R_U - La_N @ W_N - La_F @ W_F  # (78)
        ev.R_Q = ev.R_Q - kappa_N @ W_N - kappa_F @ W_F  # (80)
        ev.xi = xi = rows.rate if self._restitution is None else rows.rate + self._restitution  # (44), (48)
        if self._weights is None:
            self._set_weights(dynamics, rows)
        gamma_F = rows.rate[sub.k :]
        ev.contact = ContactResidual(sub, z, rows.g_N, xi, rows.acceleration, gamma_F, self.r, self._r_F, self.whole_percussion)
        ev.error = self._error(ev)
        return ev

    def _percussions(
        self, kappa_N: np.ndarray, La_N: np.ndarray, la_N: np.ndarray, La_F: np.ndarray, la_F: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """kappa_hat_N (102), P_N (95) and P_F (113)."""
        return (
            kappa_N + self.beta_c * la_N + self._kappa_known,
            La_N + self.gamma_c * la_N + self._P_N_known,
            La_F + self.gamma_c * la_F + self._P_F_known,
        )

    def impulses(self, kappa_hat_N: np.ndarray, P: np.ndarray, la: np.ndarray) -> np.ndarray:
        """The multipliers of x from kappa_hat_N (102), P (95), (113) and la, normal rows first."""
        k = self.sub.k
        La = P - self.gamma_c * la - np.concatenate((self._P_N_known, self._P_F_known))
        kappa = kappa_hat_N - self.beta_c * la[:k] - self._kappa_known
        return np.concatenate((kappa, La[:k], la[:k], La[k:], la[k:]))

    def with_multipliers(self, ev: Evaluation, new: np.ndarray) -> np.ndarray:
        """The iterate with other multipliers, and a, U and Q that fulfil (127) to first order."""
        sub, k = self.sub, self.sub.k
        M, W = ev.dynamics.M, ev.rows.W
        kappa_N, La_N, la_N, La_F, la_F = np.split(new, np.cumsum([k, k, k, sub.m]))
        kappa_hat, P_N, P_F = self._percussions(kappa_N, La_N, la_N, La_F, la_F)
        kappa_F = self._friction_displacement(Evaluation(), Multipliers(kappa_hat, P_N, La_N, la_N, P_F, La_F, la_F))
        U = np.linalg.solve(M, np.concatenate((La_N, La_F)) @ W)
        Q = np.linalg.solve(M, np.concatenate((kappa_N, kappa_F)) @ W)
        a, U_old, Q_old, *_ = (ev.x[s] for s in self.slices)
        la_old = np.concatenate((ev.z.la_N, ev.z.la_F))
        R_a = ev.R_a + (la_old - np.concatenate((la_N, la_F))) @ W
        S, D, KT, _ = self._stiffness(ev)
        a = a - np.linalg.solve(S, R_a + D @ (U - U_old) + KT @ (Q - Q_old))
        return np.concatenate((a, U, Q, new))

    def choices(self) -> Iterator[Choice]:
        """Prox parameters of friction to try where force directions are dependent.

        Any r > 0 has the same solutions, but not the same way there: r decides which contact gives up sticking where not
        all of them can stick, so each one is given the chance.
        """
        with_friction = np.unique(self.sub.of_F)
        n = len(with_friction)
        if n <= ALL_CHOICES:
            patterns = np.array(sorted(product((False, True), repeat=n), key=sum)[1:]).reshape(-1, n)
        else:
            patterns = np.vstack((np.eye(n, dtype=bool)[: 4 * ALL_CHOICES], np.ones((1, n), dtype=bool)))
        for pattern in patterns:
            slips = np.zeros(self.sub.k, dtype=bool)
            slips[with_friction] = pattern
            yield Choice(slips, self.whole_percussion)

    def choose(self, choice: Choice) -> None:
        """Prox parameters and slip law of the next evaluations."""
        self.whole_percussion = choice.whole_percussion
        self._r_F = self.r if choice.prefers_slip is None else np.where(choice.prefers_slip, SLIP * self.r, self.r)

    def _friction_displacement(self, ev: Evaluation, z: Multipliers) -> np.ndarray:
        """kappa_F, with its derivatives kept in `ev`.

        The paper lets an impulsive friction force act for dt/2 (80). The normal law knows better: kappa_hat_N / P_N is
        the time since the impact, so kappa_hat_F = (kappa_hat_N / P_N) P_F.
        """
        sub, dt = self.sub, self.dt
        ev.share = None
        if self.paper:
            ev.ratio = np.full(sub.k, dt / 2)
            return dt / 2 * z.La_F
        carries = z.P_N > 1e-300
        free = z.kappa_hat_N / np.where(carries, z.P_N, 1.0)
        ev.ratio = np.where(carries, np.minimum(np.maximum(free, 0.0), dt), dt / 2)
        if sub.m:
            inside = carries & (free > 0.0) & (free < dt)
            ev.share = z.P_F * (inside / np.where(carries, z.P_N, 1.0))[sub.of_F]
        return ev.ratio[sub.of_F] * z.P_F - self.beta_c * z.la_F - self._kappa_F_known

    def _set_weights(self, dynamics: Dynamics, rows: Rows) -> None:
        """Scales of the contact rows and the prox parameters, fixed for the step.

        A row w has the inverse mass G = w M^-1 w^T; with the force unit f [sqrt(kg) m/s^2] of the step, sqrt(G) f is its
        unit of acceleration and f / sqrt(G) its unit of force, whatever units the model is in.
        """
        sub, tol, dt, k, m = self.sub, self.method.tol, self.dt, self.sub.k, self.sub.m
        f = self._force_unit(dynamics)
        G = np.einsum("ij,ji->i", rows.W, dposv(dynamics.M, rows.W.T)[1])
        G_N = G[:k]
        self.r = ALPHA_R / G_N
        G_F = G[k:]
        if m:
            G_most = np.zeros(k)
            np.maximum.at(G_most, sub.of_F, G_F)
            G_F = np.maximum(G_most, 1e-300)[sub.of_F]
        root_N, root_F = np.sqrt(G_N), np.sqrt(G_F)
        root = np.concatenate((root_N, root_N, root_N, root_F, root_F))
        level = np.concatenate((np.full(k, dt * dt), np.full(k, dt), np.ones(k), np.full(m, dt), np.ones(m)))
        length = float(np.abs(rows.c).max())
        floor = np.zeros(3 * k + 2 * m)
        floor[:k] = ROUNDING * length
        floor[k : 2 * k] = floor[3 * k : 3 * k + m] = ROUNDING * float(np.abs(rows.c_dot).max())
        self.force_scale = f / root_N
        self.row_scale, self.column_scale = 1.0 / (level * root), level / root
        self._weights = 1.0 / (tol * f * level * root + floor), root / (tol * f * level)
        self._r_F = self.r

    def _force_unit(self, dynamics: Dynamics) -> float:
        """Typical force of the step in kinetic scaling [sqrt(kg) m/s^2]: the weight, or the largest h."""
        h = dynamics.residual - dynamics.M @ self.state.a
        self._root_M = np.sqrt(dynamics.M.diagonal())
        self._unit = max(self.system.weight, float((np.abs(h) / self._root_M).max()), 1e-300)
        return self._unit

    def _error(self, ev: Evaluation) -> float:
        """Largest residual in units of its tolerance."""
        if self._weights is None and self.sub.k == 0:
            self._weights = ()
            self._force_unit(ev.dynamics)
        unit = 1.0 / (self.method.tol * self._unit)
        w = unit / self._root_M
        dt = self.dt
        error = float((np.abs(ev.R_a) * w).max())
        if self.sub.k == 0:
            return error
        error = max(error, float((np.abs(ev.R_U) * w).max()) / dt, float((np.abs(ev.R_Q) * w).max()) / (dt * dt))
        kinematic, direct = self._weights
        R = np.abs(ev.contact.R) * np.where(ev.contact.kinematic, kinematic, direct)
        error = max(error, float(R.max()))
        return error if error == error else np.inf

    def linearise(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """Response of the step to the multipliers.

        With S = M + gamma_c D + beta_c K T the blocks of a, U and Q are eliminated:
        da = S^-1 (W dla - R_a - D dU - K T dQ), dU = M^-1 (W dLa - R_U), dQ = M^-1 (W dkappa - R_Q).
        Derivatives of M and W by q, which enter multiplied by dt^2, are left out.

        Returns:
            Z: (da, dU, dQ) per unit of each multiplier, in the last column what the residuals ask for, (3 nv, n + 1).
            H: (g_N, xi_N, g_N_ddot, xi_F, gamma_F_dot) of the columns of Z, (n, n + 1).
        """
        sub, k, m = self.sub, self.sub.k, self.sub.m
        nv, M = self.system.model.nv, ev.dynamics.M
        S, D, KT, T = self._stiffness(ev)
        if k == 0:
            Z = np.zeros((3 * nv, 1))
            Z[:nv, 0] = -dgesv(S, ev.R_a)[2]
            return Z, np.zeros((0, 1))
        n = 3 * k + 2 * m
        W = ev.rows.W
        right = np.empty((nv, k + m + 2))
        right[:, : k + m], right[:, -2], right[:, -1] = W.T, ev.R_U, ev.R_Q
        by_M = dposv(M, right)[1]
        right_S = np.empty((nv, 3 * (k + m) + 1))
        right_S[:, : k + m] = W.T
        right_S[:, k + m : 2 * (k + m)] = D @ by_M[:, : k + m]
        right_S[:, 2 * (k + m) : -1] = KT @ by_M[:, : k + m]
        right_S[:, -1] = D @ by_M[:, -2] + KT @ by_M[:, -1] - ev.R_a
        by_S = dgesv(S, right_S)[2]
        # columns: kappa_N, La_N, la_N, La_F, la_F, and the residuals
        N, F = slice(0, k), slice(k, k + m)
        la, La, kappa = by_S[:, : k + m], -by_S[:, k + m : 2 * (k + m)], -by_S[:, 2 * (k + m) : -1]
        i = np.cumsum([0, k, k, k, m, m])
        Z = np.zeros((3 * nv, n + 1))
        Z_a, Z_U, Z_Q = Z[:nv], Z[nv : 2 * nv], Z[2 * nv :]
        Z_a[:, i[0] : i[1]], Z_a[:, i[1] : i[2]], Z_a[:, i[2] : i[3]] = kappa[:, N], La[:, N], la[:, N]
        Z_U[:, i[1] : i[2]], Z_Q[:, i[0] : i[1]] = by_M[:, N], by_M[:, N]
        if m:
            ratio = ev.ratio[sub.of_F]
            if ev.share is not None:  # the time since impact moves with the normal multipliers
                onto = sub.to_contact * ev.share[:, None]
                for Z_i, B in ((Z_a, kappa[:, F] @ onto), (Z_Q, by_M[:, F] @ onto)):
                    Z_i[:, i[0] : i[1]] += B
                    Z_i[:, i[1] : i[2]] -= B * ev.ratio
                    Z_i[:, i[2] : i[3]] += B * (self.beta_c - self.gamma_c * ev.ratio)
            to_la = 0.0 if self.paper else ratio * self.gamma_c - self.beta_c
            Z_a[:, i[3] : i[4]] = La[:, F] + kappa[:, F] * ratio
            Z_a[:, i[4] : i[5]] = la[:, F] + kappa[:, F] * to_la
            Z_U[:, i[3] : i[4]] = by_M[:, F]
            Z_Q[:, i[3] : i[4]], Z_Q[:, i[4] : i[5]] = by_M[:, F] * ratio, by_M[:, F] * to_la
        Z_a[:, -1], Z_U[:, -1], Z_Q[:, -1] = by_S[:, -1], -by_M[:, k + m], -by_M[:, k + m + 1]

        X, Y = ev.rows.derivatives(self.system.motion(ev.v, ev.x[self.slices[0]]))
        dv = self.gamma_c * Z_a + Z_U
        dq = self.beta_c * Z_a + Z_Q
        if T is not None:
            dq = T @ dq
        rates = W @ dv + X @ dq
        accelerations = W @ Z_a + Y @ dv
        H = np.concatenate((W[:k] @ dq, rates[:k], accelerations[:k], rates[k:], accelerations[k:]))
        return Z, H

    def _stiffness(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]:
        """S = M + gamma_c D + beta_c K T, D, K T and T = d q1 / d dq; None stands for the identity."""
        T = None if self.system.flat else pin.dIntegrate(self.system.model, self.state.q, ev.dq)[1]
        M, K, D = ev.dynamics.M, ev.dynamics.K, ev.dynamics.D
        KT = K if T is None else K @ T
        return M + self.gamma_c * D + self.beta_c * KT, D, KT, T

    def correction(self, ev: Evaluation) -> tuple[np.ndarray, bool]:
        """Newton correction dx (143), and whether directions were dependent so that the minimum norm was taken."""
        Z, H = self.linearise(ev)
        k = self.sub.k
        if k == 0:
            return Z[:, 0], False
        n = len(H)
        contact = ev.contact
        J = contact.jacobian(H, self.gamma_c, self.beta_c)
        right = -contact.R - J[:, -1]
        row_scale = np.where(contact.kinematic, self.row_scale, 1.0 / self.column_scale)
        A = J[:, :n] * row_scale[:, None] * self.column_scale
        b = right * row_scale
        if not np.isfinite(A).all():
            return np.full(self.size, np.nan), False
        lu, _, y, info = dgesv(A, b)
        pivots = np.abs(lu.diagonal())
        dependent = info != 0 or not pivots.min() > SINGULAR * pivots.max()
        if dependent:
            z = ev.x[3 * self.system.model.nv :] / self.column_scale
            y = np.linalg.lstsq(A, b + A @ z, rcond=RCOND)[0] - z
        dz = y * self.column_scale
        return np.concatenate((Z[:, :n] @ dz + Z[:, n], dz)), dependent
