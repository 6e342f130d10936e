"""States of the first order as velocities of joints that are there for them alone.

A state z is the velocity of a hinge without mass about an axis of its own, whose inertia is 1 / scale^2: its equation
of motion is z_dot = rate, impacts do not move it, and every method integrates it to its order, with the tolerance of
its scale. The coordinate of the hinge, the integral of z, means nothing. A clock is such a hinge with the velocity one,
whose coordinate is the time; own unilateral constraints need it.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ngalpha_pin.scene.extra_states import ExtraState

CLOCK = "clock of the unilateral constraints"


def with_states(tree: pin.Model, states: list[ExtraState], clock: bool = False) -> pin.Model:
    """The tree and, behind it, a joint for every state and one for the clock; the tree itself where there are none."""
    if not (states or clock):
        return tree
    model = tree.copy()
    for state in states:
        for i in range(state.n):
            name = state.name if state.n == 1 else f"{state.name}[{i}]"
            joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), name)
            inertia = pin.Inertia(0.0, np.zeros(3), np.eye(3) / state.scale**2)
            model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    if clock:
        joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), CLOCK)
        model.appendBodyToJoint(joint, pin.Inertia(0.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return model


def starting(
    states: list[ExtraState], q: np.ndarray, v: np.ndarray, clock: bool = False, t: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """A start of the tree at t with those of the states, and of the clock, behind it."""
    z = np.concatenate([np.zeros(0), *(state.start for state in states), np.ones(int(clock))])
    behind = np.zeros(len(z))
    behind[len(z) - clock :] = t
    return np.concatenate((q, behind)), np.concatenate((v, z))


class States:
    """The states of a system.

    Args:
        states: their declarations.
        tree: the model without them.
        model: with them.
    """

    def __init__(self, states: list[ExtraState], tree: pin.Model, model: pin.Model):
        self._nq, self._nv, self._states = tree.nq, tree.nv, states
        ends = tree.nv + np.cumsum([0, *(state.n for state in states)])
        self._places = [slice(int(a), int(b)) for a, b in zip(ends, ends[1:], strict=False)]
        self._size = model.nv

    def with_rates(
        self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces of the tree and their derivatives, with those of the states and with their rates behind them.

        Args:
            t: time [s].
            q: configuration with states, shape (nq,).
            v: velocity with states, shape (nv,).
            tau: of the tree alone, as are the following.
            K: d tau / dq.
            D: d tau / dv.
        """
        m, size = self._nv, self._size
        f, by_q, by_v = np.zeros(size), np.zeros((size, size)), np.zeros((size, size))
        f[:m], by_q[:m, :m], by_v[:m, :m] = tau, K, D
        for state, z in zip(self._states, self._places, strict=True):
            motion, weight = (t, q[: self._nq], v[:m], v[z]), 1.0 / state.scale**2
            rate, force = state.values(*motion)
            f[z] = weight * rate
            f[:m] += force
            of_q, of_v, of_z = state.slopes(*motion)
            n = state.n
            for of, into, columns in ((of_q, by_q, slice(0, m)), (of_v, by_v, slice(0, m)), (of_z, by_v, z)):
                into[z, columns] += weight * of[:n]
                into[:m, columns] += of[n:]
        return f, by_q, by_v
