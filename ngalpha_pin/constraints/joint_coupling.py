"""Joints that are geared to each other: g = q1 - polynomial(q2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.constraints.provider import Bodies, RowWrenches
from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.scene.constraints import JointCoupling
from ngalpha_pin.scene.joint_sum import nearest

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


class CouplingTable(NamedTuple):
    """Some couplings as the kernel takes them, see kernel.h; arrays are flat.

    Attributes:
        first_part, part, factor: of all sums, followers before leaders.
        first_power, power: coefficients of the polynomials.
        turn: period of each gap.
        rows: derivatives of the sums by v.
    """

    first_part: np.ndarray
    part: np.ndarray
    first_power: np.ndarray
    factor: np.ndarray
    power: np.ndarray
    turn: np.ndarray
    rows: np.ndarray


class Couplings:
    """The joint couplings of a scene; see `provider.Provider`."""

    everywhere = True

    def __init__(self, model: pin.Model, couplings: list[JointCoupling]):
        self.followers, self.leaders = zip(*(c.sums(model) for c in couplings), strict=True)
        # of the followers and of the leaders, each of shape (n, nv)
        self.A, self.B = (np.array([x.row for x in sums]) for sums in (self.followers, self.leaders))
        self.moved = np.flatnonzero(np.any((self.A != 0.0) | (self.B != 0.0), axis=0))
        self.polynomials = [c.polynomial for c in couplings]
        self.periods = [c.period for c in couplings]
        self.names_g: tuple[str, ...] = tuple(c.name for c in couplings)
        self.names_gamma: tuple[str, ...] = ()
        self.group = np.arange(len(couplings))

    def table_of(self, which: np.ndarray) -> CouplingTable:
        """Some of the couplings, for the kernel."""
        parts: list[tuple[int, float]] = []
        ends, powers, last = [0], [self.polynomials[i].coef for i in which], [0]
        for sum_ in [sums[i] for sums in (self.followers, self.leaders) for i in which]:
            places, factors = sum_.parts
            turns = len(places) > len(factors)
            parts += [(-1 - places[0], factors[0])] if turns else list(zip(places, factors, strict=True))
            ends.append(len(parts))
        for coefficients in powers:
            last.append(last[-1] + len(coefficients))
        place, factor = (np.array([part[i] for part in parts], dtype=kind) for i, kind in ((0, int), (1, float)))
        rows = np.concatenate((self.A[which], self.B[which])).ravel()
        turn = np.array([self.periods[i] for i in which], dtype=float)
        return CouplingTable(np.array(ends), place, np.array(last), factor, np.concatenate(powers), turn, rows)

    def rows(self, bodies: Bodies) -> CouplingRows:
        """Rows at one motion."""
        return CouplingRows(self, bodies)


class CouplingRows:
    """Rows of `Couplings` at one motion; attributes as those of `provider.ProviderRows`."""

    def __init__(self, table: Couplings, bodies: Bodies):
        q, B = bodies.q, table.B
        p, dp, ddp = np.array([
            [polynomial.deriv(order)(x) if order else polynomial(x) for order in range(3)]
            for polynomial, x in zip(table.polynomials, (sum_.value(q) for sum_ in table.leaders), strict=True)
        ]).T  # fmt: skip
        gaps = np.array([sum_.value(q) for sum_ in table.followers]) - p
        self.g = np.array([nearest(gap, period) for gap, period in zip(gaps, table.periods, strict=True)])
        self.W = table.A - dp[:, None] * B
        v, a = B @ bodies.motion.v, B @ bodies.motion.a
        self._X = -(ddp * v)[:, None] * B
        self.rate = self.W @ bodies.motion.v
        self.acceleration = table.A @ bodies.motion.a - dp * a - ddp * v**2
        sizes = [sum_.size(q) for sum_ in (*table.followers, *table.leaders)]
        self.sizes = max(1.0, *sizes), float(np.abs(bodies.motion.v[table.moved]).max())

    @property
    def wrenches(self) -> RowWrenches:
        """They act in joints."""
        return RowWrenches.in_joints(len(self.rate))

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each of the shape of W."""
        return self._X, 2 * self._X


def couplings(scene: Scene, model: pin.Model) -> Couplings | None:
    """The joint couplings of a scene; None where it has none."""
    found = [c for c in scene.constraints if isinstance(c, JointCoupling)]
    return Couplings(model, found) if found else None
