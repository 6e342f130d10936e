"""Constraints from functions of the user's own: their rates and derivatives by differences along the motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ngalpha_pin.common.tolerances import ROUNDING
from ngalpha_pin.constraints.provider import Bodies, RowWrenches
from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.numerics.finite_differences import first_derivative, two_derivatives
from ngalpha_pin.scene.own_constraints import PositionConstraint, UserConstraint

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


class UserFunctions:
    """The constraints of a scene that are functions; see `provider.Provider`."""

    everywhere = False

    def __init__(self, model: pin.Model, tree: pin.Model, constraints: list[UserConstraint]):
        self.model, self.tree = model, tree
        self.constraints = sorted(constraints, key=lambda c: not isinstance(c, PositionConstraint))
        self.names_g = tuple(
            c.name for c in self.constraints if isinstance(c, PositionConstraint) for _ in range(c.n or 0)
        )
        self.names_gamma = tuple(
            c.name for c in self.constraints if not isinstance(c, PositionConstraint) for _ in range(c.n or 0)
        )
        self.group = np.arange(len(self.names_g) + len(self.names_gamma))

    def rows(self, bodies: Bodies) -> UserRows:
        """Rows at one motion."""
        return UserRows(self, bodies)


class UserRows:
    """Rows of `UserFunctions` at one motion; attributes as those of `provider.ProviderRows`.

    Accelerations enter by W a, so that differences have to find only what the velocity makes of a row.

    Attributes:
        noise: what rounding leaves of the differences of `acceleration`, `rate` and g, shape (3, rows).
    """

    def __init__(self, table: UserFunctions, bodies: Bodies):
        self._table, self._t, self._q = table, bodies.t, bodies.q
        motion = bodies.motion
        self._levels = [isinstance(c, PositionConstraint) for c in table.constraints]
        values, W, rates, accelerations, noise = [], [], [], [], []
        for c, position in zip(table.constraints, self._levels, strict=True):
            W.append(self._derivative(c, position, motion.v))
            if _row(c) is not None:
                value = self._value(c, self._t, bodies.q, motion.v)
                rate, bent = W[-1] @ motion.v, np.zeros(1)
            else:
                value, rate = self._rate(c, position, bodies.q, motion.v)
                bent = self._acceleration(c, position, motion.v)
            if position:
                values.append(value)
            rates.append(rate)
            accelerations.append(W[-1] @ motion.a + bent)
            noise.append(self._noise(c, position, W[-1], value, motion.v))
        self.g = np.concatenate([np.zeros(0), *values])
        self.W, self.rate, self.acceleration = np.concatenate(W), np.concatenate(rates), np.concatenate(accelerations)
        self.noise = np.concatenate(noise, axis=1)
        self.sizes = 1.0, max(1.0, float(np.abs(motion.v).max(initial=0.0)))

    @property
    def wrenches(self) -> RowWrenches:
        """They act on coordinates: in joints."""
        return RowWrenches.in_joints(len(self.rate))

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each of the shape of W."""
        model, v = self._table.model, motion.v
        X, Y = [], []
        for c, position in zip(self._table.constraints, self._levels, strict=True):
            if _row(c) is not None:
                X.append(np.zeros((1, model.nv)))
                Y.append(np.zeros((1, model.nv)))
                continue

            def rate(dq: np.ndarray, c: UserConstraint = c, position: bool = position) -> np.ndarray:
                return self._rate(c, position, pin.integrate(model, self._q, dq), v)[1]

            def acceleration(dv: np.ndarray, c: UserConstraint = c, position: bool = position) -> np.ndarray:
                return self._acceleration(c, position, v + dv)

            X.append(self._by(model.nv, c.step, rate))
            Y.append(self._by(model.nv, c.step * _speed(v), acceleration))
        return np.concatenate(X), np.concatenate(Y)

    def _rate(self, c: UserConstraint, position: bool, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(g, g_dot) or (gamma, gamma) at q with velocity v."""
        value = self._value(c, self._t, q, v)
        return value, first_derivative(self._along(c, q, v), c.step / _speed(v)) if position else value

    def _acceleration(self, c: UserConstraint, position: bool, v: np.ndarray) -> np.ndarray:
        """G_ddot or gamma_dot along the motion with a velocity v that stays."""
        along, h = self._along(c, self._q, v), c.step / _speed(v)
        return two_derivatives(along, h)[2] if position else first_derivative(along, h)

    def _along(self, c: UserConstraint, q: np.ndarray, v: np.ndarray) -> Callable[[float], np.ndarray]:
        return lambda s: self._value(c, self._t + s, pin.integrate(self._table.model, q, s * v), v)

    def _noise(self, c: UserConstraint, position: bool, W: np.ndarray, value: np.ndarray, v: np.ndarray) -> np.ndarray:
        """See `noise`: the terms of a function are as large as its rows times what they are applied to."""
        largest = max(1.0, float(np.abs(self._q).max(initial=0.0))) if position else _speed(v)
        rounding = ROUNDING * np.maximum(np.abs(W).sum(axis=1) * largest, np.abs(value))
        per_time = 1.0 if _row(c) is not None else _speed(v) / c.step
        levels = (per_time**2, per_time, 1.0) if position else (per_time, 1.0, 0.0)
        return np.array(levels)[:, None] * rounding

    def _value(self, c: UserConstraint, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The function at a motion, of which it sees no states of the first order."""
        tree = self._table.tree
        return c.value(t, q[: tree.nq], v[: tree.nv])

    def _value_at(self, c: UserConstraint, v: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        return lambda dq: self._value(c, self._t, pin.integrate(self._table.model, self._q, dq), v)

    def _value_of(self, c: UserConstraint, v: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        return lambda dv: self._value(c, self._t, self._q, v + dv)

    def _derivative(self, c: UserConstraint, position: bool, v: np.ndarray) -> np.ndarray:
        """Of a value by v, on position level of the rate, shape (n, nv)."""
        nv, row = self._table.model.nv, _row(c)
        if row is not None:
            return np.concatenate((row, np.zeros(nv - len(row))))[None]  # behind it are the states and the clock
        return self._by(nv, c.step, self._value_at(c, v) if position else self._value_of(c, v))

    @staticmethod
    def _by(nv: int, step: float, function: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Derivative of a function of nv numbers at zero, shape (n, nv)."""

        def along(e: np.ndarray) -> Callable[[float], np.ndarray]:
            return lambda s: function(s * e)

        return np.stack([first_derivative(along(e), step) for e in np.eye(nv)], axis=1)


def _row(c: UserConstraint) -> np.ndarray | None:
    """Its derivative, where it is the same everywhere and known."""
    return c.row if isinstance(c, PositionConstraint) else None


def _speed(v: np.ndarray) -> float:
    """What the step of the differences is divided by to be a time in which no coordinate moves further [rad/s, m/s]."""
    return max(1.0, float(np.abs(v).max(initial=0.0)))


def user_functions(scene: Scene, model: pin.Model) -> UserFunctions | None:
    """The constraints of a scene that are functions; None where it has none."""
    found = [c for c in scene.constraints if isinstance(c, UserConstraint)]
    return UserFunctions(model, scene.model, found) if found else None
