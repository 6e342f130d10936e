"""Static equilibrium by Newton's method with load stepping, and the eigenmodes linearised about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.linalg import eig, null_space

from ngalpha_pin import checks
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.initial import checked_values
from ngalpha_pin.linalg.block_matrix import dense
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.system import Dynamics, System
from ngalpha_pin.tolerances import BALANCED, CONE, ROUNDING, TINY

TOL = 1e-11  # of the residuals, in parts of the loads and of the size of the scene
MAX_ITER = 25  # Newton corrections of one load step
PATIENCE = 5  # corrections after which the forces out of balance must be smaller than at first
EASY_STEPS = 3  # after so many load steps in a row the next one is twice as long
SMALLEST_STEP = 1e-4
MAX_ROUNDS = 20  # changes of the set of closed contacts


@dataclass(frozen=True)
class Equilibrium:
    """Where a scene can rest, and what holds it there.

    Attributes:
        q: configuration, shape (nq,).
        contacts: names of the closed contacts.
        la_N: their normal forces, shape (k,) [N].
        la_F: their friction forces, shape (m,) [N].
        constraints: name of the constraint of each row.
        la_b: forces of the constraints, shape (b,).
        n_iter: Newton corrections.
        load_steps: load steps.
    """

    q: np.ndarray
    contacts: tuple[str, ...]
    la_N: np.ndarray
    la_F: np.ndarray
    constraints: tuple[str, ...]
    la_b: np.ndarray
    n_iter: int
    load_steps: int


@dataclass(frozen=True)
class Modes:
    """Small vibrations about an equilibrium.

    Attributes:
        equilibrium: where they are.
        omega_squared: eigenvalues in increasing order, shape (n,) [1/s^2]; a negative one is an unstable equilibrium.
        shapes: velocities of each mode, shape (nv, n).
    """

    equilibrium: Equilibrium
    omega_squared: np.ndarray
    shapes: np.ndarray

    @property
    def frequencies(self) -> np.ndarray:
        """Eigenfrequencies, shape (n,) [Hz]; zero for a motion without stiffness."""
        return np.sqrt(np.maximum(self.omega_squared, 0.0)) / (2 * np.pi)


def static_equilibrium(scene: Scene, q0: np.ndarray, t0: float = 0.0) -> Equilibrium:
    """Find the equilibrium that is reached from q0 when gravity and the loads on beams grow from zero.

    Contacts that are closed at q0 stay closed and stick as long as they press; others close where they would penetrate.

    Args:
        scene: what rests.
        q0: start, shape (nq,); constraints may be open by little.
        t0: time of constraints that move, and of forces [s].

    Raises:
        SceneError: there is no equilibrium near q0, or a contact would slip.
    """
    system, t0 = System(checks.instance("scene", scene, Scene)), checks.number("t0", t0)
    return _equilibrium(system, checked_values(system, q0, None)[0], t0)


def eigenmodes(scene: Scene, q0: np.ndarray, t0: float = 0.0) -> Modes:
    """Eigenfrequencies and modes of small vibrations about the static equilibrium near q0, without damping.

    Args:
        scene: what vibrates.
        q0: start of the search for the equilibrium, shape (nq,).
        t0: time of constraints that move [s].

    Raises:
        SceneError: there is no equilibrium near q0.
    """
    system, t0 = System(checks.instance("scene", scene, Scene)), checks.number("t0", t0)
    found = _equilibrium(system, checked_values(system, q0, None)[0], t0)
    balance = _Balance(system, _subset(system, found), found.q, t0)
    la = np.concatenate((found.la_N, found.la_F, found.la_b))
    _, _, K, W = balance.linearise(found.q, la, 1.0)
    basis = null_space(W) if len(W) else np.eye(system.nv)
    M = basis.T @ system.mass_matrix(found.q) @ basis
    values, vectors = eig(basis.T @ K @ basis, M)
    order = np.argsort(values.real, kind="stable")
    return Modes(found, values.real[order], (basis @ vectors.real)[:, order])


def _equilibrium(system: System, q0: np.ndarray, t0: float) -> Equilibrium:
    """Load steps with one set of closed contacts after the other."""
    table, every = system.contacts, system.contacts.subset(np.arange(system.contacts.n))
    system.place(q0)
    closed = np.flatnonzero(system.gaps(every, q0) <= BALANCED * table.yardstick) if table.n else np.zeros(0, dtype=int)
    n_iter = steps = 0
    for _ in range(MAX_ROUNDS):
        sub = table.subset(closed)
        balance = _Balance(system, sub, q0, t0)
        q, la, n, load_steps = balance.solve(q0)
        n_iter, steps = n_iter + n, steps + load_steps
        system.place(q)
        gaps = system.gaps(every, q) if table.n else np.zeros(0)
        pulls = closed[la[: sub.k] < 0.0]
        deep = np.setdiff1d(np.flatnonzero(gaps < -BALANCED * table.yardstick), closed)
        if not len(pulls) and not len(deep):
            _check_friction(sub, la)
            la_N, la_F, la_b = np.split(la, (sub.k, sub.k + sub.m))
            return Equilibrium(q, sub.names, la_N, la_F, system.constraints.names, la_b, n_iter, steps)
        closed = np.union1d(np.setdiff1d(closed, pulls), deep)
    raise SceneError("static equilibrium: contacts close and open in turn; start from a q0 closer to the equilibrium")


def _subset(system: System, found: Equilibrium) -> Subset:
    return system.contacts.subset(np.array([system.contacts.names.index(name) for name in found.contacts], dtype=int))


def _check_friction(sub: Subset, la: np.ndarray) -> None:
    size = np.sqrt(np.bincount(sub.of_F, la[sub.k : sub.k + sub.m] ** 2, sub.k))
    slips = np.flatnonzero(size > sub.mu * la[: sub.k] * (1 + CONE) + CONE * np.abs(la[: sub.k]).max(initial=0.0))
    if len(slips) and sub.m:
        i = slips[0]
        raise SceneError(
            f"static equilibrium: contact {sub.names[i]!r} would slip, it needs mu = {size[i] / la[i]:.3g} "
            f"and has {sub.mu[i]:.3g}"
        )


class _Balance:
    """Balance of forces at rest with a set of closed contacts.

    The unknowns are q and the forces la of contacts and constraints. Gravity and loads are scaled with s from 0 to 1;
    what is out of balance at q0 without them is taken away in the same measure.
    """

    def __init__(self, system: System, sub: Subset, q0: np.ndarray, t: float):
        self.system, self.sub, self.t = system, sub, t
        self._layout = system.layout(sub)
        self.rows = sub.k + sub.m + self._layout.kb + self._layout.mb
        self._still = np.zeros(system.nv)
        self._open = np.zeros(system.nv), np.zeros(self.rows)
        R, g, _, _ = self.linearise(q0, np.zeros(self.rows), 0.0)
        self._open = R, g

    def solve(self, q0: np.ndarray) -> tuple[np.ndarray, np.ndarray, int, int]:
        """q, la, the number of Newton corrections and of load steps.

        Raises:
            SceneError: the load steps become too small.
        """
        q, la, s, step, n_iter, steps, easy = q0, np.zeros(self.rows), 0.0, 1.0, 0, 0, 0
        while s < 1.0:
            target = min(1.0, s + step)
            found = self._newton(q, la, target)
            n_iter, steps = n_iter + found[2], steps + 1
            if found[3]:
                q, la, s, easy = found[0], found[1], target, easy + 1
                if easy == EASY_STEPS:
                    step, easy = 2.0 * step, 0
            else:
                step, easy = step / 2.0, 0
                if step < SMALLEST_STEP:
                    raise SceneError(
                        f"no static equilibrium near q0: Newton's method stops at {s:.1%} of gravity and loads; "
                        "something can fall, buckles, or q0 is far from the equilibrium"
                    )
        return q, la, n_iter, steps

    def _newton(self, q: np.ndarray, la: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray, int, bool]:
        system, longest, first = self.system, self.system.contacts.length, 0.0
        for n in range(MAX_ITER + 1):
            R, g, K, W = self.linearise(q, la, s)
            if (np.abs(R) <= self._tolerance).all() and (np.abs(g) <= TOL * longest).all():
                return q, la, n, True
            error = float((np.abs(R) / self._tolerance).max())
            first = error if n <= 1 else first
            if n == MAX_ITER or not np.isfinite(error) or (n >= PATIENCE and error > first):
                break
            dq, dla = self._correction(R, g, K, W)
            if not np.isfinite(dq).all() or np.abs(dq).max() > 1e3 * max(longest, 1.0):
                break
            q, la = system.integrate(q, dq), la + dla
        return q, la, n, False

    def _correction(self, R: np.ndarray, g: np.ndarray, K: np.ndarray, W: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Correction of q and la; forces that are not unique are the smallest ones."""
        nv, diagonal = self.system.nv, np.abs(K.diagonal())
        scale = 1.0 / np.sqrt(diagonal + 1e-6 * max(diagonal.max(initial=0.0), TINY))
        by_row = 1.0 / np.maximum(np.linalg.norm(W * scale, axis=1), TINY)
        scales = np.concatenate((scale, by_row))
        A = np.zeros((nv + self.rows, nv + self.rows))
        A[:nv, :nv], A[:nv, nv:], A[nv:, :nv] = K, -W.T, W
        A = A * scales[:, None] * scales
        x = scales * np.linalg.lstsq(A, -scales * np.concatenate((R, g)), rcond=1e-13)[0]
        return x[:nv], x[nv:]

    def linearise(
        self, q: np.ndarray, la: np.ndarray, s: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """What is out of balance (nv,), open constraints (rows,), the stiffness (nv, nv) and W (rows, nv)."""
        system, still = self.system, self._still
        dynamics = self._dynamics(q, s)
        K = np.array(dense(dynamics.K))
        residual, floor = dynamics.residual.copy(), ROUNDING * system.rounding(q, dynamics)
        n = system.tree.nv
        if n:
            data = system.tree.createData()
            K[:n, :n] -= (1 - s) * pin.computeGeneralizedGravityDerivatives(system.tree, data, q[: system.tree.nq])
            residual[:n] -= (1 - s) * data.g
        g, W = np.zeros(self.rows), np.zeros((self.rows, system.nv))
        parts = self._parts(q, still)
        if parts:
            W = system.directions(parts)
            k = self.sub.k
            if k:
                g[:k] = parts[0].g_N
            if self._layout.kb:
                first = k + self.sub.m
                g[first : first + self._layout.kb] = parts[-1].g
        G = self._geometric_stiffness(q, la, W)
        forces = np.abs(residual).max(initial=0.0) + np.abs(la[:, None] * W).max(initial=0.0)
        self._tolerance = TOL * max(forces, system.weight**2 * 1e-3, TINY) + floor
        open_R, open_g = self._open
        return residual - la @ W - (1 - s) * open_R, g - (1 - s) * open_g, K - G, W

    def _dynamics(self, q: np.ndarray, s: float) -> Dynamics:
        """The equations of motion at rest with the loads on beams times s."""
        system, still = self.system, self._still
        if system.beams is not None:
            system.beams.factor = s
        dynamics = system.dynamics(self.t, q, still, still)
        if system.beams is not None:
            system.beams.factor = 1.0
        return dynamics

    def _parts(self, q: np.ndarray, v: np.ndarray) -> list[Any]:
        """Rows of closed contacts and of constraints, after the dynamics at q and v."""
        system = self.system
        parts = [system.contact_rows(self.sub, q, v, self._still)] if self.sub.k else []
        return parts + ([system.constraint_rows(self.t, q, v, self._still)] if system.constraints.names else [])

    def _geometric_stiffness(self, q: np.ndarray, la: np.ndarray, W: np.ndarray) -> np.ndarray:
        """Derivative of W^T la by q: row i from what the velocity e_i makes of the rates, shape (nv, nv)."""
        system, nv = self.system, self.system.nv
        G, seen = np.zeros((nv, nv)), np.flatnonzero(W.any(axis=0))
        if not la.any():
            return G
        for i in (*seen, -1):
            v = np.eye(nv)[i] if i >= 0 else self._still
            system.dynamics(self.t, q, v, self._still)
            X, _ = system.row_derivatives(self._parts(q, v), v, self._still)
            if i >= 0:
                G[i] = la @ X
        G[seen] -= la @ X
        return G
