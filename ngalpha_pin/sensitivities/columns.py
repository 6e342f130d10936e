"""What the columns of a derivative stand for, beside those of the start: torques and parameters of the scene.

A parameter acts on a step through five things: the generalized forces, the mass matrix, coefficients of the contacts,
and where their points and planes are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import pinocchio as pin

from ngalpha_pin.numerics.finite_differences import first_derivative
from ngalpha_pin.scene.joint_pd import JointPD
from ngalpha_pin.sensitivities.configuration import STEP
from ngalpha_pin.system.actuation import Actuation
from ngalpha_pin.system.system import System


@dataclass(frozen=True)
class Gain:
    """A column of the force laws: the law as it is, and with that parameter changed by one, in which it is linear.

    Attributes:
        column: its number.
        law, changed: of the scene.
    """

    column: int
    law: JointPD
    changed: JointPD


@dataclass(eq=False)
class Columns:
    """Which columns change what. Arrays have a last axis of p columns or are None.

    Attributes:
        p: number of columns.
        tau: generalized force on the tree, shape (nv, p).
        mu, e_N, e_F: coefficients of all contacts of the scene, shape (n, p).
        inertias: joint and its dynamic parameters (see `pin.Inertia.toDynamicParameters`) of each column.
        gains: of the force laws.
        points, planes: way of the points and of the planes of all contacts in their bodies, shape (n, 3, p) [m].
    """

    p: int
    tau: np.ndarray | None = None
    mu: np.ndarray | None = None
    e_N: np.ndarray | None = None
    e_F: np.ndarray | None = None
    inertias: list[tuple[int, int, np.ndarray]] = field(default_factory=list)
    gains: list[Gain] = field(default_factory=list)
    points: np.ndarray | None = None
    planes: np.ndarray | None = None

    def __post_init__(self) -> None:
        self._weightless: tuple[pin.Model, pin.Data] | None = None

    def after(self, n: int) -> Columns:
        """The same behind n other columns."""
        arrays = {name: getattr(self, name) for name in ("tau", "mu", "e_N", "e_F", "points", "planes")}
        wide = {
            name: None if x is None else np.concatenate((np.zeros((*x.shape[:-1], n)), x), axis=-1)
            for name, x in arrays.items()
        }
        inertias = [(column + n, joint, direction) for column, joint, direction in self.inertias]
        gains = [replace(gain, column=gain.column + n) for gain in self.gains]
        found = Columns(self.p + n, **wide, inertias=inertias, gains=gains)
        found._weightless = self._weightless
        return found

    def of(self, name: str, index: np.ndarray, p: int) -> np.ndarray | None:
        """Change of a coefficient of some contacts, shape (k, p), with columns of zeros at the end; None is none."""
        array = getattr(self, name)
        return None if array is None else _wide(array[index], p)

    def residual(
        self, system: System, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray, actuation: Actuation, p: int
    ) -> np.ndarray:
        """Change of M a + h - tau at a motion, shape (nv, p)."""
        change, tree = np.zeros((system.nv, p)), system.tree
        n, m = tree.nq, tree.nv
        acts = np.zeros((m, p))
        if self.tau is not None:
            acts[:, : self.p] += self.tau
        for gain in self.gains:
            acts[:, gain.column] += _torque(gain.changed, t, q[:n], v[:m]) - _torque(gain.law, t, q[:n], v[:m])
        if system.effort is not None and acts.any():
            passed = system.passed_limits(t, q, v, actuation) if actuation.held is None else actuation.held
            acts[passed != 0] = 0.0
        change[:m] -= acts
        if self.inertias:
            data = tree.createData()
            change[:m, : self.p] += self._regressed(tree, data, q[:n], v[:m], a[:m])
        return change

    def stiffness(
        self, system: System, t: float, q: np.ndarray, v: np.ndarray, actuation: Actuation, p: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Change of D and K, the derivatives of h - tau by v and by q, column by column: shape (p, nv, nv) each."""
        tree, nv = system.tree, system.nv
        n, m = tree.nq, tree.nv
        D, K = np.zeros((2, p, nv, nv))
        free = np.ones(m, dtype=bool) if system.effort is None else system.passed_limits(t, q, v, actuation) == 0
        for gain in self.gains:
            (K_law, D_law), (K_other, D_other) = (_slopes(x, t, q[:n], v[:m]) for x in (gain.law, gain.changed))
            K[gain.column, :m, :m] -= free[:, None] * (K_other - K_law)
            D[gain.column, :m, :m] -= free[:, None] * (D_other - D_law)
        if self.inertias:
            data, zero = tree.createData(), np.zeros(m)

            def torques(dq: np.ndarray, dv: np.ndarray) -> np.ndarray:
                return self._regressed(tree, data, pin.integrate(tree, q[:n], dq), v[:m] + dv, zero)

            for j, e in enumerate(np.eye(m)):
                # torques are quadratic in v
                D[: self.p, :m, j] += (torques(zero, e) - torques(zero, -e)).T / 2
                K[: self.p, :m, j] += first_derivative(partial(_scaled, torques, e, zero), STEP).T
        return D, K

    def momentum(self, system: System, q: np.ndarray, u: np.ndarray, p: int) -> np.ndarray:
        """Change of M u, shape (nv, p)."""
        change, tree = np.zeros((system.nv, p)), system.tree
        if self.inertias:
            if self._weightless is None:
                model = tree.copy()
                model.gravity = pin.Motion.Zero()
                self._weightless = model, model.createData()
            n, m = tree.nq, tree.nv
            change[:m, : self.p] = self._regressed(*self._weightless, q[:n], np.zeros(m), u[:m])
        return change

    def _regressed(self, model: pin.Model, data: pin.Data, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Torques of the changes of inertia, shape (nv of the tree, p)."""
        regressor = np.atleast_2d(pin.computeJointTorqueRegressor(model, data, q, v, a))  # one row comes as a vector
        torques = np.zeros((model.nv, self.p))
        for column, joint, parameters in self.inertias:
            torques[:, column] += regressor[:, 10 * (joint - 1) : 10 * joint] @ parameters
        return torques


def _torque(law: JointPD, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Generalized force of a law, shape (nv,)."""
    n = len(v)
    tau = np.zeros(n)
    law.add_to(t, q, v, tau, np.zeros((n, n)), np.zeros((n, n)))
    return tau


def _scaled(
    torques: Callable[[np.ndarray, np.ndarray], np.ndarray], dq: np.ndarray, dv: np.ndarray, s: float
) -> np.ndarray:
    return torques(s * dq, dv)


def _slopes(law: JointPD, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of a law by q and by v, shape (nv, nv) each."""
    n = len(v)
    K, D = np.zeros((2, n, n))
    law.add_to(t, q, v, np.zeros(n), K, D)
    return K, D


def _wide(array: np.ndarray, p: int) -> np.ndarray:
    """With columns of zeros at the end, so that there are p."""
    return np.concatenate((array, np.zeros((*array.shape[:-1], p - array.shape[-1]))), axis=-1)
