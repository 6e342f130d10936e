"""Forces that are not unique: of all that give the same accelerations, those that are nearest to given ones.

Feet, corners and edges that touch flat have more forces than the motion needs. What cancels among them is arbitrary,
but it feeds back into the motion through the friction of those that slip. Nearest forces differ from the given ones by
a combination of the rows themselves, so that what cancels among the given ones stays as it is.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.common.tolerances import TINY

# eigenvalues of the scaled contact matrix below this part of the largest one are zero
DEPENDENT = 1e-9


def spanned_forces(G: np.ndarray) -> np.ndarray:
    """Basis of the forces that do not cancel each other, shape (n, rank).

    Args:
        G: W M^-1 W^T of the rows along which the forces act, shape (n, n).
    """
    root = np.sqrt(np.maximum(G.diagonal(), TINY))
    values, vectors = np.linalg.eigh(G / np.outer(root, root))
    return (vectors / root[:, None])[:, values > DEPENDENT * values[-1]]


def nearest_forces(G: np.ndarray, tied: np.ndarray, b: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Forces x with (G + tied) x = b that differ from others by ones that do not cancel each other, shape (n,).

    Args:
        G: W M^-1 W^T of the rows along which they act, shape (n, n).
        tied: what friction that is tied to normal forces adds to their accelerations, shape (n, n).
        b: accelerations that they have to make, shape (n,).
        start: the others, shape (n,).
    """
    basis, A = spanned_forces(G), G + tied
    return start + basis @ np.linalg.lstsq(basis.T @ A @ basis, basis.T @ (b - A @ start), rcond=None)[0]
