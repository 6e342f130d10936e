"""The inertia with which accelerations are averaged over a step, and how it changes; see `integrators.restart`.

With X = S - M, what springs and dampers add, it is S = M + X, or twice: S M^-1 S = M + 2 X + X M^-1 X.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.integrators.restart import relaxes
from ngalpha_pin.numerics.block_matrix import dense
from ngalpha_pin.numerics.finite_differences import first_derivative
from ngalpha_pin.sensitivities.columns import Columns
from ngalpha_pin.sensitivities.configuration import STEP, full
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System


class Inertia(NamedTuple):
    """What resists the forces of a consistent state in place of M: M + E(dt, q, v, parameters).

    Attributes:
        matrix: shape (nv, nv).
        by_dt: derivative of E a by the length of the step, shape (nv,).
        by_q, by_v: of E a by the motion, shape (nv, nv) each.
        by_columns: of E a by what else the columns change, shape (nv, p).
    """

    matrix: np.ndarray
    by_dt: np.ndarray
    by_q: np.ndarray
    by_v: np.ndarray
    by_columns: np.ndarray


def averaging(system: System, parameters: Parameters, state: State, dt: float, columns: Columns, p: int) -> Inertia:
    """The inertia of a step of the backward Euler kind, as `restart.without_unresolved` takes it.

    Args:
        system: compiled scene.
        parameters: with which the step has begun.
        state: start of the step, with the averaged accelerations.
        dt: length of the step [s].
        columns: what the columns change.
        p: their number.
    """
    af, am, gamma, beta = parameters.coefficients
    c, nv, a, zero, twice = (1 - af) / (1 - am), system.nv, state.a, np.zeros(system.nv), relaxes(parameters)
    by_D, by_K = c * gamma * dt, c * beta * dt * dt

    def adds(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        dynamics = system.dynamics(state.t, q, v, zero, state.actuation)
        K, D = dense(dynamics.K), dense(dynamics.D)
        return full(dynamics.M), by_D * _even(D), by_K * _even(K)

    def by(direction: np.ndarray, of_q: bool) -> np.ndarray:
        def moved(s: float) -> np.ndarray:
            q = system.integrate(state.q, s * direction) if of_q else state.q
            M, D, K = adds(q, state.v if of_q else state.v + s * direction)
            once = (D + K) @ a
            return 2 * once + (D + K) @ np.linalg.solve(M, once) if twice else once

        return first_derivative(moved, STEP)

    by_q, by_v = (np.array([by(row, of_q) for row in np.eye(nv)]).T for of_q in (True, False))
    M, D, K = adds(state.q, state.v)
    X, rate = D + K, (D + 2 * K) / dt
    left = np.linalg.solve(M, X) if twice else np.zeros((nv, nv))  # M^-1 X
    b = left @ a

    def changed(dX: np.ndarray) -> np.ndarray:
        """Of E a, with M held."""
        once: np.ndarray = dX @ a
        return 2 * once + dX @ b + left.T @ once if twice else once

    D_columns, K_columns = columns.stiffness(system, state.t, state.q, state.v, state.actuation, p)
    by_columns = -left.T @ columns.momentum(system, state.q, b, p)
    for D_one, K_one, at in zip(D_columns, K_columns, range(p), strict=True):
        by_columns[:, at] += changed(by_D * _even(D_one) + by_K * _even(K_one))
    matrix = M + 2 * X + X @ left if twice else M + X
    return Inertia(matrix, changed(rate), by_q, by_v, by_columns)


def _even(A: np.ndarray) -> np.ndarray:
    return (A + A.T) / 2
