"""B-splines: partition of unity, derivatives, integrals and curves that they contain."""

import numpy as np
import pytest

from ngalpha_pin.flexible.spline import SplineBasis


@pytest.mark.parametrize("degree, elements", [(2, 1), (3, 4), (4, 7)])
def test_shape_functions(degree, elements):
    basis, xi = SplineBasis(degree, elements), np.linspace(0.0, 1.0, 23)
    values = basis.values(xi, 2)
    np.testing.assert_allclose(values.sum(axis=2), [np.ones(23), np.zeros(23), np.zeros(23)], atol=1e-9)
    inner, h = xi[(xi * elements) % 1 > 1e-3], 1e-6  # beside the knots
    ahead, behind = basis.values(inner + h, 1), basis.values(inner - h, 1)
    here = basis.values(inner, 2)
    np.testing.assert_allclose((ahead - behind)[:2] / (2 * h), here[1:], rtol=1e-6, atol=1e-5)


def test_curves_of_its_degree_are_contained():
    basis = SplineBasis(3, 5)
    control = basis.interpolate(lambda xi: np.column_stack((1.0 - 2.0 * xi + xi**3, xi**2)))
    xi = np.linspace(0.0, 1.0, 31)
    N, places = basis.values(xi, 1), basis.element(xi)[:, None] + np.arange(4)
    r, rate = (np.einsum("mi,mij->mj", shape, control[places]) for shape in N)
    np.testing.assert_allclose(r, np.column_stack((1.0 - 2.0 * xi + xi**3, xi**2)), atol=1e-13)
    np.testing.assert_allclose(rate, np.column_stack((-2.0 + 3 * xi**2, 2 * xi)), atol=1e-12)


def test_gauss_points_integrate_polynomials():
    xi, w = SplineBasis(2, 3).gauss(4)
    assert (w * xi**7).sum() == pytest.approx(1 / 8, rel=1e-14)  # 2 n - 1
