"""Force laws, each with its derivatives: they enter the Newton matrix, so that stiff ones stay stable."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.scene.breakpoints import checked_breakpoints
from ngalpha_pin.scene.joint_sum import JointSum, joint_factors
from ngalpha_pin.scene.protocols import Declared, Kinematics
from ngalpha_pin.scene.user_function import DIFFERENCE, array_of, called


class Force(Protocol):
    """What a force law offers to the system."""

    def check(self, scene: Declared) -> None:
        """Raise a SceneError if the law does not fit the scene."""

    def bind(self, kinematics: Kinematics) -> BoundForce:
        """The law on the bodies of a system."""


class BoundForce(Protocol):
    """A force law in a system."""

    @property
    def energy(self) -> Callable[[np.ndarray], float] | None:
        """Stored energy at q [J]; None where the force can feed energy in."""

    @property
    def actuated(self) -> bool:
        """The force comes from the motors of the joints and stays within their effort limits."""

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """Add the generalized force to `tau` (nv,), its d/dq to `K` and its d/dv to `D`, both (nv, nv)."""


def without_model(force: object) -> dict[str, object]:
    """The attributes of a force for pickle: `check` finds its model again."""
    return {name: value for name, value in vars(force).items() if name != "_model"}


class JointSpring:
    """A linear spring in a joint coordinate or a sum of them, tau = stiffness (rest - q) - damping v.

    Args:
        joint: name of a joint with one coordinate, of a continuous one by its angle, in which the spring goes the
            shorter way; or factors by joint name: the spring acts on the sum, as a fixed tendon.
        stiffness: [N m / rad or N / m].
        rest: coordinate without force [rad or m], or the lower and upper end of a range without force.
        damping: [N m s / rad or N s / m].
    """

    actuated = False

    def __init__(
        self,
        joint: str | Mapping[str, float],
        stiffness: float,
        rest: float | tuple[float, float] = 0.0,
        damping: float = 0.0,
    ):
        self.joint = joint_factors("JointSpring: joint", joint)
        self.stiffness = checks.number(f"JointSpring {joint!r}: stiffness", stiffness, 0.0)
        what = f"JointSpring {joint!r}: rest"
        ends = (
            checks.array(what, rest, (2,)) if checks.dimensions(what, rest) else np.full(2, checks.number(what, rest))
        )
        if ends[0] > ends[1]:
            raise checks.fail(what, rest, "a range that begins at its lower end")
        self.rest, self._ends = rest, (float(ends[0]), float(ends[1]))
        self.damping = checks.number(f"JointSpring {joint!r}: damping", damping, 0.0)

    def check(self, scene: Declared) -> None:
        """Find the coordinate."""
        self._sum = JointSum(f"JointSpring {self.joint!r}", self.joint, scene.model)

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `Force`."""
        row, stretch = self._sum.row, self._stretch(q)
        tau -= (self.stiffness * stretch + self.damping * float(row @ v)) * row
        square = np.outer(row, row)
        if stretch or self._ends[0] == self._ends[1]:
            K -= self.stiffness * square
        D -= self.damping * square

    def bind(self, kinematics: Kinematics) -> JointSpring:
        """See `Force`."""
        return self

    def enter(self, laws: Any) -> None:
        """Become one of the force laws of the engine."""
        places, factors = self._sum.parts
        laws.add_joint_spring(self._sum.row.tolist(), places, factors, self._sum.period)

    @property
    def numbers(self) -> list[float]:
        """What the engine is told in every call."""
        return [self.stiffness, *self._ends, self.damping]

    def energy(self, q: np.ndarray) -> float:
        """Energy stored in the spring [J]."""
        return 0.5 * self.stiffness * self._stretch(q) ** 2

    def _stretch(self, q: np.ndarray) -> float:
        """By how much the coordinate is beyond the nearer end of the range without force."""
        middle, half = 0.5 * (self._ends[0] + self._ends[1]), 0.5 * (self._ends[1] - self._ends[0])
        away = self._sum.nearest(self._sum.value(q) - middle)
        return float(np.sign(away) * max(abs(away) - half, 0.0))


class Control:
    """A generalized force from a function of the user's own, tau(t, q, v).

    The law must be pure: it is called any number of times in a step, not in the order of time and also at motions that
    the run does not come to, so that it must depend on its arguments alone. At the start of a run two calls with the
    same arguments must give the same. A law with a memory, a filter or noise is a `SampledControl`.

    Args:
        law: called with (t, q, v), returns shape (nv,) [N or N m].
        derivatives: take the derivatives by differences into the Newton matrix, 2 (nv + nv) calls more an evaluation;
            a stiff feedback needs them, or better a `JointPD`.
        breakpoints: times at which the law jumps, increasing [s].
    """

    energy = None
    actuated = True
    curve = None

    def __init__(
        self,
        law: Callable[[float, np.ndarray, np.ndarray], np.ndarray],
        derivatives: bool = False,
        breakpoints: Sequence[float] = (),
    ):
        self.law = checks.function("Control: law", law, "of (t, q, v) that returns shape (nv,)")
        self.derivatives = checks.flag("Control: derivatives", derivatives)
        self.name = f"Control {getattr(law, '__name__', 'of a function')}"
        self.breakpoints = checked_breakpoints(self.name, breakpoints)

    def __getstate__(self) -> dict[str, object]:
        return without_model(self)

    def check(self, scene: Declared) -> None:
        """Call the law once, so that a wrong shape shows before the run; where it is called, it may be singular."""
        self._model, nowhere = scene.model, np.full(1, np.nan)
        with np.errstate(all="ignore"):
            given = called(self.name, self.law, 0.0, pin.neutral(scene.model), np.zeros(scene.model.nv))
        array_of(self.name, given, 0.0, (scene.model.nv,), nowhere)

    def bind(self, kinematics: Kinematics) -> Control:
        """See `Force`."""
        return self

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `Force`."""
        tau += self._value(t, q, v)
        if self.derivatives:
            for i, e in enumerate(DIFFERENCE * np.eye(len(v))):
                plus, minus = (pin.integrate(self._model, q, s * e) for s in (1, -1))
                K[:, i] += (self._value(t, plus, v) - self._value(t, minus, v)) / (2 * DIFFERENCE)
                D[:, i] += (self._value(t, q, v + e) - self._value(t, q, v - e)) / (2 * DIFFERENCE)

    def sample(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The force at a time, at a fixed motion."""
        return self._value(t, q, v)

    def _value(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        given = called(self.name, self.law, t, q, v)
        return array_of(self.name, given, t, (self._model.nv,), q, v)
