"""Strains of a plane curve r(xi), and their gradients by (r', r'').

With t = r' and c = r'': the length |t| per unit of xi, and the turning theta' = (t1 c2 - t2 c1) / |t|^2 of the tangent.
They are strains of a Euler-Bernoulli beam that may stretch and turn by any amount: S. R. Eugster, J. Harsch: A
variational formulation of classical nonlinear beam theories, doi:10.1007/978-3-030-50460-1_9 [16].
"""

from __future__ import annotations

import numpy as np


def strains(t: np.ndarray, c: np.ndarray) -> np.ndarray:
    """|t| and theta' of curves with the derivatives t and c, shape (..., 2) each -> (..., 2)."""
    tt = t[..., 0] ** 2 + t[..., 1] ** 2
    return np.stack((np.sqrt(tt), (t[..., 0] * c[..., 1] - t[..., 1] * c[..., 0]) / tt), axis=-1)


def strain_gradients(t: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Strains with their derivatives by x = (t, c).

    Args:
        t: first derivative of the curve, shape (..., 2).
        c: second derivative, shape (..., 2).

    Returns:
        Strains (..., 2) and gradients (..., 2, 4).
    """
    t1, t2, c1, c2 = t[..., 0], t[..., 1], c[..., 0], c[..., 1]
    i = 1.0 / (t1 * t1 + t2 * t2)
    length = np.sqrt(t1 * t1 + t2 * t2)
    turning = (t1 * c2 - t2 * c1) * i
    e1, e2 = t1 * i, t2 * i
    G = np.zeros((*t1.shape, 2, 4))
    n1, n2 = t1 / length, t2 / length
    G[..., 0, 0], G[..., 0, 1] = n1, n2
    G[..., 1, 0], G[..., 1, 1] = c2 * i - 2.0 * turning * e1, -c1 * i - 2.0 * turning * e2
    G[..., 1, 2], G[..., 1, 3] = -e2, e1
    return np.stack((length, turning), axis=-1), G


def direction_gradients(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles of vectors t (m, 2) against the first axis (m,) [rad], gradients (m, 2) and Hessians (m, 2, 2)."""
    i = 1.0 / (t[:, 0] ** 2 + t[:, 1] ** 2)
    e1, e2 = t[:, 0] * i, t[:, 1] * i
    cross, along = 2.0 * e1 * e2, e2 * e2 - e1 * e1
    hessian = np.stack((cross, along, along, -cross), axis=1).reshape(-1, 2, 2)
    return np.arctan2(t[:, 1], t[:, 0]), np.stack((-e2, e1), axis=1), hessian
