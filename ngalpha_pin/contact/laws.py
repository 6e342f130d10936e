"""The discrete contact laws (128)-(142) as a piecewise smooth residual, with its derivative on fixed index sets.

All rows are ordered as y = (g_N, xi_N, xi_F, g_N_ddot, gamma_F_dot), the kinematics, against z = (kappa_hat_N, P_N,
P_F, la_N, la_F), the forces, with k normal and m friction entries: n = k + 2 (k + m). In every row, (26) and (27) ask
either the kinematics to vanish or the force; a slipping friction row ties the force to its direction.

Compiled twin: engine/kernel/laws.c.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import CONE
from ngalpha_pin.contact.compliant import SoftRows, soft_sets
from ngalpha_pin.contact.table import Subset

# what friction may be outside of its cone before it is put onto it: rounding; and what vanishes where both do, which
# no force reaches
OUTSIDE, BOTH_NONE = 1e-12, 1e-290

Entries = tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]


class _Entries:
    """Collects entries of a sparse matrix."""

    def __init__(self) -> None:
        self._found: list[tuple[np.ndarray, ...]] = []

    def add(
        self, values: np.ndarray | float, rows: np.ndarray, columns: np.ndarray, where: np.ndarray | None = None
    ) -> None:
        """Add entries, those of a mask or all."""
        found = np.broadcast_arrays(np.asarray(values, dtype=float), rows, columns)
        self._found.append(tuple(x if where is None else x[where] for x in found))

    def all(self) -> Entries:
        """Values, and rows and columns."""
        values, rows, columns = (np.concatenate(x) for x in zip(*self._found, strict=True))
        return values, (rows, columns)


class IndexSets(NamedTuple):
    """A (130), B (133), C (136), shape (k,) each, D^st (139) and E^st (141) of the cones, (c,) each, as masks."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    stick: np.ndarray
    stick_a: np.ndarray


def rebounds(sub: Subset, rates: np.ndarray, carried: np.ndarray, paper: bool) -> np.ndarray:
    """What restitution adds to the rates at the end of a step (44), (48), shape (k + m,) [m/s].

    A contact that opens at the start of the step and closes in it has bounced and is back within the step: it comes to
    rest. With (44) to the letter it would end on its way into the surface, and a flat body with velocities for which no
    accelerations keep all of its corners closed. One that has carried before has no impact: with (48) to the letter its
    slip would turn back in every step in which friction can stop it.

    Args:
        sub: contacts.
        rates: g_N_dot and gamma_F at the start of the step, shape (k + m,) [m/s].
        carried: contacts with a force at the start of the step, shape (k,).
        paper: (44) and (48) to the letter.
    """
    added = sub.restitution(rates) * rates
    if not paper:
        added[: sub.k] = np.minimum(added[: sub.k], 0.0)
        added[sub.k :][carried[sub.of_F]] = 0.0
    return added


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
        accelerates: contacts have forces; otherwise C is empty, and percussions do all of the work.
        slack: what each contact may be on the wrong side of (130) with and still carry percussions, or not, shape (k,)
            [kg m]. Slip then has the direction of the argument of the prox function, with which R does not jump where
            it vanishes; for R alone, not for its derivatives.
        started: friction coefficients of the slip at the start of the step, shape (c,); None where they are constant.

    Attributes:
        R: residual, shape (n,).
        kinematic: rows in which the kinematics vanish, shape (n,).
        A, B, C: index sets (130), (133), (136), shape (k,).
        stick, stick_a: D^st (139) and E^st (141), shape (c,); each cone of a contact sticks or slips for itself.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    R: np.ndarray
    kinematic: np.ndarray
    stick: np.ndarray
    stick_a: np.ndarray
    soft: SoftRows | None = None

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
        accelerates: bool = True,
        slack: np.ndarray | None = None,
        started: np.ndarray | None = None,
    ):
        m, o, of = sub.m, sub.cones.of_row, sub.cones.contact
        self.sub, self.y, self.z, self.La, self.gamma_F = sub, y, z, La, gamma_F
        self.slips, self._trial = False, r * y - z
        self._slack, self._started = slack, started
        A, B, C, stick, stick_a = self._find_sets(accelerates) if sets is None else sets
        self.A, self.B, self.C, self.stick, self.stick_a = A, B, C, stick, stick_a
        closed = A if slack is None else self._trial[: sub.k] <= 0.0
        if m == 0:
            self.kinematic = np.concatenate((closed, B, C))
            self.R = np.where(self.kinematic, y, z)  # (129), (132), (135)
            return
        self.kinematic = np.concatenate((closed, B, stick[o], C, stick_a[o]))
        self.R = np.where(self.kinematic, y, z)  # (129), (132), (135), (138), (142) but for slip
        if (A[of] & ~stick_a).any():
            self._slip(whole_percussion)

    def soften(self, multipliers: np.ndarray) -> None:
        """Give compliant contacts their own normal rows.

        Args:
            multipliers: of the step, shape (n,) or more.
        """
        k = self.sub.k
        self.soft = SoftRows(self, multipliers[:k], multipliers[k : 2 * k])

    def _find_sets(self, accelerates: bool) -> IndexSets:
        """The index sets of the prox functions."""
        sub, k, m, z, trial = self.sub, self.sub.k, self.sub.m, self.z, self._trial
        cones, c, of = sub.cones, sub.cones.c, sub.cones.contact
        A = trial[:k] <= (0.0 if self._slack is None else self._slack)  # (130)
        B = A & (trial[k : 2 * k] <= 0.0)  # (133)
        C = B & (trial[2 * k + m : 3 * k + m] <= 0.0) & accelerates  # (136)
        if len(sub.soft):
            soft_sets(sub, self.y[:k], z[k : 2 * k], A)
        if m == 0:
            return IndexSets(A, B, C, A, A)
        mu = np.tile(cones.mu, 2)
        if self._started is not None:  # what a slip that stops in the step can have at most, on the average
            mu = np.concatenate((0.5 * (cones.mu + self._started), cones.mu))
        sticks = cones.norms(trial[sub.friction_places]) <= (1 + CONE) * mu * z[sub.normal_places]
        stick = A[of] & sticks[:c]  # (139)
        return IndexSets(A, B, C, stick, stick & sticks[c:] & accelerates)  # (141)

    def _slip(self, whole_percussion: bool) -> None:
        """Slipping rows of (138) and (142)."""
        cones, k, m, o, z = self.sub.cones, self.sub.k, self.sub.m, self.sub.of_F, self.z
        self.slips, of, cone = True, cones.contact, cones.of_row
        self.slip, self.slip_a = (self.A[of] & ~self.stick)[cone], (self.stick & ~self.stick_a)[cone]
        P, la, La = z[k : 2 * k + m], z[2 * k + m :], self.La
        xi_F, acceleration_F = self.y[2 * k : 2 * k + m], self.y[3 * k + m :]
        self.unit_v = cones.unit(xi_F if self._slack is None else self._trial[2 * k : 2 * k + m])
        # a contact that just begins to slip has the coefficient of sticking
        mu, slope = cones.coefficients(self.gamma_F)
        self.mu = np.where(self.slip, mu[cone], cones.mu_F)
        self.slope, self.along = np.where(self.slip, slope[cone], 0.0), cones.unit(self.gamma_F)[0]
        # P_F of the slip law: the impulsive part against the slip at the end of the step, in (138) all of it
        self.whole = float(whole_percussion)
        pushed = (La[:k] + self.whole * (P - La)[:k])[o]
        self.size_v, self.growth_v = self.mu * pushed, self.slope * pushed
        c = (1.0 - self.whole) * (P - La)[k:] - self.size_v * self.unit_v[0]
        # but never outside of its cone, where a slip that turns or begins within the step would put it
        self.cap, self.unit_c = cones.mu_F * np.maximum(P[:k], 0.0)[o], cones.unit(c)
        self.capped = self.unit_c[1] > self.cap * (1 + OUTSIDE) + BOTH_NONE
        R_v = P[k:] - np.where(self.capped, self.cap * self.unit_c[0], c)
        # at the end of the step: along the slip velocity (120), or, just stopped, along the slip acceleration
        self.unit_a = cones.unit(np.where(self.slip, self.gamma_F, acceleration_F))
        self.growth_a = self.slope * la[:k][o]
        R_a = la[k:] + self.mu * la[:k][o] * self.unit_a[0]  # (142)
        v, a = slice(2 * k, 2 * k + m), slice(3 * k + m, None)
        self.R[v] = np.where(self.slip, R_v, self.R[v])
        self.R[a] = np.where(self.slip | self.slip_a, R_a, self.R[a])

    def jacobian(self, H: np.ndarray, Dz: np.ndarray) -> np.ndarray:
        """Derivative of R by the multipliers (kappa_N, La_N, La_F, la_N, la_F).

        Args:
            H: derivative of y, shape (n, n + 1); its last column, a change of y that is given, is treated alike.
            Dz: derivative of z, shape (n, n + 1).
        """
        if self.soft is not None:
            return self.soft.derive(self._jacobian(H, Dz), H)
        return self._jacobian(H, Dz)

    def _jacobian(self, H: np.ndarray, Dz: np.ndarray) -> np.ndarray:
        """The same with rigid contacts alone."""
        if not self.slips:
            return H if self.kinematic.all() else np.where(self.kinematic[:, None], H, Dz)
        k, m, o, mu, cone = self.sub.k, self.sub.m, self.sub.of_F, self.mu, self.sub.cones.mu_F
        J = np.where(self.kinematic[:, None], H, Dz)
        every, v, a = np.arange(m), slice(2 * k, 2 * k + m), slice(3 * k + m, None)
        if self.slip.any():
            d = mu * self.unit_v[0]
            dc = -self.size_v[:, None] * (self._turning(self.unit_v) @ H[v])
            if self.slope.any():
                dc -= (self.growth_v * self.unit_v[0])[:, None] * self._speeding(H[v])
            dc[every, k + o] -= d
            dc[every, 2 * k + m + o] -= self.whole * Dz[k, 2 * k + m] * d  # Dz there is d P / d la
            dc[every, 3 * k + m + every] += (1.0 - self.whole) * Dz[k, 2 * k + m]
            rows = Dz[v] - dc
            if self.capped.any():
                capped = (
                    Dz[v]
                    - self.cap[:, None] * (self._turning(self.unit_c) @ dc)
                    - (cone * self.unit_c[0])[:, None] * Dz[k + o]
                )
                rows = np.where(self.capped[:, None], capped, rows)
            J[v] = np.where(self.slip[:, None], rows, J[v])
        rows = (mu * self.z[2 * k + m + o])[:, None] * (
            self._turning(self.unit_a) @ np.where(self.slip[:, None], H[v], H[a])
        )
        if self.slope.any():
            rows += (self.growth_a * self.unit_a[0])[:, None] * self._speeding(H[v])
        rows[every, 3 * k + m + every] += 1.0
        rows[every, 2 * k + m + o] += mu * self.unit_a[0]
        J[a] = np.where((self.slip | self.slip_a)[:, None], rows, J[a])
        return J

    def derivatives(self, gamma_c: float, kappa_c: np.ndarray) -> tuple[Entries, Entries]:
        """The same as entries of two sparse matrices: the derivatives by y and, with y held, by the multipliers.

        Args:
            gamma_c: derivative of P by la [s].
            kappa_c: derivative of kappa_hat_N by la_N, shape (k,) [s^2].

        Returns:
            Of each (values, (rows, columns)), of shape (n, n); entries of one place add up.
        """
        sub, k, m, o, cone = self.sub, self.sub.k, self.sub.m, self.sub.of_F, self.sub.cones.mu_F
        by_y, by_forces = _Entries(), _Entries()
        at = np.flatnonzero(self.kinematic)
        by_y.add(1.0, at, at)
        slips = np.zeros(len(self.R), dtype=bool)
        if self.slips:
            slips[2 * k : 2 * k + m], slips[3 * k + m :] = self.slip, self.slip | self.slip_a
        self._add_forces(by_forces, np.flatnonzero(~self.kinematic & ~slips), gamma_c, kappa_c)
        if not slips.any():
            return by_y.all(), by_forces.all()
        mu = self.mu
        every, P_N, la_N = np.arange(m), k + o, 2 * k + m + o
        P_F, la_F = 2 * k + every, 3 * k + m + every
        f, g = sub.cones.pairs
        # rows of P_F: z - c, or where it is capped z - cap c / |c|; the derivative of c has these entries
        c_y = self.size_v[f] * self._turned(self.unit_v, f, g)
        c_y = c_y + (self.growth_v * self.unit_v[0])[f] * self.along[g]
        c_N, c_la_N = -mu * self.unit_v[0], -self.whole * gamma_c * mu * self.unit_v[0]
        c_la_F = np.full(m, (1.0 - self.whole) * gamma_c)
        free, capped = self.slip & ~self.capped, self.slip & self.capped
        self._add_forces(by_forces, P_F[self.slip], gamma_c, kappa_c)
        by_y.add(c_y, P_F[f], P_F[g], free[f])
        for value, column in ((c_N, P_N), (c_la_N, la_N), (c_la_F, la_F)):
            by_forces.add(-value, P_F, column, free)
        if capped.any():
            turn = -self.cap[f] * self._turned(self.unit_c, f, g)
            f_h, g_h, h = sub.cones.triples  # place of (f, g), of (g, h), and h
            by_y.add(-turn[f_h] * c_y[g_h], P_F[f[f_h]], P_F[h], capped[f[f_h]])
            for value, column in ((c_N, P_N), (c_la_N, la_N), (c_la_F, la_F)):
                by_forces.add(turn * value[g], P_F[f], column[g], capped[f])
            for value, column in ((1.0, P_N), (gamma_c, la_N)):
                by_forces.add(-value * cone * self.unit_c[0], P_F, column, capped)
        moves = self.slip | self.slip_a
        turn = (mu * self.z[la_N])[f] * self._turned(self.unit_a, f, g)
        turn = turn + (self.growth_a * self.unit_a[0])[f] * self.along[g]
        by_y.add(turn, la_F[f], np.where(self.slip[g], P_F[g], la_F[g]), moves[f])
        by_forces.add(1.0, la_F, la_F, moves)
        by_forces.add(mu * self.unit_a[0], la_F, la_N, moves)
        return by_y.all(), by_forces.all()

    def _add_forces(self, to: _Entries, rows: np.ndarray, gamma_c: float, kappa_c: np.ndarray) -> None:
        """Add the derivatives of z by the multipliers."""
        k, j = self.sub.k, self.sub.k + self.sub.m
        to.add(1.0, rows, rows)
        position, velocity = rows[rows < k], rows[(rows >= k) & (rows < k + j)]
        to.add(kappa_c[position], position, position + k + j)
        to.add(gamma_c, velocity, velocity + j)

    def _turned(self, unit: tuple[np.ndarray, np.ndarray], f: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Entries (f, g) of `_turning`."""
        d, norm = unit
        return ((f == g) - d[f] * d[g]) / norm[f]

    def _speeding(self, H: np.ndarray) -> np.ndarray:
        """Change of the speed of slip of each friction row's cone with changes H of the slip, of the shape of H."""
        return self.sub.cones.same @ (self.along[:, None] * H)

    def _turning(self, unit: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Derivative of d = y / |y| by y, shape (m, m)."""
        d, norm = unit
        turn = -d[:, None] * d * self.sub.cones.same
        turn[np.arange(len(d)), np.arange(len(d))] += 1.0
        return turn / norm[:, None]
