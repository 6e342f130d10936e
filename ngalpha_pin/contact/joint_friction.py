"""Dry friction in joints: a set-valued torque with constant bounds, a friction law without a normal force."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ngalpha_pin.contact.point_rows import Motion


class JointFriction:
    """The joint coordinates with dry friction.

    Args:
        model: its `lowerDryFrictionLimit` <= tau <= `upperDryFrictionLimit` [N m or N] are the bounds.
        nv: velocity coordinates of the system.
        acts: False leaves the friction out.

    Attributes:
        f: number of coordinates with friction.
        names: of their joints.
        dofs: their places in v, shape (f,).
        lower, upper: bounds of the torque, shape (f,) [N m or N].
    """

    def __init__(self, model: pin.Model, nv: int, acts: bool):
        lower, upper = np.array(model.lowerDryFrictionLimit), np.array(model.upperDryFrictionLimit)
        self.dofs = np.flatnonzero((upper > lower) & acts)
        self.f = len(self.dofs)
        self.lower, self.upper = lower[self.dofs], upper[self.dofs]
        of = np.repeat(np.arange(model.njoints), list(model.nvs))
        self.names = tuple(model.names[int(of[i])] for i in self.dofs)
        self.W = np.zeros((self.f, nv))
        self.W[np.arange(self.f), self.dofs] = 1.0
        self.zero = np.zeros_like(self.W)

    def rows(self, v: np.ndarray, a: np.ndarray) -> JointRows:
        """Kinematics of the coordinates."""
        return JointRows(self, v[self.dofs], a[self.dofs])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bound of the torques, shape (f,) each."""
        return self.lower, self.upper

    def slip_bounds(
        self, known: np.ndarray, gamma_c: float, dt: float, whole_percussion: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Percussions of slip one way and the other (see `FrictionResidual`), shape (f,) each [N m s]."""
        lower, upper = dt * self.lower, dt * self.upper
        if whole_percussion:
            return lower, upper
        return np.clip(known + gamma_c * self.lower, lower, upper), np.clip(known + gamma_c * self.upper, lower, upper)

    def bounds_at(self, v: np.ndarray, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the torques at a velocity, where coordinates faster than `speed` slip, shape (f,) each."""
        rate = v[self.dofs]
        lower = np.where(rate < -speed, self.upper, self.lower)
        return lower, np.where(rate > speed, self.lower, self.upper)


class JointRows:
    """Coordinates themselves as rows: their velocities and accelerations."""

    def __init__(self, table: JointFriction, rate: np.ndarray, acceleration: np.ndarray):
        self.W, self.rate, self.acceleration, self._zero = table.W, rate, acceleration, table.zero
        self.sizes = (0.0, float(np.abs(rate).max()))

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """None of the rates depends on q, none of the accelerations on v."""
        return self._zero, self._zero


class FrictionResidual:
    """Residual of the laws of joint friction, (137) and (140) with constant bounds.

    As for contacts (see `laws`), in slip only an impulse would follow the velocity at the end of the step, and
    a torque within finite bounds has none: La_f = 0, unless the quadrature of the torque leaves its bounds.

    Args:
        table: the coordinates.
        y: their velocities and accelerations at the end of the step, shape (2 f,).
        x: multipliers La_f and tau_f, shape (2 f,).
        r: prox parameters, shape (2 f,).
        known: part of the quadrature of tau_f that is known at the start of the step, shape (f,) [N m s].
        dt: step [s].
        gamma_c: derivative of the quadrature by tau_f [s].
        whole_percussion: slip law (112) to the letter.
        monotone: joints that stick have percussions between those of slip one way and the other, and no others. Such a
            law has one solution for any system; all of its solutions are some of the law without this.

    Attributes:
        R: residual, shape (2 f,).
        P: percussions La_f plus the quadrature of tau_f, shape (f,) [N m s].
        kinematic: rows that stick, shape (2 f,).
    """

    def __init__(
        self, table: JointFriction, y: np.ndarray, x: np.ndarray, r: np.ndarray, known: np.ndarray,
        dt: float, gamma_c: float, whole_percussion: bool, monotone: bool = False,
    ):  # fmt: skip
        f, lower, upper = table.f, table.lower, table.upper
        self._f, self._gamma_c = f, gamma_c
        La, tau = x[:f], x[f:]
        course = known + gamma_c * tau
        self.P = P = La + course
        trial = P - r[:f] * y[:f]
        bounds = table.slip_bounds(known, gamma_c, dt, whole_percussion or not monotone)
        stick = (trial >= bounds[0]) & (trial <= bounds[1])
        bound = np.where(trial < bounds[0], dt * lower, dt * upper)
        inside = np.clip(course, dt * lower, dt * upper)
        self._free = (inside == course) & ~stick & (not whole_percussion)
        slip = P - (bound if whole_percussion else inside)
        along = np.where(trial < bounds[0], np.inf, -np.inf)
        trial_a = tau - r[f:] * np.where(stick, y[f:], along)  # just stopped, or along the slip
        stick_a = stick & (trial_a >= lower) & (trial_a <= upper)
        self.kinematic = np.concatenate((stick, stick_a))
        self.R = np.where(self.kinematic, y, np.concatenate((slip, tau - np.where(trial_a < lower, lower, upper))))

    def jacobian(self, H: np.ndarray, first: int) -> np.ndarray:
        """Derivative of R by the multipliers.

        Args:
            H: derivative of y, shape (2 f, n + 1).
            first: number of the first of these multipliers.
        """
        f, i = self._f, np.arange(self._f)
        D = np.zeros_like(H)
        D[i, first + i] = 1.0
        D[i, first + f + i] = np.where(self._free, 0.0, self._gamma_c)
        D[f + i, first + f + i] = 1.0
        return np.where(self.kinematic[:, None], H, D)
