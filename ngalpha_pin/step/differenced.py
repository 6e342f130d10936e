"""The equations of a step with all derivatives by q in the Newton matrix.

How M and W change with q enters the Newton matrix multiplied by dt^2, and is left out there: corrections then shrink
the error by dt^2 |W_q la| / M each. A body that a force N holds at the wall of a hole with clearance C swings there
with omega^2 = N / (m C); where a step does not resolve that, omega dt > 1, corrections without these terms go away from
a solution that is there. Here they are differences of the residual and of the kinematics, an evaluation per coordinate.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.numerics.block_matrix import dense
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.newton_matrix import add_compliance, displacements

SHIFT = 1e-7  # of a coordinate, in parts of what the coordinates are or one: half of the digits


class DifferencedEquations(StepEquations):
    """`StepEquations` with the derivatives of M and W by q: dear, and quadratic where steps resolve no vibration."""

    def linearise(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """See `newton_matrix.linearise`."""
        nv, layout, W = self.nv, self.layout, ev.W
        M, D = dense(ev.dynamics.M).copy(), dense(ev.dynamics.D).copy()
        M = np.triu(M) + np.triu(M, 1).T
        X, Y = self.system.row_derivatives(ev.parts, ev.v, ev.x[:nv])
        R_Q, y_Q = self._by_displacement(ev)
        R_a = self.beta_c * R_Q
        R_a[:nv] += M + self.gamma_c * D
        R_a[2 * nv :] -= self.beta_c * M  # that of Q itself
        right = np.zeros((3, nv, self.n + 1))
        right[0][:, layout.at_a], right[1][:, layout.at_v] = W.T, W.T
        right[2, :, :-1] = W.T @ displacements(self, ev)
        right[:, :, -1] = -ev.R
        J = np.hstack((R_a, np.vstack((D, M, np.zeros_like(M))), R_Q))
        Z = np.linalg.solve(J, right.reshape(3 * nv, -1))
        da, dU, dQ = Z.reshape(3, nv, -1)
        dv = self.gamma_c * da + dU
        H = y_Q @ (self.beta_c * da + dQ)
        H[layout.at_v] += W @ dv
        H[layout.at_a] += W @ da + Y @ dv
        add_compliance(self, H)
        return Z, H

    def _by_displacement(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of R, shape (3 nv, nv), and of y, shape (n, nv), by Q."""
        nv = self.nv
        R_Q, y_Q = np.empty((3 * nv, nv)), np.empty((self.n, nv))
        h = SHIFT * max(1.0, float(np.abs(ev.dq).max()))
        for i in range(nv):
            x = ev.x.copy()
            x[2 * nv + i] += h
            shifted = self.evaluate(x, ev.options)
            R_Q[:, i], y_Q[:, i] = (shifted.R - ev.R).ravel() / h, (shifted.y - ev.y) / h
        return R_Q, y_Q
