"""Forces at frames: spring and damper between two of them, and wrenches, each with its derivatives.

With the world Jacobian columns J_i of Pinocchio, a wrench F on a body is the generalized force J_i . F. Joint
coordinate j turns J_i by J_j x J_i where it stands before i in the tree: the geometric part of the stiffness.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.constraints.frame_rows import FrameRows, FrameTable
from ngalpha_pin.constraints.frames import frame_rows
from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.contact.reach import moved_by
from ngalpha_pin.errors import SceneError
from ngalpha_pin.numerics.spatial import cross, force_cross
from ngalpha_pin.scene.breakpoints import checked_breakpoints
from ngalpha_pin.scene.constraints import Distance, place_of
from ngalpha_pin.scene.protocols import Declared, Kinematics
from ngalpha_pin.scene.user_function import array_of, called

NOTHING = np.zeros(0)
# ends that are nearer than this part of the rest length have no direction from one to the other
COINCIDE = 1e-12


def stands_before(model: pin.Model) -> np.ndarray:
    """1 where coordinate j (second index) moves the axis of coordinate i, shape (nv, nv)."""
    of = np.repeat(np.arange(model.njoints), list(model.nvs))
    return np.array([moved_by(model, joint) for joint in of]).reshape(model.nv, model.nv)


class Spring:
    """A linear spring and damper between the origins of two frames.

    The force that pulls them together is stiffness (length - rest) + damping d length / dt.

    Args:
        frame_a, frame_b: names of frames of the model, or "world".
        stiffness: [N/m], >= 0.
        rest: length without force [m], >= 0.
        damping: [N s/m], >= 0.
        placement_a, placement_b: pose of the ends in the frames; by default their origins.

    Raises:
        SceneError: a number is negative or not finite, or an end coincides with the other one (there is no direction).
    """

    actuated = False

    def __init__(
        self,
        frame_a: str,
        frame_b: str,
        stiffness: float,
        rest: float = 0.0,
        damping: float = 0.0,
        placement_a: pin.SE3 | None = None,
        placement_b: pin.SE3 | None = None,
    ):
        self.name = f"{type(self).__name__} {checks.name('frame_a', frame_a)}-{checks.name('frame_b', frame_b)}"
        self.stiffness = checks.number(f"{self.name}: stiffness", stiffness, 0.0)
        self.rest = checks.number(f"{self.name}: rest", rest, 0.0)
        self.damping = checks.number(f"{self.name}: damping", damping, 0.0)
        self.ends = Distance(frame_a, frame_b, 1.0, placement_a, placement_b, self.name)

    def check(self, scene: Declared) -> None:
        """The frames exist and are on different bodies."""
        self.ends.check(scene)

    def bind(self, system: Kinematics) -> BoundSpring:
        """The spring on the kinematics of a system."""
        return BoundSpring(self, system)


class Damper(Spring):
    """A linear damper between the origins of two frames.

    Args:
        frame_a, frame_b: names of frames of the model, or "world".
        damping: [N s/m], >= 0.
        placement_a, placement_b: pose of the ends in the frames.
    """

    def __init__(
        self,
        frame_a: str,
        frame_b: str,
        damping: float,
        placement_a: pin.SE3 | None = None,
        placement_b: pin.SE3 | None = None,
    ):
        super().__init__(frame_a, frame_b, 0.0, 0.0, damping, placement_a, placement_b)


class BoundSpring:
    """A `Spring` in a system."""

    actuated = False

    def __init__(self, spring: Spring, system: Kinematics):
        self._spring, self._system = spring, system
        self._table = FrameTable(system.model, frame_rows(system.scene, spring.ends), 0)
        self._before = stands_before(system.model)
        a, b = (moved_by(system.model, joint) for joint in (self._table.rows[0].body_a, self._table.rows[0].body_b))
        self._on_a, self._on_b = a, b

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `forces.Force`."""
        spring, motion = self._spring, self._system.motion(v, np.zeros_like(v))
        rows = self._rows(motion)
        W, F = rows.W[0], rows.F[0]
        f = -spring.stiffness * (rows.g[0] + 1.0 - spring.rest) - spring.damping * rows.rate[0]
        X, _ = rows.derivatives(motion)
        tau += f * W
        D -= spring.damping * np.outer(W, W)
        K -= np.outer(W, spring.stiffness * W + spring.damping * X[0])
        # the direction of the force, which goes along with both ends, and the axes of the joints
        length, e, J = max(rows.g[0] + 1.0, TINY), F[:3], motion.J
        ends = rows.c[0], rows.c[0] - length * e
        P_b, P_a = (
            (J[:3].T + cross(J[3:].T, np.tile(c, (len(v), 1)))) * on[:, None]
            for c, on in zip(ends, (self._on_b, self._on_a), strict=True)
        )
        de = (P_b - P_a - np.outer((P_b - P_a) @ e, e)) / length
        dF = np.hstack((de, np.cross(P_b, e) + np.cross(ends[0], de)))
        K += f * (self._on_b - self._on_a)[:, None] * (J.T @ dF.T + turning(J, F, self._before))

    def wrenches(self, t: float, q: np.ndarray, v: np.ndarray, total: np.ndarray) -> None:
        """Add what the spring does to the bodies, where `dynamics` has put them, to (n_joints, 6)."""
        rows, spring, ends = self._rows(self._system.motion(v, np.zeros_like(v))), self._spring, self._table.rows[0]
        f = -spring.stiffness * (rows.g[0] + 1.0 - spring.rest) - spring.damping * rows.rate[0]
        total[ends.body_b] += f * rows.F[0]
        total[ends.body_a] -= f * rows.F[0]

    def enter(self, laws: Any) -> None:
        """Become one of the force laws of the engine."""
        row = self._table.rows[0]
        ends = row.o.tolist(), row.c.tolist(), self._on_a.tolist(), self._on_b.tolist()
        laws.add_spring(row.body_a, row.body_b, *ends)

    @property
    def numbers(self) -> list[float]:
        """What the engine is told in every call."""
        return [self._spring.stiffness, self._spring.rest, self._spring.damping]

    def energy(self, q: np.ndarray) -> float:
        """Energy stored in the spring [J]."""
        self._system.place(q)
        still = np.zeros(self._system.nv)
        stretch = self._rows(self._system.motion(still, still)).g[0] + 1.0 - self._spring.rest
        return 0.5 * self._spring.stiffness * float(stretch) ** 2

    def check_start(self, q: np.ndarray) -> None:
        """The ends are apart, or the force vanishes where they meet.

        Raises:
            SceneError: the force has no direction.
        """
        spring, still = self._spring, np.zeros(self._system.nv)
        self._system.place(q)
        length = float(self._rows(self._system.motion(still, still)).g[0]) + 1.0
        if spring.stiffness > 0.0 and spring.rest > 0.0 and length <= COINCIDE * spring.rest:
            raise SceneError(
                f"{spring.name}: its ends coincide at q0, so that its force has no direction; move them apart, or give "
                "the spring the rest length 0"
            )

    def _rows(self, motion: Motion) -> FrameRows:
        return FrameRows(self._table, *self._system.poses, []).move(motion)


class Wrench:
    """A force and a moment on a frame.

    Args:
        frame: name of a frame of the model.
        force: (3,) [N], or a function of time that gives it.
        moment: (3,) [N m], or a function of time.
        local: in the axes of the frame, so that they turn with it; otherwise in those of the world.
        breakpoints: times at which the force or the moment jumps or has a kink, increasing [s].

    Raises:
        SceneError: a shape is wrong or a number is not finite.
    """

    actuated = False
    curve = None

    def __init__(
        self,
        frame: str,
        force: Sequence[float] | Callable[[float], Sequence[float]] = (0.0, 0.0, 0.0),
        moment: Sequence[float] | Callable[[float], Sequence[float]] = (0.0, 0.0, 0.0),
        local: bool = False,
        breakpoints: Sequence[float] = (),
    ):
        self.name = f"Wrench {checks.name('Wrench: frame', frame)}"
        self.frame, self.local = frame, checks.flag(f"{self.name}: local", local)
        self.force, self.moment = _given(f"{self.name}: force", force), _given(f"{self.name}: moment", moment)
        self.breakpoints = checked_breakpoints(self.name, breakpoints)

    def check(self, scene: Declared) -> None:
        """The frame exists, and the force can be evaluated."""
        place_of(scene, self.frame)
        self.at(0.0)

    def at(self, t: float) -> np.ndarray:
        """Force and moment at t, shape (6,)."""
        return np.concatenate([
            vector_at(f"{self.name}, {what}", x, t) for what, x in (("force", self.force), ("moment", self.moment))
        ])  # fmt: skip

    def sample(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Force and moment at a time, shape (6,)."""
        return self.at(t) if callable(self.force) or callable(self.moment) else NOTHING

    def bind(self, system: Kinematics) -> BoundWrench:
        """The wrench on the kinematics of a system."""
        return BoundWrench(self, system)


class BoundWrench:
    """A `Wrench` in a system."""

    actuated = False
    energy = None

    def __init__(self, wrench: Wrench, system: Kinematics):
        self._wrench, self._system = wrench, system
        self._joint, self._pose = place_of(system.scene, wrench.frame)
        self._on, self._before = moved_by(system.model, self._joint), stands_before(system.model)

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `forces.Force`."""
        J = self._system.motion(v, v).J * self._on
        c, f, m = self._acting(t)
        turns = J[3:].T if self._wrench.local else np.zeros_like(J[3:].T)
        F = np.concatenate((f, np.cross(c, f) + m))
        tau += J.T @ F
        P = J[:3].T + np.cross(J[3:].T, c)
        df = np.cross(turns, f)
        dF = np.hstack((df, np.cross(P, f) + np.cross(c, df) + np.cross(turns, m)))
        K += J.T @ dF.T + self._on[:, None] * turning(J, F, self._before)

    def wrenches(self, t: float, q: np.ndarray, v: np.ndarray, total: np.ndarray) -> None:
        """Add the wrench on the body, where `dynamics` has put it, to (n_joints, 6)."""
        c, f, m = self._acting(t)
        total[self._joint] += np.concatenate((f, np.cross(c, f) + m))

    def enter(self, laws: Any) -> None:
        """Become one of the force laws of the engine."""
        pose = self._pose.rotation.ravel(order="F").tolist(), self._pose.translation.tolist()
        laws.add_wrench(self._joint, *pose, self._on.tolist(), self._wrench.local)

    @property
    def numbers(self) -> list[float] | None:
        """What the engine is told in every call; None where it is a function of time."""
        force, moment = self._wrench.force, self._wrench.moment
        return None if callable(force) or callable(moment) else [*force.tolist(), *moment.tolist()]

    def _acting(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where the force acts, the force and the moment, in the world, shape (3,) each."""
        rotations, translations = self._system.poses
        R = rotations[self._joint]
        f, m = self._wrench.at(t).reshape(2, 3)
        if self._wrench.local:
            f, m = R @ self._pose.rotation @ f, R @ self._pose.rotation @ m
        return R @ self._pose.translation + translations[self._joint], f, m


class Gravity:
    """Another gravity than that of the model, e.g. on another planet or on a table that tilts.

    Args:
        acceleration: (3,) [m/s^2], or a function of time that gives it; it takes the place of `model.gravity`. A
            function does not act on a `PlanarBeam`, and is refused beside one.
        breakpoints: times at which it jumps or has a kink, increasing [s].
    """

    actuated = False
    curve = None
    name = "Gravity"

    def __init__(
        self,
        acceleration: Sequence[float] | Callable[[float], Sequence[float]],
        breakpoints: Sequence[float] = (),
    ):
        self.acceleration = _given(f"{self.name}: acceleration", acceleration)
        self.breakpoints = checked_breakpoints(self.name, breakpoints)

    def sample(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The acceleration at a time, shape (3,)."""
        return self.at(t) if callable(self.acceleration) else NOTHING

    def check(self, scene: Declared) -> None:
        """The acceleration can be evaluated."""
        self.at(0.0)

    def at(self, t: float) -> np.ndarray:
        """Acceleration at t, shape (3,) [m/s^2]."""
        return vector_at(self.name, self.acceleration, t)

    def more_than(self, given: np.ndarray) -> np.ndarray:
        """By how much it differs from the gravity of the model, for beams, whose weight is constant, shape (3,).

        Raises:
            SceneError: it is a function of time.
        """
        if callable(self.acceleration):
            raise SceneError("Gravity: a function of time does not act on a PlanarBeam; take a Rod, or a constant")
        return self.at(0.0) - given

    def bind(self, system: Kinematics) -> BoundGravity:
        """The change of gravity in a system."""
        return BoundGravity(self, system)


class BoundGravity:
    """A `Gravity` in a system: the weight of the difference to the gravity of the model."""

    actuated = False

    def __init__(self, gravity: Gravity, system: Kinematics):
        self._gravity, self._given = gravity, np.array(system.model.gravity.linear)
        self._model = system.model.copy()
        self._data = self._model.createData()
        self.energy = None if callable(gravity.acceleration) else self._potential

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `forces.Force`."""
        self._model.gravity = pin.Motion(self._gravity.at(t) - self._given, np.zeros(3))
        K -= pin.computeGeneralizedGravityDerivatives(self._model, self._data, q)
        tau -= pin.computeGeneralizedGravity(self._model, self._data, q)

    def wrenches(self, t: float, q: np.ndarray, v: np.ndarray, total: np.ndarray) -> None:
        """Add the weights of the difference, where `dynamics` has put the bodies, to (n_joints, 6)."""
        more = self._gravity.at(t) - self._given
        pin.forwardKinematics(self._model, self._data, q)
        for joint in range(1, self._model.njoints):
            inertia = self._model.inertias[joint]
            force = inertia.mass * more
            total[joint] += np.concatenate((force, np.cross(self._data.oMi[joint].act(inertia.lever), force)))

    def _potential(self, q: np.ndarray) -> float:
        """Potential energy of the difference [J]."""
        self._model.gravity = pin.Motion(self._gravity.at(0.0) - self._given, np.zeros(3))
        return float(pin.computePotentialEnergy(self._model, self._data, q))


def _given(
    name: str, given: Sequence[float] | Callable[[float], Sequence[float]]
) -> np.ndarray | Callable[[float], Sequence[float]]:
    """A vector of the user's, checked, or the function of time that gives it."""
    return given if callable(given) else checks.vector(name, given)


def vector_at(name: str, given: np.ndarray | Callable[[float], Sequence[float]], t: float) -> np.ndarray:
    """A vector that is given, or given as a function of time, shape (3,).

    Raises:
        SceneError: it is not finite or has another shape.
    """
    value = called(name, given, t) if callable(given) else given
    return array_of(name, value, t, (3,))


def turning(J: np.ndarray, F: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Derivative of J_i . F by coordinate j with the wrench F held, shape (nv, nv)."""
    by_j = -force_cross(J.T, np.tile(F, (J.shape[1], 1)))  # F . (J_j x J_i) = by_j . J_i
    return (J.T @ by_j.T) * before
