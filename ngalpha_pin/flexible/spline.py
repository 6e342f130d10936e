"""B-spline shape functions on [0, 1] with open uniform knots."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

MOST = 10_000  # elements of a beam or rod; matrices of more take gigabytes


class SplineBasis:
    """Shape functions of one degree on elements of equal length.

    Args:
        degree: polynomial degree p.
        elements: number of elements.

    Attributes:
        n: number of shape functions, elements + degree.
        knots: shape (n + p + 1,).
    """

    def __init__(self, degree: int, elements: int):
        self.degree, self.elements, self.n = degree, elements, elements + degree
        inner = np.linspace(0.0, 1.0, elements + 1)
        self.knots = np.concatenate((np.zeros(degree), inner, np.ones(degree)))
        self._basis = BSpline(self.knots, np.eye(self.n), degree)

    def element(self, xi: np.ndarray) -> np.ndarray:
        """The element in which each xi lies: number of its first shape function."""
        return np.clip((np.asarray(xi) * self.elements).astype(int), 0, self.elements - 1)

    def values(self, xi: np.ndarray, order: int) -> np.ndarray:
        """Derivatives of the p + 1 shape functions that are not zero.

        Args:
            xi: places in [0, 1], shape (m,).
            order: highest derivative.

        Returns:
            Shape (order + 1, m, p + 1), to be used with the control points `element(xi) + (0 ... p)`.
        """
        xi = np.asarray(xi, dtype=float)
        places = self.element(xi)[:, None] + np.arange(self.degree + 1)
        return np.array([np.take_along_axis(self._basis(xi, nu=k), places, axis=1) for k in range(order + 1)])

    def gauss(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Places and weights of n Gauss points in each element, shapes (elements, n) each."""
        x, w = np.polynomial.legendre.leggauss(n)
        xi = (np.arange(self.elements)[:, None] + 0.5 * (x + 1.0)) / self.elements
        return xi, np.broadcast_to(0.5 * w / self.elements, xi.shape)

    def interpolate(self, curve: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Control points of the spline through curve(xi), (m,) -> (m, 2), at the Greville places, shape (n, 2)."""
        p = self.degree
        greville = np.array([self.knots[i + 1 : i + p + 1].mean() for i in range(self.n)])
        return make_interp_spline(greville, curve(greville), k=p, t=self.knots).c
