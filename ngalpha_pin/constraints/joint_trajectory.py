"""Joint coordinates that follow a given motion: g = q - angle(t)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.constraints.joint_coupling import Coupled
from ngalpha_pin.constraints.provider import Bodies, RowWrenches
from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.errors import SceneError
from ngalpha_pin.numerics.finite_differences import two_derivatives
from ngalpha_pin.scene.breakpoints import as_polynomials, room_around
from ngalpha_pin.scene.constraints import JointTrajectory
from ngalpha_pin.scene.user_function import TIME_STEP, array_of, called

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


class Coordinates:
    """The joint trajectories of a scene; see `provider.Provider`."""

    everywhere = True

    def __init__(self, model: pin.Model, trajectories: list[JointTrajectory]):
        joints = [model.getJointId(c.joint) for c in trajectories]
        self.laws = [derivatives_of(c.angle, c.name, c.breakpoints) for c in trajectories]
        self._q, self.dofs = [model.idx_qs[j] for j in joints], np.array([model.idx_vs[j] for j in joints])
        self._turns = [model.nqs[j] == 2 for j in joints]  # (cos, sin) of a continuous joint
        self.names_g: tuple[str, ...] = tuple(c.name for c in trajectories)
        self.names_gamma: tuple[str, ...] = ()
        self.group = np.arange(len(joints))
        self.W = np.zeros((len(joints), model.nv))
        self.W[np.arange(len(joints)), self.dofs] = 1.0

    def coupled(self, which: np.ndarray) -> list[Coupled]:
        """Some of the rows, for the kernel: coordinates that are coupled to none."""
        places = [-1 - self._q[i] if self._turns[i] else self._q[i] for i in which]
        none = np.zeros(self.W.shape[1])
        return [
            Coupled([(place, 1.0)], [], none[:0], np.inf, self.W[i], none)
            for i, place in zip(which, places, strict=True)
        ]

    def rows(self, bodies: Bodies) -> CoordinateRows:
        """Rows at one motion."""
        wanted = np.array([law(bodies.t) for law in self.laws])
        q, angles = bodies.q, wanted[:, 0]
        g = np.array([
            np.arctan2(q[i + 1] * np.cos(w) - q[i] * np.sin(w), q[i] * np.cos(w) + q[i + 1] * np.sin(w))
            if turns else q[i] - w
            for i, w, turns in zip(self._q, angles, self._turns, strict=True)
        ])  # fmt: skip
        return CoordinateRows(self, g, wanted, bodies.motion)


class CoordinateRows:
    """Rows of `Coordinates` at one motion; attributes as those of `provider.ProviderRows`.

    Compiled twin: engine/kernel/couplings.c.
    """

    def __init__(self, table: Coordinates, g: np.ndarray, wanted: np.ndarray, motion: Motion):
        self.g, self.W = g, table.W
        self.rate = motion.v[table.dofs] - wanted[:, 1]
        self.acceleration = motion.a[table.dofs] - wanted[:, 2]
        self.sizes = float(np.abs(wanted[:, 0]).max()), float(np.abs(wanted[:, 1]).max())

    @property
    def wrenches(self) -> RowWrenches:
        """They act in joints."""
        return RowWrenches.in_joints(len(self.rate))

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """None of the rates depends on q, none of the accelerations on v."""
        zero = np.zeros_like(self.W)
        return zero, zero


def coordinates(scene: Scene, model: pin.Model) -> Coordinates | None:
    """The joint trajectories of a scene; None where it has none."""
    found = [c for c in scene.constraints if isinstance(c, JointTrajectory)]
    return Coordinates(model, found) if found else None


def derivatives_of(
    angle: Callable[[float], Any], name: str, breakpoints: np.ndarray
) -> Callable[[float], np.ndarray]:  # fmt: skip
    """A function of time that gives (value, first, second derivative), from what the user has.

    A function that returns three numbers is taken as it is; a spline of scipy.interpolate knows its derivatives; of any
    other function they are found by differences, which do not reach across a breakpoint.
    """
    angle = as_polynomials(angle)
    if hasattr(angle, "derivative"):
        try:
            curves = (angle, angle.derivative(1), angle.derivative(2))
        except ValueError as error:
            raise SceneError(
                f"{name}: the spline has no second derivative; give a BSpline or a PPoly, or one of higher degree"
            ) from error
        return lambda t: np.concatenate([array_of(name, called(name, curve, t), t, (1,)) for curve in curves])
    shape = np.shape(called(name, angle, 0.0))
    if shape == (3,):
        return lambda t: array_of(name, called(name, angle, t), t, shape)
    if shape not in ((), (1,)):
        raise SceneError(f"{name}: the function of time must give a number or (q, v, a), not shape {shape}")

    def by_differences(t: float) -> np.ndarray:
        def value(s: float) -> np.ndarray:
            return array_of(name, called(name, angle, t + s), t + s, (1,))

        return np.array(two_derivatives(value, TIME_STEP, room_around(t, breakpoints)))

    return lambda t: by_differences(t)[:, 0]
