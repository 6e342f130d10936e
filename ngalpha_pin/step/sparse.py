"""The equations of a step of many contacts between many trees: the same as `equations`, with sparse matrices.

A body touches a few others, whatever their number: the mass matrix has one block for each tree, a row of W the
coordinates of two trees, and two contacts feel each other where they share a tree (see `coupling_blocks`).
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.contact.coupling_blocks import ContactBlocks
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.contact.tree_problem import TreeProblem
from ngalpha_pin.numerics.tree_matrix import TreeMatrix
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.friction_times import normal_displacement_slope
from ngalpha_pin.step.newton_matrix import displacement_entries, stiffness
from ngalpha_pin.system.actuation import Actuation
from ngalpha_pin.system.regime import FEW
from ngalpha_pin.system.system import Dynamics, System

# On the diagonal of the scaled Newton matrix. The shifted solution, multiplied by the matrix and solved for once more,
# has the factor s / (s + SHIFT)^2 in a direction with the eigenvalue s: 1 / s where it is not tiny, and nothing where
# directions are dependent, so that forces that are not unique stay as they are.
SHIFT = 1e-7
DEPENDENT = 1e-6  # smallest pivot, in parts of the largest, at which they are so: ten shifts


class CrowdEquations(StepEquations):
    """`StepEquations` with sparse matrices."""

    @property
    def blocks(self) -> ContactBlocks:
        """Which contacts feel each other."""
        return self.system.contact_blocks(self.sub)

    def dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, actuation: Actuation) -> Dynamics:
        """The equations of motion at the end of the step, tree by tree."""
        trees, found = self.system.trees, super().dynamics(q, v, a, actuation)
        assert trees is not None
        return Dynamics(found.residual, *(TreeMatrix.of(trees, A) for A in (found.M, found.K, found.D)))

    def tangent(self, ev: Evaluation) -> TreeMatrix | None:
        """See `StepEquations`."""
        T, trees = super().tangent(ev), self.system.trees
        assert trees is not None
        return None if T is None else TreeMatrix.of(trees, T)

    def problems(self, ev: Evaluation) -> tuple[TreeProblem, TreeProblem]:
        """The contact problems of the gaps, with M, and of velocities and accelerations, with S (see `delassus`).

        Of S its symmetric part, all of it but gyroscopic terms.
        """
        solver, blocks, M = self.system.contact_solver, self.blocks, ev.dynamics.M
        free = TreeProblem(solver, blocks, M, ev.W)
        if not self.loaded:
            return free, free
        S = stiffness(self, ev)[0]
        return free, TreeProblem(solver, blocks, 0.5 * (S + S.transposed()), ev.W)

    def response(self, ev: Evaluation) -> np.ndarray:
        """See `StepEquations`."""
        return self._response(ev, *stiffness(self, ev), *self._derivatives(ev))

    def _derivatives(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        return self.system.row_derivatives(ev.parts, ev.v, ev.x[: self.nv])

    def _response(
        self,
        ev: Evaluation,
        S: TreeMatrix,
        D: TreeMatrix,
        KT: TreeMatrix,
        T: TreeMatrix | None,
        X: np.ndarray,
        Y: np.ndarray,
    ) -> np.ndarray:
        dU, dQ = -ev.dynamics.M.solve(ev.R[1:].T).T
        da = -S.solve(ev.R[0] + D @ dU + KT @ dQ)
        dv, dq = self.gamma_c * da + dU, self.beta_c * da + dQ
        dq = dq if T is None else T @ dq
        layout, y = self.layout, np.empty(self.n)
        y[layout.at_g] = (ev.W @ dq)[layout.position_rows]
        y[layout.at_v], y[layout.at_a] = ev.W @ dv + X @ dq, ev.W @ da + Y @ dv
        return y

    def correction(self, ev: Evaluation, smallest_forces: bool = False) -> tuple[np.ndarray, bool]:
        """Newton correction dx (143), and whether directions were dependent; forces that are not unique stay."""
        n, nv, layout, blocks, M = self.n, self.nv, self.layout, self.blocks, ev.dynamics.M
        S, D, KT, T = stiffness(self, ev)
        X, Y = self._derivatives(ev)
        by_M, by_S = M.inverse(), S.inverse()
        E = self._displacements(ev)
        H = self._response_to_forces(ev.W, X, Y, E, by_M, by_S, D, KT, T)
        kappa_c = normal_displacement_slope(self, ev.options)
        by_y, by_forces = (self._contact_blocks(x) for x in ev.contact.derivatives(self.gamma_c, kappa_c))
        row_scale = np.where(ev.kinematic, self.scales.row, 1.0 / self.scales.column)
        change = by_y @ np.append(self._response(ev, S, D, KT, T, X, Y), 0.0)[blocks.multipliers][:, :, None]
        b = -np.append(ev.law, 0.0)[blocks.multipliers] - change[:, :, 0]
        J = by_y[blocks.row] @ H
        own = blocks.row == blocks.column
        J[own] += by_forces
        rows, columns = (np.append(x, 1.0)[blocks.multipliers] for x in (row_scale, self.scales.column))
        J *= rows[blocks.row][:, :, None] * columns[blocks.column][:, None, :]
        J[own] += np.eye(blocks.full) * np.where(blocks.filled, 1.0, 0.0)[:, None, :]
        right = np.zeros(blocks.n)
        right[blocks.at] = b * rows
        solved = blocks.solve(J, right, np.where(np.arange(blocks.n) < n, SHIFT, 0.0))
        if solved is None:
            return np.full(3 * nv + n, np.nan), False
        dz, pivots = solved[0][:n] * self.scales.column, np.abs(solved[1])
        kappa = np.zeros((layout.k, blocks.size))
        kappa[:] = (E @ np.append(dz, 0.0)[blocks.multipliers][:, :, None])[:, :, 0]
        of_rows = np.zeros(layout.rows + 1)
        of_rows[blocks.rows] = kappa
        dU, dQ = (by_M @ (np.array((dz[layout.at_v], of_rows[:-1])) @ ev.W - ev.R[1:]).T).T
        da = by_S @ (dz[layout.at_a] @ ev.W - ev.R[0] - D @ dU - KT @ dQ)
        return np.concatenate((da, dU, dQ, dz)), bool(pivots.min() < DEPENDENT * pivots.max())

    def _displacements(self, ev: Evaluation) -> np.ndarray:
        """Derivative of kappa by the multipliers of each contact, shape (k, size, full); see `newton_matrix`."""
        blocks = self.blocks
        rows, columns, values = displacement_entries(self, ev)
        E = np.zeros((self.layout.k, blocks.size, blocks.full))
        contact, place = blocks.row_place(rows)
        E[contact, place, blocks.multiplier_place(columns)] = values
        return E

    def _response_to_forces(
        self,
        W: np.ndarray,
        X: np.ndarray,
        Y: np.ndarray,
        E: np.ndarray,
        by_M: TreeMatrix,
        by_S: TreeMatrix,
        D: TreeMatrix,
        KT: TreeMatrix,
        T: TreeMatrix | None,
    ) -> np.ndarray:
        """Change of y with the multipliers, shape (pairs, full, full); see `newton_matrix.linearise`."""
        blocks, gamma_c, beta_c = self.blocks, self.gamma_c, self.beta_c
        size, full = blocks.size, blocks.full
        C, F = -1.0 * by_S.times(D).times(by_M), -1.0 * by_S.times(KT).times(by_M)
        W_e, X_e, Y_e = (blocks.gather(A) for A in (W, X, Y))
        left = np.empty((3, len(W_e), full, W_e.shape[2]))
        # (da, dv, dq) per unit of W^T kappa, W^T La and W^T la
        for part, (da, dv, dq) in zip(
            left,
            (
                (F, gamma_c * F, beta_c * F + by_M),
                (C, gamma_c * C + by_M, beta_c * C),
                (by_S, gamma_c * by_S, beta_c * by_S),
            ),
            strict=True,
        ):
            a, v, q = (blocks.of_trees(A.blocks) for A in (da, dv, dq if T is None else T.times(dq)))
            part[:, :1] = W_e[:, :1] @ q
            part[:, 1 : 1 + size] = W_e @ v + X_e @ q
            part[:, 1 + size :] = W_e @ a + Y_e @ v
        right = W_e[blocks.second].transpose(0, 2, 1)
        by_kappa, by_La, by_la = (blocks.sum_pairs(part[blocks.first] @ right) for part in left)
        H = by_kappa @ E[blocks.column]
        H[:, :, 1 : 1 + size] += by_La
        H[:, :, 1 + size :] += by_la
        return H

    def _contact_blocks(self, entries: tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Entries that couple the multipliers of one contact as blocks, shape (k, full, full)."""
        blocks = self.blocks
        values, (rows, columns) = entries
        found = np.zeros((self.layout.k, blocks.full, blocks.full))
        np.add.at(
            found, (blocks.contact_of[rows], blocks.multiplier_place(rows), blocks.multiplier_place(columns)), values
        )
        return found


def is_crowd(system: System, sub: Subset) -> bool:
    """Sparse matrices are faster."""
    layout = system.layout(sub)
    apart = layout.n == layout.n_c and sub.k > FEW
    return system.trees is not None and apart and not len(sub.soft) and not sub.cones.rolls
