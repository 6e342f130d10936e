"""Friction ellipses: tangents that turn with a body, and rows that are scaled by their coefficients.

With the tangents t_1 along the axis u of an ellipse, laid into the plane of contact, and t_2 = n x t_1, and with scales
s_i = mu_i / mu, the rows of slip are gamma_i = s_i t_i.w, and the forces s_i la_i t_i. The ellipse of the forces is
then the circle |la_F| <= mu la_N, and la_F against gamma_F, as Coulomb's law has it for a circle, is the force that
dissipates most of all in the ellipse: its normal is along the slip. So the laws of friction stay as they are, on all
levels.

The tangents turn about the normal, apart from what a turning normal makes of them: dt_1 = t_2 dtheta, with

    dtheta = t_2.(du - (n.u) dn) / |u - (n.u) n|        du = phi x u where the body of the point carries the axis

for a displacement of B relative to A, as seen from A; theta' = K.V with a wrench K. Rows of rolling turn likewise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.contact.cones import DRILLING, ROLLING
from ngalpha_pin.numerics.spatial import cross, dot
from ngalpha_pin.scene.friction_ellipse import PlacedEllipse


class FrictionAxes:
    """The ellipses of some contacts.

    Args:
        ellipses: of every contact, None where friction is the same in all directions.

    Attributes:
        has: which contacts have one, shape (k,).
        any: there is one.
    """

    def __init__(self, ellipses: Sequence[PlacedEllipse | None]):
        self._ellipses, k = list(ellipses), len(ellipses)
        self.has, self._on_b = np.zeros(k, dtype=bool), np.zeros(k, dtype=bool)
        self._axis, self.scale = np.zeros((k, 3)), np.ones((k, 2))
        for i, ellipse in enumerate(ellipses):
            if ellipse is not None:
                self.has[i], self._on_b[i] = True, ellipse.on_b
                self._axis[i], self.scale[i] = ellipse.axis, ellipse.scale
        self.any = bool(self.has.any())

    def of(self, index: np.ndarray) -> FrictionAxes | None:
        """Those of some contacts; None where none of them has one."""
        if not self.any or not self.has[index].any():
            return None
        return FrictionAxes([self._ellipses[i] for i in index.tolist()])

    def tangents(self, t: np.ndarray, n: np.ndarray, R_a: np.ndarray, R_b: np.ndarray) -> tuple[np.ndarray, Turning]:
        """Tangents (k, 2, 3) in the world, those along ellipses in the place of others, and how these turn."""
        u = np.einsum("kij,kj->ki", np.where(self._on_b[:, None, None], R_b, R_a), self._axis)
        flat = u - dot(n, u)[:, None] * n
        size = np.maximum(np.sqrt(dot(flat, flat)), TINY)
        t1 = flat / size[:, None]
        t2 = cross(n, t1)
        t = np.where(self.has[:, None, None], np.stack((t1, t2), axis=1), t)
        by_phi = np.where(self._on_b[:, None], cross(u, t2), 0.0) / size[:, None]
        return t, Turning(self.has[:, None] * by_phi, -(self.has * dot(n, u) / size)[:, None] * t2)


class Turning:
    """How tangents turn about their normals.

    Args:
        by_phi: dtheta by a rotation of B relative to A, shape (k, 3) [-].
        by_n: dtheta by a turning of the normal, shape (k, 3) [-].
    """

    def __init__(self, by_phi: np.ndarray, by_n: np.ndarray):
        self.by_phi, self.by_n = by_phi, by_n


class TurningRows:
    """The pairs of friction rows that turn into each other: those of slip, and those of rolling.

    Args:
        of_F: contact of each friction row, shape (m,).
        kind_F: what each of them is, shape (m,).
        axes: of the contacts.
    """

    def __init__(self, of_F: np.ndarray, kind_F: np.ndarray, axes: FrictionAxes):
        own, ahead = axes.has[of_F], np.append(kind_F[1:], -1)
        self.first = np.flatnonzero(own & np.isin(kind_F, (0, ROLLING)) & (ahead == kind_F + 1))
        self.of, self.second = of_F[self.first], self.first + 1
        rolls = kind_F[self.first] >= ROLLING
        self.ratio = np.where(rolls, 1.0, axes.scale[self.of, 0] / axes.scale[self.of, 1])
        self.scale = np.where(kind_F < DRILLING, axes.scale[of_F, np.minimum(kind_F, 1)], 1.0)

    def turned(self, x: np.ndarray) -> np.ndarray:
        """Change of rows per unit of theta, of values (m,) or vectors (m, j)."""
        found, ratio = np.zeros_like(x), self.ratio if x.ndim == 1 else self.ratio[:, None]
        found[self.first] = ratio * x[self.second]
        found[self.second] = -x[self.first] / ratio
        return found
