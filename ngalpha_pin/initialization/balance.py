"""Forces at rest: what is out of balance with a set of closed contacts, and the second variation of the energy."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import ROUNDING, TINY
from ngalpha_pin.contact.compliant import elastic_forces
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.numerics.block_matrix import dense
from ngalpha_pin.scene.forces import Control
from ngalpha_pin.system.system import System

TOL = 1e-11  # of forces, in parts of the loads, and of gaps, in parts of the size of the scene
DEPENDENT = 1e-12  # part of the largest singular value of the rows below which directions are dependent
MASSLESS = 1e-10  # part of the largest inertia that every coordinate has at least, so that it is a metric
MAX_RETURNS = 12  # corrections that bring a displaced configuration back to its constraints


class Forces(NamedTuple):
    """Forces at rest.

    Attributes:
        R: what acts against motion, without contacts and constraints; the gradient of the energy, shape (nv,).
        K: its derivative by q, shape (nv, nv).
        g: gaps of closed contacts and position constraints, zero for the other rows, shape (rows,).
        W: directions of the forces of contacts and constraints, shape (rows, nv).
        floor: what rounding leaves of R, shape (nv,) or a number.
    """

    R: np.ndarray
    K: np.ndarray
    g: np.ndarray
    W: np.ndarray
    floor: np.ndarray | float


class Metric:
    """Lengths of displacements from their kinetic energy, and the motions that some rows leave.

    Args:
        M: mass matrix, shape (nv, nv).
        W: rows of closed contacts and constraints, shape (rows, nv).

    Attributes:
        basis: orthonormal motions that the rows leave, shape (nv, n).
    """

    def __init__(self, M: np.ndarray, W: np.ndarray):
        nv = len(M)
        L = np.linalg.cholesky(M + MASSLESS * max(M.diagonal().max(initial=0.0), TINY) * np.eye(nv))
        self._root = np.linalg.inv(L).T
        scale = 1.0 / np.maximum(np.linalg.norm(W @ self._root, axis=1), TINY)
        self._scale = scale
        u, s, vt = np.linalg.svd(scale[:, None] * (W @ self._root))
        rank = int((s > DEPENDENT * s.max(initial=0.0)).sum())
        self._u, self._s, self._v = u[:, :rank], s[:rank], vt[:rank].T
        self.basis = self._root @ vt[rank:].T

    def forces(self, R: np.ndarray) -> np.ndarray:
        """The forces of the rows that balance R best; where they are not unique, the smallest ones, shape (rows,)."""
        return self._scale * (self._u @ ((self._v.T @ (self._root.T @ R)) / self._s))

    def back(self, g: np.ndarray) -> np.ndarray:
        """The shortest displacement that takes g away, shape (nv,)."""
        return -self._root @ (self._v @ ((self._u.T @ (self._scale * g)) / self._s))


class Balance:
    """Balance of forces at rest with a set of closed contacts.

    Args:
        system: compiled scene.
        sub: closed contacts; they stay closed and stick.
        t: time of forces and of constraints that move [s].
    """

    def __init__(self, system: System, sub: Subset, t: float):
        self.system, self.sub, self._t = system, sub, t
        self._layout = system.layout(sub)
        rows = np.arange(sub.k + sub.m + self._layout.kb + self._layout.mb)
        self.kept = np.delete(rows, sub.soft)  # the normal forces of compliant contacts are known
        self.rows = len(self.kept)
        self._still = np.zeros(system.nv)
        # a control without derivatives in the step has a stiffness all the same
        self._controls = [
            Control(c.law, derivatives=True) for c in system.controls if isinstance(c, Control) and not c.derivatives
        ]
        for control in self._controls:
            control.check(system.scene)

    def forces(self, q: np.ndarray) -> Forces:
        """Forces at rest at q."""
        system, k, m, kb = self.system, self.sub.k, self.sub.m, self._layout.kb
        dynamics = system.dynamics(self._t, q, self._still, self._still)
        R, K, floor = dynamics.residual.copy(), np.array(dense(dynamics.K)), ROUNDING * system.rounding(q, dynamics)
        n = system.tree.nv
        for control in self._controls:
            stiffness = np.zeros((n, n))
            control.add_to(self._t, q[: system.tree.nq], self._still[:n], np.zeros(n), stiffness, np.zeros((n, n)))
            K[:n, :n] -= stiffness
        n = self.rows + len(self.sub.soft)
        g, W = np.zeros(n), np.zeros((n, system.nv))
        parts = self._parts(q, self._still)
        if parts:
            W = system.directions(parts)
            g[:k] = parts[0].g_N if k else g[:k]
            g[k + m : k + m + kb] = parts[-1].g if kb else 0.0
        if len(self.sub.soft):
            R -= self._soft_forces(parts[0]) @ W[self.sub.soft]
        return Forces(R, K, g[self.kept], W[self.kept], floor)

    def gradient(self, q: np.ndarray) -> np.ndarray:
        """R at q, shape (nv,)."""
        R = np.array(self.system.dynamics(self._t, q, self._still, self._still).residual)
        if len(self.sub.soft):
            rows = self.system.contact_rows(self.sub, q, self._still, self._still, self._t)
            R -= self._soft_forces(rows) @ self.system.directions([rows])[self.sub.soft]
        return R

    def whole(self, q: np.ndarray, la: np.ndarray) -> np.ndarray:
        """Forces of all rows at q from those that were looked for, shape (k + m + constraints,)."""
        found = np.zeros(self.rows + len(self.sub.soft))
        found[self.kept] = la
        if len(self.sub.soft):
            self.system.dynamics(self._t, q, self._still, self._still)
            rows = self.system.contact_rows(self.sub, q, self._still, self._still, self._t)
            found[self.sub.soft] = self._soft_forces(rows)
        return found

    def _soft_forces(self, rows: Any) -> np.ndarray:
        return elastic_forces(self.sub, rows.g_N, np.zeros(self.sub.k))[0]

    def tolerance(self, at: Forces, la: np.ndarray) -> np.ndarray | float:
        """Forces out of balance that count as none [N]."""
        largest = np.abs(at.R).max(initial=0.0) + np.abs(la[:, None] * at.W).max(initial=0.0)
        return TOL * max(largest, self.system.weight**2 * 1e-3, TINY) + at.floor

    def closed(self, g: np.ndarray) -> bool:
        """Gaps and constraints vanish."""
        return bool((np.abs(g) <= TOL * self.system.contacts.length).all())

    def metric(self, q: np.ndarray, W: np.ndarray) -> Metric:
        """The metric at q."""
        return Metric(self.system.mass_matrix(q), W)

    def returned(self, q: np.ndarray) -> np.ndarray | None:
        """The configuration next to q that fulfils constraints and closes contacts; None where none is found."""
        for _ in range(MAX_RETURNS):
            at = self.forces(q)
            if self.closed(at.g):
                return q
            dq = self.metric(q, at.W).back(at.g)
            if not np.isfinite(dq).all():
                return None
            q = self.system.integrate(q, dq)
        return q if self.closed(self.forces(q).g) else None

    def work(self, q: np.ndarray, dq: np.ndarray) -> float:
        """What the energy rises by along a displacement: the work against all forces, by Gauss's rule [J]."""
        points, weights = np.polynomial.legendre.leggauss(4)
        values = (dq @ self.gradient(self.system.integrate(q, 0.5 * (1 + s) * dq)) for s in points)
        return float(sum(0.5 * w * value for w, value in zip(weights, values, strict=True)))

    def second_variation(self, q: np.ndarray, at: Forces, la: np.ndarray) -> np.ndarray:
        """Stiffness of what is free to move: d/dq of (R - W^T la), shape (nv, nv)."""
        if not len(self.sub.soft):
            return at.K - self._geometric_stiffness(q, la, at.W)
        whole = self.whole(q, la)
        rows = self.system.contact_rows(self.sub, q, self._still, self._still, self._t)
        W_soft = self.system.directions([rows])[self.sub.soft]
        by_g = elastic_forces(self.sub, rows.g_N, np.zeros(self.sub.k))[1]
        K = at.K - (W_soft.T * by_g) @ W_soft
        return K - self._geometric_stiffness(q, whole, np.concatenate((at.W, W_soft)))

    def _parts(self, q: np.ndarray, v: np.ndarray) -> list[Any]:
        """Rows of closed contacts and of constraints, after the dynamics at q and v."""
        system = self.system
        parts = [system.contact_rows(self.sub, q, v, self._still, self._t)] if self.sub.k else []
        return parts + ([system.constraint_rows(self._t, q, v, self._still)] if system.constraints.names else [])

    def _geometric_stiffness(self, q: np.ndarray, la: np.ndarray, W: np.ndarray) -> np.ndarray:
        """Derivative of W^T la by q: row i from what the velocity e_i makes of the rates, shape (nv, nv)."""
        system, nv = self.system, self.system.nv
        G, seen = np.zeros((nv, nv)), np.flatnonzero(W.any(axis=0))
        if not la.any():
            return G
        for i in (*seen, -1):
            v = np.eye(nv)[i] if i >= 0 else self._still
            system.dynamics(self._t, q, v, self._still)
            X, _ = system.row_derivatives(self._parts(q, v), v, self._still)
            if i >= 0:
                G[i] = la @ X
        G[seen] -= la @ X
        return G
