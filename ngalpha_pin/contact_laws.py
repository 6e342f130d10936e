"""The discrete contact laws (128)-(142) as a piecewise smooth residual, with its derivative on fixed index sets.

All rows are ordered as y = (g_N, xi_N, xi_F, g_N_ddot, gamma_F_dot), the kinematics, against z = (kappa_hat_N, P_N,
P_F, la_N, la_F), the forces, with k normal and m friction entries: n = k + 2 (k + m). In every row, (26) and (27) ask
either the kinematics to vanish or the force; a slipping friction row ties the force to its direction.

Compiled twin: kernel_laws.c.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .contact_table import Subset

# a force on the edge of its cone, up to rounding, belongs to it
EDGE = 1 + 1e-9


class IndexSets(NamedTuple):
    """A (130), B (133), C (136), D^st (139) and E^st (141) as masks, each shape (k,)."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    stick: np.ndarray
    stick_a: np.ndarray


class ContactResidual:
    """R_c at one iterate, and the index sets it was evaluated on.

    Args:
        sub: contacts.
        y, z: kinematics and forces as above, shape (n,).
        La: impulsive part of P_N and P_F, shape (k + m,).
        gamma_F: slip velocity at the end of the step, shape (m,).
        r: prox parameter of each row, shape (n,) [kg].
        whole_percussion: slip law (112) to the letter; otherwise only impulses follow the slip at the end of the step.
        sets: index sets to evaluate on; by default those that the prox functions find.

    Attributes:
        R: residual, shape (n,).
        kinematic: rows in which the kinematics vanish, shape (n,).
        A, B, C: index sets (130), (133), (136), shape (k,).
        stick, stick_a: D^st (139) and E^st (141), shape (k,).
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    R: np.ndarray
    kinematic: np.ndarray
    stick: np.ndarray
    stick_a: np.ndarray

    def __init__(
        self,
        sub: Subset,
        y: np.ndarray,
        z: np.ndarray,
        La: np.ndarray,
        gamma_F: np.ndarray,
        r: np.ndarray,
        whole_percussion: bool,
        sets: IndexSets | None = None,
    ):
        m, o = sub.m, sub.of_F
        self.sub, self.y, self.z, self.La, self.gamma_F = sub, y, z, La, gamma_F
        self.slips = False
        A, B, C, stick, stick_a = self._find_sets(r) if sets is None else sets
        self.A, self.B, self.C, self.stick, self.stick_a = A, B, C, stick, stick_a
        if m == 0:
            self.kinematic = np.concatenate((A, B, C))
            self.R = np.where(self.kinematic, y, z)  # (129), (132), (135)
            return
        self.kinematic = np.concatenate((A, B, stick[o], C, stick_a[o]))
        self.R = np.where(self.kinematic, y, z)  # (129), (132), (135), (138), (142) but for slip
        if (A & ~stick_a).any():
            self._slip(whole_percussion)

    def _find_sets(self, r: np.ndarray) -> IndexSets:
        """The index sets of the prox functions."""
        sub, k, m, z = self.sub, self.sub.k, self.sub.m, self.z
        trial = r * self.y - z
        A = trial[:k] <= 0.0  # (130)
        B = A & (trial[k : 2 * k] <= 0.0)  # (133)
        C = B & (trial[2 * k + m : 3 * k + m] <= 0.0)  # (136)
        if m == 0:
            return IndexSets(A, B, C, A, A)
        sticks = sub.norms(trial[sub.friction_places]) <= EDGE * sub.mu_twice * z[sub.normal_places]
        stick = A & sticks[:k]  # (139)
        return IndexSets(A, B, C, stick, stick & sticks[k:])  # (141)

    def _slip(self, whole_percussion: bool) -> None:
        """Slipping rows of (138) and (142)."""
        sub, k, m, o, z = self.sub, self.sub.k, self.sub.m, self.sub.of_F, self.z
        self.slips = True
        self.slip, self.slip_a = (self.A & ~self.stick)[o], (self.stick & ~self.stick_a)[o]
        P, la, La = z[k : 2 * k + m], z[2 * k + m :], self.La
        xi_F, acceleration_F = self.y[2 * k : 2 * k + m], self.y[3 * k + m :]
        self.unit_v = sub.unit(xi_F)
        # P_F of the slip law: the impulsive part against the slip at the end of the step, in (138) all of it
        self.whole = float(whole_percussion)
        self.size_v = sub.mu_F * (La[:k] + self.whole * (P - La)[:k])[o]
        c = (1.0 - self.whole) * (P - La)[k:] - self.size_v * self.unit_v[0]
        # but never outside of its cone, where a slip that turns or begins within the step would put it
        self.cap, self.unit_c = sub.mu_F * np.maximum(P[:k], 0.0)[o], sub.unit(c)
        self.capped = self.unit_c[1] > self.cap * (1 + 1e-12) + 1e-290  # not where both vanish
        R_v = P[k:] - np.where(self.capped, self.cap * self.unit_c[0], c)
        # at the end of the step: along the slip velocity (120), or, just stopped, along the slip acceleration
        self.unit_a = sub.unit(np.where(self.slip, self.gamma_F, acceleration_F))
        R_a = la[k:] + sub.mu_F * la[:k][o] * self.unit_a[0]  # (142)
        v, a = slice(2 * k, 2 * k + m), slice(3 * k + m, None)
        self.R[v] = np.where(self.slip, R_v, self.R[v])
        self.R[a] = np.where(self.slip | self.slip_a, R_a, self.R[a])

    def jacobian(self, H: np.ndarray, Dz: np.ndarray) -> np.ndarray:
        """Derivative of R by the multipliers (kappa_N, La_N, La_F, la_N, la_F).

        Args:
            H: derivative of y, shape (n, n + 1); its last column, a change of y that is given, is treated alike.
            Dz: derivative of z, shape (n, n + 1).
        """
        if not self.slips:
            return H if self.kinematic.all() else np.where(self.kinematic[:, None], H, Dz)
        k, m, o, mu = self.sub.k, self.sub.m, self.sub.of_F, self.sub.mu_F
        J = np.where(self.kinematic[:, None], H, Dz)
        every, v, a = np.arange(m), slice(2 * k, 2 * k + m), slice(3 * k + m, None)
        if self.slip.any():
            d = mu * self.unit_v[0]
            dc = -self.size_v[:, None] * (self._turning(self.unit_v) @ H[v])
            dc[every, k + o] -= d
            dc[every, 2 * k + m + o] -= self.whole * Dz[k, 2 * k + m] * d  # Dz there is d P / d la
            dc[every, 3 * k + m + every] += (1.0 - self.whole) * Dz[k, 2 * k + m]
            rows = Dz[v] - dc
            if self.capped.any():
                capped = (
                    Dz[v]
                    - self.cap[:, None] * (self._turning(self.unit_c) @ dc)
                    - (mu * self.unit_c[0])[:, None] * Dz[k + o]
                )
                rows = np.where(self.capped[:, None], capped, rows)
            J[v] = np.where(self.slip[:, None], rows, J[v])
        rows = (mu * self.z[2 * k + m + o])[:, None] * (
            self._turning(self.unit_a) @ np.where(self.slip[:, None], H[v], H[a])
        )
        rows[every, 3 * k + m + every] += 1.0
        rows[every, 2 * k + m + o] += mu * self.unit_a[0]
        J[a] = np.where((self.slip | self.slip_a)[:, None], rows, J[a])
        return J

    def _turning(self, unit: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Derivative of d = y / |y| by y, shape (m, m)."""
        d, norm = unit
        turn = -d[:, None] * d * self.sub.same_contact
        turn[np.arange(len(d)), np.arange(len(d))] += 1.0
        return turn / norm[:, None]
