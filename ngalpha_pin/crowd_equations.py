"""The equations of a step of many contacts between many trees: the same as `step_equations`, with sparse matrices.

A body touches a few others, whatever their number: the mass matrix has one block for each tree, a row of W the
coordinates of two trees, and two contacts feel each other where they share a tree.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, vstack
from scipy.sparse.linalg import splu

from .evaluation import Evaluation
from .newton_matrix import displacement_entries, stiffness
from .step_equations import StepEquations
from .system import Dynamics
from .tree_matrix import TreeMatrix

if TYPE_CHECKING:
    from .contact_table import Subset
    from .system import System

# multipliers from which on sparse matrices are faster
MANY_MULTIPLIERS = 150
# On the diagonal of the scaled Newton matrix. Dependent directions get forces that change little (the limit is the
# smallest change); a direction whose pivot is s converges by SHIFT / s in each correction.
SHIFT = 1e-9
DEPENDENT = 1e-7


class CrowdEquations(StepEquations):
    """`StepEquations` with sparse matrices."""

    def dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Dynamics:
        """The equations of motion at the end of the step, tree by tree."""
        trees, found = self.system.trees, super().dynamics(q, v, a)
        return Dynamics(found.residual, *(TreeMatrix.of(trees, A) for A in (found.M, found.K, found.D)))

    def tangent(self, ev: Evaluation) -> TreeMatrix | None:
        """See `StepEquations`."""
        T = super().tangent(ev)
        return None if T is None else TreeMatrix.of(self.system.trees, T)

    def delassus(self, ev: Evaluation) -> np.ndarray:
        """See `StepEquations`."""
        W = csr_array(ev.W)
        return (W @ ev.dynamics.M.inverse().sparse() @ W.T).toarray()

    def response(self, ev: Evaluation) -> np.ndarray:
        """See `StepEquations`."""
        S, D, KT, T = stiffness(self, ev)
        dU, dQ = -ev.dynamics.M.solve(ev.R[1:].T).T
        da = -S.solve(ev.R[0] + D @ dU + KT @ dQ)
        X, Y = self.system.row_derivatives(ev.parts, ev.v, ev.x[: self.nv])
        dv, dq = self.gamma_c * da + dU, self.beta_c * da + dQ
        dq = dq if T is None else T @ dq
        layout, y = self.layout, np.empty(self.n)
        y[layout.at_g] = (ev.W @ dq)[layout.position_rows]
        y[layout.at_v], y[layout.at_a] = ev.W @ dv + X @ dq, ev.W @ da + Y @ dv
        return y

    def correction(self, ev: Evaluation) -> tuple[np.ndarray, bool]:
        """Newton correction dx (143), and whether directions were dependent."""
        n, nv, layout = self.n, self.nv, self.layout
        if n == 0:
            return super().correction(ev)
        M = ev.dynamics.M
        S, D, KT, T = stiffness(self, ev)
        by_M, by_S = M.inverse(), S.inverse()
        W, E = csr_array(ev.W), self._displacements(ev)
        H = self._response_to_forces(ev, W, E, (by_M, by_S, D, KT, T))
        h = self.response(ev)
        J, change = self._laws_derivative(ev, H, h)
        row_scale = np.where(ev.kinematic, self.row_scale, 1.0 / self.column_scale)
        A = diags_array(row_scale) @ J @ diags_array(self.column_scale) + diags_array(np.full(n, SHIFT))
        b = -(ev.law + change) * row_scale
        if not np.isfinite(A.data).all():
            return np.full(3 * nv + n, np.nan), False
        try:
            lu = splu(csc_array(A))
        except RuntimeError:  # exactly singular in spite of the shift
            return np.full(3 * nv + n, np.nan), False
        pivots = np.abs(lu.U.diagonal())
        dz = lu.solve(b) * self.column_scale
        dU, dQ = (by_M @ (W.T @ np.array((dz[layout.at_v], E @ dz)).T - ev.R[1:].T)).T
        da = by_S @ (W.T @ dz[layout.at_a] - ev.R[0] - D @ dU - KT @ dQ)
        return np.concatenate((da, dU, dQ, dz)), bool(pivots.min() < DEPENDENT * pivots.max())

    def _displacements(self, ev: Evaluation) -> csr_array:
        """See `newton_matrix.displacements`."""
        rows, columns, values = displacement_entries(self, ev)
        return csr_array((values, (rows, columns)), shape=(self.layout.rows, self.n))

    def _response_to_forces(
        self, ev: Evaluation, W: csr_array, E: csr_array, matrices: tuple[TreeMatrix, ...]
    ) -> csr_array:
        """Change of y with the multipliers, shape (n, n); see `newton_matrix.linearise`."""
        by_M, by_S, D, KT, T = matrices
        layout, n, gamma_c, beta_c = self.layout, self.n, self.gamma_c, self.beta_c
        X, Y = (csr_array(A) for A in self.system.row_derivatives(ev.parts, ev.v, ev.x[: self.nv]))
        C, F = -1.0 * by_S.times(D).times(by_M), -1.0 * by_S.times(KT).times(by_M)
        # (da, dv, dq) per unit of W^T la, W^T La and W^T kappa
        changes = (
            (by_S, gamma_c * by_S, beta_c * by_S),
            (C, gamma_c * C + by_M, beta_c * C),
            (F, gamma_c * F, beta_c * F + by_M),
        )
        Wg, left = W[layout.position_rows], []
        for da, dv, dq in changes:
            a, v, q = da.sparse(), dv.sparse(), (dq if T is None else T.times(dq)).sparse()
            left.append(vstack((Wg @ q, W @ v + X @ q, W @ a + Y @ v), format="csr"))
        every = np.arange(n)
        rows = np.arange(layout.rows)
        order = np.concatenate([every[place] for place in (layout.at_g, layout.at_v, layout.at_a)])
        H = csr_array((n, n))
        products = vstack(left, format="csr") @ W.T.tocsr()
        for i, place in enumerate((layout.at_a, layout.at_v, None)):
            by = products[i * n : (i + 1) * n]
            to = E if place is None else csr_array((np.ones(len(rows)), (rows, every[place])), shape=(len(rows), n))
            H = H + by @ to
        back = np.empty(n, dtype=int)
        back[order] = every
        return H[back]

    def _laws_derivative(self, ev: Evaluation, H: csr_array, h: np.ndarray) -> tuple[csr_array, np.ndarray]:
        """Derivative of the residual of the laws by the multipliers (n, n), and its change with h (n,)."""
        n_c, n = self.layout.n_c, self.n
        by_y, by_forces = (coo_array(x, shape=(n_c, n_c)) for x in ev.contact.derivatives(self.gamma_c, self.beta_c))
        by_y = _with_identity(by_y, n)
        by_forces.resize((n, n))
        return by_y @ H + by_forces.tocsr(), by_y @ h


def _with_identity(A: coo_array, n: int) -> csr_array:
    """A matrix continued by the identity, shape (n, n)."""
    more = np.arange(A.shape[0], n)
    row, col = (np.concatenate((i, more)) for i in (A.row, A.col))
    return csr_array((np.concatenate((A.data, np.ones(len(more)))), (row, col)), shape=(n, n))


def is_crowd(system: System, sub: Subset) -> bool:
    """Sparse matrices are faster."""
    layout = system.layout(sub)
    return system.trees is not None and layout.n >= MANY_MULTIPLIERS and layout.f == 0
