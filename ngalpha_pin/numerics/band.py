"""Square band matrices in the layout of LAPACK, so that the cost of a beam grows linearly with its elements."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg.blas import dgbmv
from scipy.linalg.lapack import dgbsv, dpbtrf, dpbtrs


class BandMatrix:
    """A square matrix with w diagonals on either side of the main one.

    Args:
        data: entry (i, j) of the matrix at [w + i - j, j], shape (2 w + 1, n).
    """

    def __init__(self, data: np.ndarray):
        self.data = data
        self.w = len(data) // 2

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """The product with a vector (n,) or with columns (n, m)."""
        return self._product(x, 0)

    def transposed(self, x: np.ndarray) -> np.ndarray:
        """The product of the transposed matrix with a vector (n,) or with columns (n, m)."""
        return self._product(x, 1)

    def _product(self, x: np.ndarray, trans: int) -> np.ndarray:
        n, w = self.data.shape[1], self.w
        if n < len(self.data):  # fewer rows than diagonals: dgbmv does not take it
            A = self.toarray()
            return (A.T if trans else A) @ x
        columns = [dgbmv(n, n, w, w, 1.0, self.data, column, trans=trans) for column in x.reshape(n, -1).T]
        return np.stack(columns, axis=1).reshape(x.shape)

    def diagonal(self) -> np.ndarray:
        """The main diagonal, shape (n,)."""
        return self.data[self.w]

    def toarray(self) -> np.ndarray:
        """All entries, shape (n, n)."""
        n, w = self.data.shape[1], self.w
        A = np.zeros((n, n))
        for k in range(max(-w, 1 - n), min(w, n - 1) + 1):  # diagonal i - j = k
            j = np.arange(max(0, -k), min(n, n - k))
            A[j + k, j] = self.data[w + k, j]
        return A

    def solve(self, b: np.ndarray) -> np.ndarray:
        """The solution of A x = b by LU with pivoting; NaN where A is singular. Shape of b: (n,) or (n, m)."""
        w, (rows, n) = self.w, self.data.shape
        ab = np.empty((rows + w, n), order="F")
        ab[w:] = self.data
        _, _, x, info = dgbsv(w, w, ab, b.reshape(n, -1), overwrite_ab=1)
        return x.reshape(b.shape) if info == 0 else np.full(b.shape, np.nan)

    @cached_property
    def _cholesky(self) -> np.ndarray:
        factor, info = dpbtrf(self.data[: self.w + 1], lower=0)
        if info != 0:
            raise np.linalg.LinAlgError("the band matrix is not positive definite")
        return factor

    def solve_positive(self, b: np.ndarray) -> np.ndarray:
        """The same for a symmetric positive definite matrix, whose factor is kept."""
        return dpbtrs(self._cholesky, b.reshape(len(b), -1), lower=0)[0].reshape(b.shape)


class BandAssembly:
    """Sums the contributions of elements into band matrices.

    Element e has the coordinates e * stride ... e * stride + d - 1.

    Args:
        elements: number of elements.
        d: coordinates of one element.
        stride: distance of the first coordinates of two neighbours.
    """

    def __init__(self, elements: int, d: int, stride: int):
        self.n, self.w = (elements - 1) * stride + d, d - 1
        dofs = np.arange(elements)[:, None] * stride + np.arange(d)
        i, j = dofs[:, :, None], dofs[:, None, :]
        self._matrix = (self.w + i - j + j * (2 * self.w + 1)).ravel()

    def matrix(self, parts: np.ndarray) -> np.ndarray:
        """Sum of element matrices (elements, d, d) as the data of a `BandMatrix`, shape (2 w + 1, n)."""
        flat = np.bincount(self._matrix, parts.ravel(), (2 * self.w + 1) * self.n)
        return flat.reshape(self.n, -1).T  # columns one after the other, as LAPACK wants them
