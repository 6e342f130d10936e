"""The discrete contact laws (128)-(142) as a piecewise smooth residual, with its derivative on fixed index sets.

Rows are ordered as the multipliers: position level kappa_N (k), velocity level La_N (k), acceleration level la_N (k), then
La_F (m) and la_F (m). "kinematic" rows ask for a gap, a velocity or an acceleration to vanish, the others fix a multiplier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .contact_table import Subset


@dataclass(slots=True)
class Multipliers:
    """Percussions and forces at the end of the step, as the laws use them.

    Attributes:
        kappa_hat_N: (102), P_N: (95), La_N, la_N: shape (k,).
        P_F: (113), La_F, la_F: shape (m,).
    """

    kappa_hat_N: np.ndarray
    P_N: np.ndarray
    La_N: np.ndarray
    la_N: np.ndarray
    P_F: np.ndarray
    La_F: np.ndarray
    la_F: np.ndarray


class ContactResidual:
    """R_c at one iterate, and the index sets it was evaluated on.

    Args:
        sub: contacts.
        z: multipliers.
        g_N, xi, acceleration: kinematics; xi and acceleration have the normal rows and then the friction rows.
        gamma_F: slip velocity at the end of the step, shape (m,).
        r, r_friction: prox parameters of each contact in normal direction and of friction, shape (k,) [kg].
        whole_percussion: slip law (112) to the letter; otherwise only impulses follow the slip at the end of the step.

    Attributes:
        R: residual, shape (3 k + 2 m,).
        kinematic: which rows are kinematic, shape (3 k + 2 m,).
        A, B, C: index sets (130), (133), (136), shape (k,).
        stick, stick_a: D^st (139) and E^st (141), shape (k,).
    """

    def __init__(
        self,
        sub: Subset,
        z: Multipliers,
        g_N: np.ndarray,
        xi: np.ndarray,
        acceleration: np.ndarray,
        gamma_F: np.ndarray,
        r: np.ndarray,
        r_friction: np.ndarray,
        whole_percussion: bool,
    ):
        k, m, o = sub.k, sub.m, sub.of_F
        self.sub, self.whole_percussion = sub, whole_percussion
        xi_N, g_N_ddot = xi[:k], acceleration[:k]
        self.A = A = r * g_N <= z.kappa_hat_N  # (130)
        self.B = B = A & (r * xi_N <= z.P_N)  # (133)
        self.C = C = B & (r * g_N_ddot <= z.la_N)  # (136)
        self.R = R = np.empty(3 * k + 2 * m)
        R[:k] = np.where(A, g_N, z.kappa_hat_N)  # (129)
        R[k : 2 * k] = np.where(B, xi_N, z.P_N)  # (132)
        R[2 * k : 3 * k] = np.where(C, g_N_ddot, z.la_N)  # (135)
        self.slips = False
        if m == 0:
            self.kinematic = np.concatenate((A, B, C))
            return
        r_F = r_friction[o]
        xi_F, gamma_dot = xi[k:], acceleration[k:]
        self.stick = stick = A & (self._norm(r_F * xi_F - z.P_F) <= sub.mu * z.P_N)  # (139)
        self.stick_a = stick_a = stick & (self._norm(r_F * gamma_dot - z.la_F) <= sub.mu * z.la_N)  # (141)
        self.kinematic = np.concatenate((A, B, C, stick[o], stick_a[o]))
        slip, slip_a = (A & ~stick)[o], (stick & ~stick_a)[o]
        self.slips = bool(slip.any() or slip_a.any())
        free = ~A[o]
        R_La, R_la = R[3 * k : 3 * k + m], R[3 * k + m :]
        R_La[:] = np.where(free, z.P_F, xi_F)  # (138) open, stick
        R_la[:] = np.where(free, z.la_F, gamma_dot)  # (142) open, stick
        if self.slips:
            self._slip(z, xi_F, gamma_dot, gamma_F, slip, slip_a, R_La, R_la)

    def _norm(self, x: np.ndarray) -> np.ndarray:
        """Norm over the friction rows of each contact, shape (k,)."""
        return np.sqrt(np.bincount(self.sub.of_F, x * x, self.sub.k))

    def _direction(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """y / |y| of each contact, shape (m,), and its derivative by y, shape (m, m)."""
        norm = np.maximum(self._norm(y), 1e-300)[self.sub.of_F]
        d = y / norm
        return d, (np.eye(self.sub.m) - np.outer(d, d)) * self.sub.same_contact / norm[:, None]

    def _slip(
        self,
        z: Multipliers,
        xi_F: np.ndarray,
        gamma_dot: np.ndarray,
        gamma_F: np.ndarray,
        slip: np.ndarray,
        slip_a: np.ndarray,
        R_La: np.ndarray,
        R_la: np.ndarray,
    ) -> None:
        """Slipping rows of (138) and (142)."""
        o, mu = self.sub.of_F, self.sub.mu_F
        self.slip, self.slip_a = slip, slip_a
        self.d_xi, self.Dd_xi = self._direction(xi_F)
        # part of the force percussion that follows the slip at the end of the step: all of it in (138); else none, but
        # where P_N is less than the quadrature of la_N (a contact that closes or opens), so that P_F keeps to its cone
        forces_N, forces_F = z.P_N - z.La_N, z.P_F - z.La_F
        self.follows = np.ones(len(o))
        if not self.whole_percussion:
            self.follows = (1.0 - np.clip(z.P_N / np.maximum(forces_N, 1e-300), 0.0, 1.0))[o] * (forces_N > 0)[o]
        self.size_La = mu * (z.La_N[o] + self.follows * forces_N[o])
        R_La[slip] = (z.La_F + self.follows * forces_F + self.size_La * self.d_xi)[slip]  # (138)
        # at the end of the step: along the slip velocity (120), or, just stopped, along the slip acceleration
        self.d_gamma, self.Dd_gamma = self._direction(gamma_F)
        self.d_dot, self.Dd_dot = self._direction(gamma_dot)
        self.size_la = mu * z.la_N[o]
        along = np.where(slip, self.d_gamma, self.d_dot)
        R_la[slip | slip_a] = (z.la_F + self.size_la * along)[slip | slip_a]  # (142)

    def jacobian(self, H: np.ndarray, gamma_c: float, beta_c: float) -> np.ndarray:
        """Derivative of R by the multipliers.

        Args:
            H: derivative of (g_N, xi_N, g_N_ddot, xi_F, gamma_F_dot) by the multipliers, shape (n, n); it may have
                further columns, which are treated alike (for them the direct part is zero).
            gamma_c: d P / d la, dt gamma (1 - alpha_f) / (1 - alpha_m) [s].
            beta_c: d kappa_hat / d la, dt^2 beta (1 - alpha_f) / (1 - alpha_m) [s^2].
        """
        if self.kinematic.all():
            return H
        sub, k, m = self.sub, self.sub.k, self.sub.m
        J = H * self.kinematic[:, None]
        i = np.flatnonzero(~self.kinematic)
        J[i, i] = 1.0
        i = np.flatnonzero(~self.A)
        J[i, 2 * k + i] = beta_c
        i = np.flatnonzero(~self.B)
        J[k + i, 2 * k + i] = gamma_c
        if m == 0:
            return J
        i = np.flatnonzero(~self.A[sub.of_F])
        J[3 * k + i, 3 * k + m + i] = gamma_c
        if self.slips:
            self._slip_jacobian(J, H, gamma_c)
        return J

    def _slip_jacobian(self, J: np.ndarray, H: np.ndarray, gamma_c: float) -> None:
        sub, k, m, o, mu = self.sub, self.sub.k, self.sub.m, self.sub.of_F, self.sub.mu_F
        La, la = slice(3 * k, 3 * k + m), slice(3 * k + m, 3 * k + 2 * m)
        i = np.flatnonzero(self.slip)
        J[3 * k + i] += (self.size_La[i, None] * self.Dd_xi[i]) @ H[La]
        J[3 * k + i, k + o[i]] += mu[i] * self.d_xi[i]
        J[3 * k + i, 2 * k + o[i]] += mu[i] * self.d_xi[i] * gamma_c * self.follows[i]
        J[3 * k + i, 3 * k + m + i] += gamma_c * self.follows[i]
        J[3 * k + m + i] += (self.size_la[i, None] * self.Dd_gamma[i]) @ H[La]
        J[3 * k + m + i, 2 * k + o[i]] += mu[i] * self.d_gamma[i]
        i = np.flatnonzero(self.slip_a)
        J[3 * k + m + i] += (self.size_la[i, None] * self.Dd_dot[i]) @ H[la]
        J[3 * k + m + i, 2 * k + o[i]] += mu[i] * self.d_dot[i]
