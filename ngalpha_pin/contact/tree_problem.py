"""One contact problem of many bodies in the coordinates of the trees they touch, for the compiled contact solver.

y = b + G P with G = W A^-1 W^T, which is never formed: A has a block for each tree, a contact touches one tree or two.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ngalpha_pin.contact.coupling_blocks import ContactBlocks
from ngalpha_pin.engine.contact_solver import ContactSolver, Kind
from ngalpha_pin.numerics.tree_matrix import TreeMatrix


class TreeProblem:
    """The problems of all right sides b with one matrix A.

    Args:
        solver: what solves them; it keeps the pattern of its factors from one to the next.
        blocks: which trees the contacts touch.
        A: inertia, or what resists velocities and accelerations, symmetric.
        W: rows of the contacts, normal ones first, shape (k + m, nv).
    """

    def __init__(self, solver: ContactSolver, blocks: ContactBlocks, A: TreeMatrix, W: np.ndarray):
        self._solver, self._blocks, self._A, self._W = solver, blocks, A, W

    def response(self, P: np.ndarray) -> np.ndarray:
        """G P, shape (k + m,)."""
        return self._W @ self._A.solve(P @ self._W)

    def solve(
        self,
        b: np.ndarray,
        mu: np.ndarray,
        touches: np.ndarray,
        guess: np.ndarray,
        tolerance: float,
        tied: np.ndarray | None = None,
        direction: np.ndarray | None = None,
    ) -> tuple[np.ndarray, bool]:
        """Percussions that fulfil Signorini's and Coulomb's laws, zero where contacts do not touch.

        Args:
            b: y without percussions, shape (k + m,) [m/s]; or the same one level up or down.
            mu: friction coefficients, shape (k,) [-].
            touches: contacts that may carry percussions, shape (k,).
            guess: first P, shape (k + m,) [N s].
            tolerance: see `ContactSolver.solve` [-].
            tied: contacts whose friction is mu P_N times `direction`, shape (k,); None is none.
            direction: of friction that is tied, shape (m,) [-].

        Returns:
            P, shape (k + m,), and whether it meets the tolerance.
        """
        P, at = np.zeros(len(b)), np.flatnonzero(touches)
        if not len(at):
            return P, True
        blocks = self._blocks
        every, used = blocks.rows[at], self._used[at]
        laws, kinds = np.zeros((len(at), 6)), np.full(len(at), int(Kind.CONTACT), dtype=np.int32)
        laws[:, 0] = mu[at]
        if tied is not None and direction is not None:
            kinds[tied[at]] = Kind.TIED
            k = len(mu)
            along = np.append(direction, 0.0)[np.minimum(every[:, 1:] - k, len(direction))]
            laws[:, 3 : 2 + every.shape[1]] = np.where(tied[at, None], along, 0.0)
        meets = touches[blocks.contact]
        group = (np.cumsum(touches) - 1)[blocks.contact[meets]]
        legs = np.column_stack((group, blocks.tree_number[meets])).astype(np.int32)
        J = self._parts[meets][used[group][:, :, None] & blocks.own_dofs[meets][:, None, :]]
        rows = every[used]
        P[rows], work = self._solver.solve_arrays(
            *self._inertia, kinds, used.sum(axis=1, dtype=np.int32), laws, legs, J, b[rows], guess[rows], tolerance
        )
        return P, bool(work["solved"])

    @cached_property
    def _parts(self) -> np.ndarray:
        return self._blocks.gather(self._W)

    @cached_property
    def _used(self) -> np.ndarray:
        return self._blocks.rows < len(self._W)

    @cached_property
    def _inertia(self) -> tuple[np.ndarray, np.ndarray]:
        trees = self._A.trees
        blocks = [self._A.blocks[g][i] for g, i in zip(trees.group.tolist(), trees.place.tolist(), strict=True)]
        return np.array([len(block) for block in blocks], dtype=np.int32), np.concatenate([x.ravel() for x in blocks])
