"""Which friction rows share a cone: of every contact those of slip and drilling, and apart from them those of rolling.

The first k cones are those of slip of the k contacts, also of one without friction; those of rolling follow them. A row
of rolling about a tangent t is gamma = l t.omega with the lever l of the contact, the radius of a ball, and the moment
l la_F is bounded by the arm of rolling resistance times the normal force: |la_F| <= (arm / l) la_N.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.scene.friction_curve import Curve

# kinds of friction rows: slip along the first and the second tangent, drilling, and rolling about each tangent
DRILLING, ROLLING, KINDS = 2, 3, 5


class Cones:
    """The cones of some contacts.

    Args:
        of_F: contact of each friction row, shape (m,).
        kind_F: what each row is, shape (m,).
        mu, rolling: coefficients of each contact, shape (k,) each.
        curves: of the coefficients over the speed of slip, None where there is none.
        index: numbers of the contacts among `total`, shape (k,).

    Attributes:
        c: number of cones.
        k: number of contacts.
        of_row: cone of each friction row, shape (m,).
        contact: contact of each cone, shape (c,).
        numbers: of the cones among those of the table: that of the contact, or `total` more, increasing, shape (c,).
        mu: coefficients of sticking, shape (c,); mu_F: the same for each row, shape (m,).
        rolls: there are cones of rolling; plain: there are none, and all coefficients are constant.
        curves: places of the cones whose coefficient depends on the speed of slip, each with its curve.
    """

    def __init__(
        self, of_F: np.ndarray, kind_F: np.ndarray, mu: np.ndarray, rolling: np.ndarray, curves: Sequence[Curve | None],
        index: np.ndarray, total: int,
    ):  # fmt: skip
        self.m, self.k = len(of_F), len(index)
        k = self.k
        rolls = kind_F >= ROLLING
        contacts = np.unique(of_F[rolls])
        self.rolls = len(contacts) > 0
        self.c = k + len(contacts)
        self.of_row = np.where(rolls, k + np.searchsorted(contacts, of_F), of_F) if self.rolls else of_F
        self.contact = np.concatenate((np.arange(k), contacts))
        self.numbers = np.concatenate((index, total + index[contacts]))
        self.mu = np.concatenate((mu, rolling[contacts]))
        self.mu_F = self.mu[self.of_row]
        self.curves = [(place, curve) for place, curve in enumerate(curves) if curve is not None]
        self.plain = not self.rolls and not self.curves
        self._twice = np.concatenate((self.of_row, self.of_row + self.c))

    def sizes(self, x: np.ndarray) -> np.ndarray:
        """Norms over the friction rows of each cone, shape (m,) -> (c,)."""
        return np.sqrt(np.bincount(self.of_row, x * x, self.c))

    def products(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Inner products over the friction rows of each cone, shape (c,)."""
        return np.bincount(self.of_row, x * y, self.c)

    def norms(self, x: np.ndarray) -> np.ndarray:
        """Norms over the friction rows of each cone of two vectors in one, shape (2 m,) -> (2 c,)."""
        return np.sqrt(np.bincount(self._twice, x * x, 2 * self.c))

    def unit(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """X over its norm in each cone, and the norms, both of shape (m,)."""
        norm = np.maximum(self.sizes(x), TINY)[self.of_row]
        return x / norm, norm

    def coefficients(self, gamma_F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Friction coefficients at a slip, shape (m,), and their slopes by its speed [s/m], shape (c,) each."""
        mu, slope = self.mu.copy(), np.zeros(self.c)
        if self.curves:
            speed = self.sizes(gamma_F)
            for i, curve in self.curves:
                (mu[i],), (slope[i],) = curve(speed[i : i + 1])
        return mu, slope

    @cached_property
    def rows(self) -> np.ndarray:
        """Number of friction rows of each cone, shape (c,)."""
        return np.bincount(self.of_row, minlength=self.c)

    @cached_property
    def first(self) -> np.ndarray:
        """The first row of the cone of each friction row, shape (m,); those of a cone follow each other."""
        return self._bounds[0]

    @cached_property
    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The first row of the cone of each friction row, and the one behind its last, shape (m,) each."""
        ends = np.flatnonzero(np.diff(self.of_row, append=-1)) + 1
        starts = np.concatenate(([0], ends[:-1])).astype(int)
        place = np.searchsorted(ends, np.arange(self.m), side="right")
        return (starts[place], ends[place]) if self.m else (ends, ends)

    @cached_property
    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """All pairs of friction rows of one cone, also of a row with itself, shape (pairs,) each."""
        first, end = self._bounds
        found = [(f, g) for f in range(self.m) for g in range(first[f], end[f])]
        pairs = np.array(found, dtype=int).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    @cached_property
    def triples(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of three friction rows f, g, h of one cone: places of (f, g) and (g, h) among the pairs, and h."""
        f, g = self.pairs
        first, last = np.searchsorted(f, g), np.searchsorted(f, g, side="right")
        place = np.repeat(np.arange(len(f)), last - first)
        follows = np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)] or [first])
        return place, follows, g[follows]

    @cached_property
    def same(self) -> np.ndarray:
        """1 where two friction rows belong to the same cone, shape (m, m)."""
        return (self.of_row[:, None] == self.of_row).astype(float)
