"""Joints that are geared to each other: g = q1 - polynomial(q2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ngalpha_pin.constraints.provider import Bodies
from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.scene.constraints import JointCoupling

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


class Couplings:
    """The joint couplings of a scene; see `provider.Provider`."""

    everywhere = True

    def __init__(self, model: pin.Model, couplings: list[JointCoupling]):
        joints = np.array([[model.getJointId(name) for name in (c.joint, c.leader)] for c in couplings])
        self.q, self.dofs = np.array(model.idx_qs)[joints], np.array(model.idx_vs)[joints]
        self.polynomials = [c.polynomial for c in couplings]
        self.names_g: tuple[str, ...] = tuple(c.name for c in couplings)
        self.names_gamma: tuple[str, ...] = ()
        self.group = np.arange(len(couplings))
        self.nv = model.nv

    def rows(self, bodies: Bodies) -> CouplingRows:
        """Rows at one motion."""
        return CouplingRows(self, bodies)


class CouplingRows:
    """Rows of `Couplings` at one motion; attributes as those of `provider.ProviderRows`."""

    def __init__(self, table: Couplings, bodies: Bodies):
        follower, leader = bodies.q[table.q].T
        p, dp, ddp = np.array([
            [polynomial.deriv(order)(x) if order else polynomial(x) for order in range(3)]
            for polynomial, x in zip(table.polynomials, leader, strict=True)
        ]).T  # fmt: skip
        v, a = bodies.motion.v[table.dofs].T, bodies.motion.a[table.dofs].T
        row = np.arange(len(p))
        self.g = follower - p
        self.W, self._X, self._Y = (np.zeros((len(p), table.nv)) for _ in range(3))
        self.W[row, table.dofs[:, 0]] = 1.0
        self.W[row, table.dofs[:, 1]] = -dp
        self._X[row, table.dofs[:, 1]] = -ddp * v[1]
        self._Y[row, table.dofs[:, 1]] = -2 * ddp * v[1]
        self.rate = v[0] - dp * v[1]
        self.acceleration = a[0] - dp * a[1] - ddp * v[1] ** 2
        self.sizes = max(1.0, float(np.abs(bodies.q[table.q]).max())), float(np.abs(v).max())

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each of the shape of W."""
        return self._X, self._Y


def couplings(scene: Scene, model: pin.Model) -> Couplings | None:
    """The joint couplings of a scene; None where it has none."""
    found = [c for c in scene.constraints if isinstance(c, JointCoupling)]
    return Couplings(model, found) if found else None
