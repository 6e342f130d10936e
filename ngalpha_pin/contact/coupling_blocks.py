"""Which contacts feel each other, and a square matrix with one block for each such pair.

Two contacts feel each other through the trees that both of them touch. All multipliers of a contact stand together in
a block, filled up to the size of the largest one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from ngalpha_pin.numerics.proximal_newton import ORDERING
from ngalpha_pin.numerics.tree_matrix import Trees

if TYPE_CHECKING:
    from ngalpha_pin.contact.row_layout import Layout
    from ngalpha_pin.contact.table import Subset


class ContactBlocks:
    """Index arrays of one set of contacts; a meeting is a contact with one of the trees that it touches.

    Args:
        trees: of the scene.
        sub: the contacts.
        layout: of their multipliers.

    Attributes:
        size: rows of W of a contact, with those that fill it up.
        full: multipliers of a contact, likewise: 1 on position level, `size` on the two others each.
        rows: rows of W of each contact, shape (k, size); those that fill it up are number `layout.rows`.
        contact, dofs: contact and velocity coordinates of each meeting, shapes (e,) and (e, largest tree); coordinates
            that fill it up are number nv.
        own_dofs: which ones do not fill it up.
        tree_number: tree of each meeting.
        tree, group: place of the tree of each meeting in its group of trees of one size, and the group.
        first, second: the two meetings of each pair that share a tree, shape (p,).
        pair: the pair of contacts that they belong to.
        row, column: the contacts of each pair of contacts.
        multipliers: of each contact, shape (k, full); those that fill it up are number `layout.n`.
        filled: which ones these are.
        contact_of: contact of each multiplier.
        at: place of each multiplier in the matrix, behind them those that fill it up, shape (k, full).
        n: size of the matrix.
    """

    def __init__(self, trees: Trees, sub: Subset, layout: Layout):
        k, m, n = sub.k, sub.m, layout.n
        counts = np.bincount(sub.of_F, minlength=k)
        self.size = size = 1 + int(counts.max(initial=0))
        self.full, self._n = 1 + 2 * size, n
        self.rows = np.full((k, size), layout.rows)
        self.rows[:, 0] = np.arange(k)
        among = np.arange(m) - np.searchsorted(sub.of_F, sub.of_F)
        self.rows[sub.of_F, 1 + among] = k + np.arange(m)
        self._meetings(trees, sub)
        self._pairs(trees)
        # multiplier of each place in the blocks
        at = [np.append(np.arange(n)[place], n) for place in (layout.at_g, layout.at_v, layout.at_a)]
        at_v, at_a = (np.append(x[:-1], np.full(layout.rows + 1 - len(x[:-1]), n)) for x in at[1:])
        self.multipliers = np.concatenate((at[0][:k, None], at_v[self.rows], at_a[self.rows]), axis=1)
        self.filled = self.multipliers == n
        contacts, places = np.nonzero(~self.filled)
        self.contact_of, self._place = np.empty(n, dtype=int), np.empty(n, dtype=int)
        used = self.multipliers[contacts, places]
        self.contact_of[used], self._place[used] = contacts, places
        contacts, places = np.nonzero(self.rows < layout.rows)
        self._row_contact, self._row_place = np.empty((2, layout.rows), dtype=int)
        used = self.rows[contacts, places]
        self._row_contact[used], self._row_place[used] = contacts, places
        self._pattern()

    def _meetings(self, trees: Trees, sub: Subset) -> None:
        """Contacts and the trees that they touch."""
        table = sub.table
        nodes: list[list[int]] = []
        for i in sub.index.tolist():
            if i < table.n_points:
                joints = [int(table.bodies[body[i]]) for body in (table.body_b, table.body_a)]
            else:
                joints = [int(table.limit_joint[i - table.n_points])]
            nodes.append(sorted({trees.of_joint[joint] for joint in joints if joint > 0}))
        self.contact = np.repeat(np.arange(sub.k), [len(found) for found in nodes])
        tree = np.array([t for found in nodes for t in found], dtype=int)
        self.group, self.tree = trees.group[tree], trees.place[tree]
        self.tree_number = tree
        largest = max(i.shape[1] for i in trees.groups)
        self.dofs = np.full((len(tree), largest), trees.nv)
        for g, coordinates in enumerate(trees.groups):
            here = self.group == g
            self.dofs[here, : coordinates.shape[1]] = coordinates[self.tree[here]]
        self.own_dofs = self.dofs < trees.nv

    def _pairs(self, trees: Trees) -> None:
        """Pairs of meetings of one tree, and the pairs of contacts behind them."""
        order = np.argsort(self.tree_number, kind="stable")
        ends = np.cumsum(np.bincount(self.tree_number, minlength=trees.count))
        lists = [x for x in np.split(order, ends[:-1]) if len(x)]
        self.first = np.concatenate([np.repeat(x, len(x)) for x in lists])
        self.second = np.concatenate([np.tile(x, len(x)) for x in lists])
        k = len(self.rows)
        keys = self.contact[self.second] * k + self.contact[self.first]
        found, self.pair = np.unique(keys, return_inverse=True)
        self.column, self.row = np.divmod(found, k)
        self._by_pair = np.argsort(self.pair, kind="stable")
        self._first_of_pair = np.searchsorted(self.pair[self._by_pair], np.arange(len(found)))

    def _pattern(self) -> None:
        """Places of the entries of all blocks in a matrix that is stored by columns."""
        full = self.full
        n = self._n + int(self.filled.sum())
        self.at = self.multipliers.copy()
        self.at[self.filled] = self._n + np.arange(n - self._n)
        rows = np.broadcast_to(self.at[self.row][:, :, None], (len(self.row), full, full)).ravel()
        columns = np.broadcast_to(self.at[self.column][:, None, :], (len(self.row), full, full)).ravel()
        self._order = np.lexsort((rows, columns))
        self._indices = rows[self._order].astype(np.int32)
        self._starts = np.searchsorted(columns[self._order], np.arange(n + 1)).astype(np.int32)
        self._diagonal = np.flatnonzero(self._indices == columns[self._order])
        self.n = n

    def multiplier_place(self, multipliers: np.ndarray) -> np.ndarray:
        """Places of some multipliers in the blocks of their contacts."""
        return self._place[multipliers]

    def row_place(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Contacts of some rows of W, and the places of the rows among those of their contact."""
        return self._row_contact[rows], self._row_place[rows]

    def gather(self, rows: np.ndarray) -> np.ndarray:
        """Rows (rows, nv) as the part of each meeting, shape (e, size, largest tree)."""
        padded = np.zeros((rows.shape[0] + 1, rows.shape[1] + 1))
        padded[:-1, :-1] = rows
        return padded[self.rows[self.contact][:, :, None], self.dofs[:, None, :]]

    def of_trees(self, blocks: list[np.ndarray]) -> np.ndarray:
        """The block of the tree of each meeting, shape (e, largest tree, largest tree)."""
        largest = self.dofs.shape[1]
        found = np.zeros((len(self.tree), largest, largest))
        for g, block in enumerate(blocks):
            here, s = self.group == g, block.shape[1]
            found[here, :s, :s] = block[self.tree[here]]
        return found

    def sum_pairs(self, values: np.ndarray) -> np.ndarray:
        """Sums over the trees that two contacts share, shape (p, ...) -> (pairs, ...)."""
        flat = values.reshape(len(values), -1)
        return np.add.reduceat(flat[self._by_pair], self._first_of_pair, axis=0).reshape(-1, *values.shape[1:])

    def solve(self, blocks: np.ndarray, b: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """B A B b with B = (A + diag(shift))^-1, the solution of A x = b but for directions that A does not see.

        Args:
            blocks: of A, shape (pairs, full, full).
            b: shape (n,).
            shift: shape (n,).

        Returns:
            The solution (n,) and the pivots (n,); None where A is not finite or exactly singular in spite of the shift.
        """
        values = blocks.ravel()[self._order]
        if not np.isfinite(values).all():
            return None
        A = csc_array((values, self._indices, self._starts), shape=(self.n, self.n))
        shifted = A.copy()
        shifted.data[self._diagonal] += shift
        try:
            lu = splu(shifted, ORDERING)
        except RuntimeError:
            return None
        return lu.solve(A @ lu.solve(b)), lu.U.diagonal()
