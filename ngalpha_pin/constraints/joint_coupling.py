"""Joints that are geared to each other: g = q1 - polynomial(q2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.constraints.provider import Bodies, RowWrenches
from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.scene.constraints import JointCoupling
from ngalpha_pin.scene.joint_sum import JointSum, nearest

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


class Coupled(NamedTuple):
    """One row as the kernel takes it: a sum of joint coordinates, less a polynomial of another one.

    Attributes:
        follower, leader: places in q of the parts of the sums, and their factors; -1 - place where the angle of a
            (cosine, sine) counts.
        power: coefficients of the polynomial.
        turn: period of the gap.
        A, B: derivatives of the sums by v, shape (nv,) each.
    """

    follower: list[tuple[int, float]]
    leader: list[tuple[int, float]]
    power: np.ndarray
    turn: float
    A: np.ndarray
    B: np.ndarray


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

    @classmethod
    def of(cls, rows: list[Coupled]) -> CouplingTable:
        """The table of some rows, one at least."""
        sums = [row.follower for row in rows] + [row.leader for row in rows]
        parts = [part for each in sums for part in each]
        place, factor = (np.array([part[i] for part in parts], dtype=kind) for i, kind in ((0, int), (1, float)))
        ends, last = (np.cumsum([0, *map(len, x)]) for x in (sums, [row.power for row in rows]))
        derivatives = np.concatenate([row.A for row in rows] + [row.B for row in rows])
        turn = np.array([row.turn for row in rows], dtype=float)
        return cls(ends, place, last, factor, np.concatenate([row.power for row in rows]), turn, derivatives)


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

    def coupled(self, which: np.ndarray) -> list[Coupled]:
        """Some of the couplings, for the kernel."""

        def parts(sum_: JointSum) -> list[tuple[int, float]]:
            places, factors = sum_.parts
            if len(places) > len(factors):  # the cosine and the sine of one angle
                return [(-1 - int(places[0]), float(factors[0]))]
            return [(int(place), float(factor)) for place, factor in zip(places, factors, strict=True)]

        return [
            Coupled(
                parts(self.followers[i]), parts(self.leaders[i]), self.polynomials[i].coef, self.periods[i],
                self.A[i], self.B[i],
            )
            for i in which
        ]  # fmt: skip

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
