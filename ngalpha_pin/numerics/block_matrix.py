"""Matrices of a system with flexible bodies: one dense block for the tree and one band for each beam."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg.lapack import dgesv, dposv

from ngalpha_pin.numerics.band import BandMatrix


class BlockMatrix:
    """A block-diagonal square matrix.

    Args:
        tree: the first block, shape (n, n).
        bands: the blocks behind it; where there are none, the identity of any size stands behind the tree.
    """

    __array_ufunc__ = None  # so that a number times a BlockMatrix comes here

    def __init__(self, tree: np.ndarray, bands: tuple[BandMatrix, ...]):
        self.tree, self.bands = tree, bands
        self._tree, self._slices = slice(0, len(tree)), []
        start = len(tree)
        for band in bands:
            self._slices.append(slice(start, start + band.data.shape[1]))
            start = self._slices[-1].stop

    def __add__(self, other: BlockMatrix) -> BlockMatrix:
        """The sum."""
        bands = zip(self.bands, other.bands, strict=True)
        return BlockMatrix(self.tree + other.tree, tuple(BandMatrix(a.data + b.data) for a, b in bands))

    def __rmul__(self, factor: float) -> BlockMatrix:
        """A number times the matrix."""
        return BlockMatrix(factor * self.tree, tuple(BandMatrix(factor * band.data) for band in self.bands))

    def __matmul__(self, x: np.ndarray | BlockMatrix) -> Any:
        """The product with a vector (nv,), columns (nv, m), or a matrix without bands."""
        if isinstance(x, BlockMatrix):
            return BlockMatrix(self.tree @ x.tree, self.bands)
        y = x.copy()
        y[self._tree] = self.tree @ x[self._tree]
        for band, part in zip(self.bands, self._slices, strict=True):
            y[part] = band @ x[part]
        return y

    def __rmatmul__(self, x: np.ndarray) -> np.ndarray:
        """The product of a vector (nv,) or of rows (m, nv) with the matrix."""
        y = x.copy()
        y[..., self._tree] = x[..., self._tree] @ self.tree
        for band, part in zip(self.bands, self._slices, strict=True):
            y[..., part] = band.transposed(x[..., part].T).T
        return y

    def copy(self) -> BlockMatrix:
        """One that Pinocchio does not write into."""
        return BlockMatrix(self.tree.copy(), self.bands)

    def diagonal(self) -> np.ndarray:
        """The main diagonal, shape (nv,)."""
        return np.concatenate((self.tree.diagonal(), *(band.diagonal() for band in self.bands)))

    def solve(self, b: np.ndarray, positive: bool) -> np.ndarray:
        """The solution of A x = b block by block."""
        x = np.empty_like(b)
        if len(self.tree):
            solver = dposv if positive else dgesv
            x[self._tree] = solver(self.tree, b[self._tree])[1 if positive else 2]
        for band, part in zip(self.bands, self._slices, strict=True):
            x[part] = band.solve_positive(b[part]) if positive else band.solve(b[part])
        return x

    def toarray(self) -> np.ndarray:
        """All entries, shape (nv, nv)."""
        return self @ np.eye(self._slices[-1].stop)


Matrix = Any
"""An array of shape (n, n) or a `BlockMatrix`."""


def dense(A: Matrix) -> np.ndarray:
    """All entries of a matrix, shape (n, n)."""
    return A.toarray() if isinstance(A, BlockMatrix) else A


def solve(A: Matrix, b: np.ndarray) -> np.ndarray:
    """The solution of A x = b, shape of b: (n,) or (n, m)."""
    return A.solve(b, positive=False) if isinstance(A, BlockMatrix) else dgesv(A, b)[2]


def solve_positive(M: Matrix, b: np.ndarray) -> np.ndarray:
    """The same for a symmetric positive definite matrix; of an array, the upper triangle is read."""
    if not len(b):  # nothing moves, which LAPACK does not take
        return b.copy()
    return M.solve(b, positive=True) if isinstance(M, BlockMatrix) else dposv(M, b)[1]


def stacked(parts: list[np.ndarray]) -> np.ndarray:
    """Rows of all parts in one array; nothing is copied where there is but one."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
