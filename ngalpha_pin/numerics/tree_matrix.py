"""Matrices of a scene of many mechanisms that stand side by side: one block for each tree that hangs on the world."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin


class Trees:
    """The velocity coordinates of every tree, trees of one size together.

    Args:
        model: the mechanisms.

    Attributes:
        groups: for every size, the coordinates of the trees of that size, shape (trees, size).
        count: number of trees.
        nv: number of velocity coordinates.
        group, place: of every tree, the group and its place there, shape (trees,).
        of_joint: tree of every joint; -1 for the world.
    """

    def __init__(self, model: pin.Model):
        tree_of: list[int] = [-1]
        found: list[list[int]] = []
        for joint in range(1, model.njoints):
            parent = int(model.parents[joint])
            if parent == 0:
                tree_of.append(len(found))
                found.append([])
            else:
                tree_of.append(tree_of[parent])
            first = int(model.idx_vs[joint])
            found[tree_of[joint]] += range(first, first + int(model.nvs[joint]))
        trees = [tree for tree in found if tree]
        self.count, self.nv = len(trees), int(model.nv)
        sizes = sorted({len(tree) for tree in trees})
        self.groups = [np.array([tree for tree in trees if len(tree) == size]) for size in sizes]
        self.of_joint = np.array(tree_of)
        self.group = np.array([sizes.index(len(tree)) for tree in found if tree], dtype=int)
        self.place = np.array([int((self.group[:i] == g).sum()) for i, g in enumerate(self.group)], dtype=int)


class TreeMatrix:
    """A square matrix with one block for each tree.

    Args:
        trees: where the blocks are.
        blocks: of every group, shape (trees, size, size).
    """

    __array_ufunc__ = None  # so that a number times a TreeMatrix comes here

    def __init__(self, trees: Trees, blocks: list[np.ndarray]):
        self.trees, self.blocks = trees, blocks

    @classmethod
    def of(cls, trees: Trees, A: np.ndarray) -> TreeMatrix:
        """The blocks of a matrix, shape (nv, nv)."""
        return cls(trees, [A[i[:, :, None], i[:, None, :]] for i in trees.groups])

    def _each(self, function: Callable[..., np.ndarray], *others: TreeMatrix) -> TreeMatrix:
        return TreeMatrix(
            self.trees, [function(*x) for x in zip(self.blocks, *(o.blocks for o in others), strict=True)]
        )

    def __add__(self, other: TreeMatrix) -> TreeMatrix:
        """The sum."""
        return self._each(np.add, other)

    def __rmul__(self, factor: float) -> TreeMatrix:
        """A number times the matrix."""
        return self._each(lambda block: factor * block)

    def __abs__(self) -> TreeMatrix:
        """Absolute values of the entries."""
        return self._each(np.abs)

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """The product with a vector (nv,) or columns (nv, m)."""
        return self._apply(np.matmul, x)

    def __rmatmul__(self, x: np.ndarray) -> np.ndarray:
        """The product of a vector (nv,) or of rows (m, nv) with the matrix."""
        return self.transposed()._apply(np.matmul, x.T).T

    def transposed(self) -> TreeMatrix:
        """The transpose."""
        return self._each(lambda block: block.transpose(0, 2, 1))

    def times(self, other: TreeMatrix) -> TreeMatrix:
        """The product with another one."""
        return self._each(np.matmul, other)

    def _apply(self, function: Callable[..., np.ndarray], x: np.ndarray) -> np.ndarray:
        y = np.empty_like(x)
        for i, block in zip(self.trees.groups, self.blocks, strict=True):
            part = x[i]
            y[i] = function(block, part[:, :, None])[:, :, 0] if x.ndim == 1 else function(block, part)
        return y

    def diagonal(self) -> np.ndarray:
        """The main diagonal, shape (nv,)."""
        diagonal = np.empty(self.trees.nv)
        for i, block in zip(self.trees.groups, self.blocks, strict=True):
            diagonal[i] = np.diagonal(block, axis1=1, axis2=2)
        return diagonal

    def solve(self, b: np.ndarray) -> np.ndarray:
        """The solution of A x = b, shape of b: (nv,) or (nv, m)."""
        return self._apply(np.linalg.solve, b)

    def inverse(self) -> TreeMatrix:
        """The inverse."""
        return self._each(np.linalg.inv)
