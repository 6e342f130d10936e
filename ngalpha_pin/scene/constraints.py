"""Declarations of bilateral constraints (33): joints between frames, prescribed motion, rolling.

Each is a declaration; `constraints.constraint_set` compiles them. A frame is named by the frames of the model; "world"
is the inertial frame.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.scene.breakpoints import GivenAngle, checked_breakpoints
from ngalpha_pin.scene.joint_sum import JointSum, joint_factors, names_in
from ngalpha_pin.scene.protocols import Declared
from ngalpha_pin.scene.user_function import called

WORLD = "world"
# of the ratio of two continuous joints: their turns leave g undetermined by a turn over the denominator
MOST_TEETH, SAME_TURN = 200, 1e-12


@runtime_checkable
class Constraint(Protocol):
    """What every declaration offers.

    Attributes:
        name: unique in the scene, in messages and in the trajectory.
    """

    name: str

    def check(self, scene: Declared) -> None:
        """Raise a SceneError if the constraint does not fit the scene."""


class FrameConstraint:
    """Ties frame b to frame a; the subclasses say which motions are left.

    Args:
        frame_a, frame_b: names of frames of the model, or "world".
        axis: axis of the joint in the coordinates of both frames, shape (3,) [-].
        placement_a, placement_b: pose of the joint in frame a and in frame b; by default the frames themselves.
        name: by default made from the kind and the frames.

    Attributes:
        planes: directions of the frame of the joint (axis along z) in which the origins stay together.
        axes: pairs of directions, of a and of b, that stay perpendicular.
    """

    planes: ClassVar[tuple[int, ...]] = ()
    axes: ClassVar[tuple[tuple[int, int], ...]] = ()

    def __init__(
        self,
        frame_a: str,
        frame_b: str,
        axis: Sequence[float] = (0.0, 0.0, 1.0),
        placement_a: pin.SE3 | None = None,
        placement_b: pin.SE3 | None = None,
        name: str | None = None,
    ):
        self.frame_a, self.frame_b = (checks.name(f"{type(self).__name__}: frame", f) for f in (frame_a, frame_b))
        self.name = named(name, f"{type(self).__name__} {frame_a}-{frame_b}")
        self.basis = pin.SE3(basis_along(axis, self.name), np.zeros(3))
        self.placements = tuple(
            checks.placement(f"{self.name}: placement_{side}", p)
            for side, p in (("a", placement_a), ("b", placement_b))
        )

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.frame_a!r}, {self.frame_b!r})"

    def check(self, scene: Declared) -> None:
        """The frames exist and are on different bodies."""
        (joint_a, _), (joint_b, _) = self.poses(scene)
        if joint_a == joint_b:
            raise SceneError(f"{self.name}: {self.frame_a!r} and {self.frame_b!r} are on one and the same body")

    def poses(self, scene: Declared) -> tuple[tuple[int, pin.SE3], tuple[int, pin.SE3]]:
        """Joint, and pose in the frame of that joint, of both sides."""
        sides = []
        for frame, placement in zip((self.frame_a, self.frame_b), self.placements, strict=True):
            joint, pose = place_of(scene, frame)
            sides.append((joint, pose * placement * self.basis))
        return sides[0], sides[1]


class PointJoint(FrameConstraint):
    """The origins of both frames stay together, a ball joint: 3 rows."""

    planes = (0, 1, 2)


class Weld(FrameConstraint):
    """Both frames stay together: 6 rows."""

    planes = (0, 1, 2)
    axes = ((0, 1), (1, 2), (2, 0))


class RevoluteJoint(FrameConstraint):
    """The frames turn against each other about the axis: 5 rows."""

    planes = (0, 1, 2)
    axes = ((0, 2), (1, 2))


class PrismaticJoint(FrameConstraint):
    """The frames slide along the axis without turning: 5 rows."""

    planes = (0, 1)
    axes = ((0, 1), (1, 2), (2, 0))


class CylindricalJoint(FrameConstraint):
    """The frames slide along the axis and turn about it: 4 rows."""

    planes = (0, 1)
    axes = ((0, 2), (1, 2))


class PlanarJoint(FrameConstraint):
    """The frames slide in the plane across the axis and turn about it: 3 rows."""

    planes = (2,)
    axes = ((0, 2), (1, 2))


class UniversalJoint(FrameConstraint):
    """A cross: the origins stay together, and the x-axis of a stays perpendicular to the y-axis of b: 4 rows.

    These are the axes of the frame of the joint, whose z-axis is `axis`.
    """

    planes = (0, 1, 2)
    axes = ((0, 1),)


class Distance(FrameConstraint):
    """The origins of both frames keep their distance, a massless rod: 1 row.

    Args:
        frame_a, frame_b: names of frames of the model, or "world".
        length: the distance [m], > 0.
        placement_a, placement_b, name: as for every joint.
    """

    def __init__(
        self,
        frame_a: str,
        frame_b: str,
        length: float,
        placement_a: pin.SE3 | None = None,
        placement_b: pin.SE3 | None = None,
        name: str | None = None,
    ):
        super().__init__(frame_a, frame_b, placement_a=placement_a, placement_b=placement_b, name=name)
        self.length = checks.number(f"{self.name}: length", length, 0.0, above=True, unit="metres")


class DrivenAngle(GivenAngle, FrameConstraint):
    """The angle from frame a to frame b about an axis follows a function of time: 1 row.

    The axis of both frames has to stay the same by other means: a revolute joint between them, or a planar mechanism.

    Args:
        frame_a: name of a frame, a beam point or "world".
        frame_b: the same for the other side.
        angle: angle(t) [rad], or (angle, its first and second derivative); a spline of scipy.interpolate serves too.
        axis: in the coordinates of both frames, shape (3,) [-].
        placement_a: pose of the axis in frame a; by default the frame itself.
        placement_b: the same for frame b.
        name: by default made from the frames.
        breakpoints: times at which the angle jumps or has a kink, increasing [s]; knots of a spline are known.
    """

    def __init__(
        self,
        frame_a: str,
        frame_b: str,
        angle: Callable[[float], Any],
        axis: Sequence[float] = (0.0, 0.0, 1.0),
        placement_a: pin.SE3 | None = None,
        placement_b: pin.SE3 | None = None,
        name: str | None = None,
        breakpoints: Sequence[float] = (),
    ):
        super().__init__(frame_a, frame_b, axis, placement_a, placement_b, name)
        self.angle = checks.function(f"{self.name}: angle", angle, "of time that returns a number or (q, v, a)")
        self.breakpoints = checked_breakpoints(self.name, breakpoints)


class KnifeEdge(FrameConstraint):
    """The origin of frame b does not move sideways, as a blade on ice or an axle of wheels: 1 row of gamma.

    Args:
        frame: name of the frame that carries the blade.
        across: direction in that frame in which it cannot move, shape (3,) [-].
        relative_to: the frame in which it moves.
        name: by default made from the kind and the frame.
    """

    def __init__(self, frame: str, across: Sequence[float], relative_to: str = WORLD, name: str | None = None):
        super().__init__(
            relative_to, frame, axis=across, name=named(name, f"KnifeEdge {checks.name('KnifeEdge: frame', frame)}")
        )


class FrameTrajectory:
    """A frame follows a given motion: 6 rows.

    Args:
        frame: name of a frame of the model.
        pose: pose(t) -> pin.SE3 in the world, twice differentiable; or (pin.SE3, twist, acceleration), where twist is
            the velocity of the frame and acceleration its time derivative, both (6,) and in the axes of the frame.
        name: by default made from the frame.
        breakpoints: times at which the motion jumps or has a kink, increasing [s].
    """

    curve = None

    def __init__(
        self, frame: str, pose: Callable[[float], Any], name: str | None = None, breakpoints: Sequence[float] = ()
    ):  # fmt: skip
        self.frame = checks.name("FrameTrajectory: frame", frame)
        self.name = named(name, f"FrameTrajectory {frame}")
        self.pose = checks.function(f"{self.name}: pose", pose, "of time that returns a pin.SE3")
        self.breakpoints = checked_breakpoints(self.name, breakpoints)

    def sample(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """What is given at a time, as one vector."""
        given = called(self.name, self.pose, t)
        pose, *rates = given if isinstance(given, tuple) else (given,)
        if not isinstance(pose, pin.SE3):
            return np.zeros(0)  # is refused where it is used
        return np.concatenate([pose.homogeneous[:3].ravel(), *(np.asarray(x, dtype=float) for x in rates)])

    def check(self, scene: Declared) -> None:
        """The frame exists and can move."""
        if place_of(scene, self.frame)[0] == 0:
            raise SceneError(f"{self.name}: frame {self.frame!r} is fixed to the world and cannot follow a motion")


class JointTrajectory(GivenAngle):
    """A joint with one coordinate follows a given motion: 1 row.

    Args:
        joint: name of a revolute, prismatic, helical or continuous joint.
        angle: angle(t) -> coordinate [rad or m], or (q, v, a); a spline of scipy.interpolate serves too.
        name: by default made from the joint.
        breakpoints: times at which the motion jumps or has a kink, increasing [s]; knots of a spline are known.
    """

    def __init__(
        self, joint: str, angle: Callable[[float], Any], name: str | None = None, breakpoints: Sequence[float] = ()
    ):  # fmt: skip
        self.joint = checks.name("JointTrajectory: joint", joint)
        self.name = named(name, f"JointTrajectory {joint}")
        self.angle = checks.function(f"{self.name}: angle", angle, "of time that returns a number or (q, v, a)")
        self.breakpoints = checked_breakpoints(self.name, breakpoints)

    def check(self, scene: Declared) -> None:
        """The joint exists and has one coordinate."""
        model = scene.model
        if not model.existJointName(self.joint):
            raise UnknownName("joint", self.joint, list(model.names)[1:])
        nv = model.nvs[model.getJointId(self.joint)]
        if nv != 1:
            raise SceneError(f"{self.name}: the joint has {nv} degrees of freedom, not one; use FrameTrajectory")


class JointCoupling:
    """A joint follows another one, as by a gear: q = polynomial(q of the leader). 1 row.

    A continuous joint counts by the angle it has turned, which its q tells up to whole turns: as a leader it takes a
    linear polynomial, and where both are continuous the ratio is a fraction of small numbers, as teeth of wheels are.

    Args:
        joint: name of a joint with one coordinate, or factors by joint name: their sum follows.
        leader: likewise; several followers of one leader are several couplings. No joint, {}, holds the first one.
        coefficients: of the polynomial, the constant first, at most of the fourth order; (0, 2) is a gear of ratio 2.
        name: by default made from the joints.

    Attributes:
        period: what g is known up to, see `check`; inf without continuous joints.
    """

    def __init__(
        self,
        joint: str | Mapping[str, float],
        leader: str | Mapping[str, float],
        coefficients: Sequence[float],
        name: str | None = None,
    ):
        self.joint, self.leader = (joint_factors("JointCoupling: joint", j) for j in (joint, leader))
        self.name = named(name, f"JointCoupling {'+'.join(names_in(joint))}-{'+'.join(names_in(leader))}")
        given = checks.array(f"{self.name}: coefficients", coefficients, (None,))
        if not 1 <= len(given) <= 5:
            raise checks.fail(f"{self.name}: coefficients", coefficients, "one to five finite numbers")
        self.polynomial = np.polynomial.Polynomial(given)

    def check(self, scene: Declared) -> None:
        """All joints exist, are different, and have one coordinate; turns of continuous ones do not matter."""
        if set(names_in(self.joint)) & set(names_in(self.leader)):
            raise SceneError(f"{self.name}: a joint cannot follow itself")
        self.sums(scene.model)

    def sums(self, model: pin.Model) -> tuple[JointSum, JointSum]:
        """The coordinate that follows and the one that leads.

        Raises:
            SceneError: whole turns of the leader leave the follower undetermined.
        """
        follower, leader = (JointSum(self.name, joints, model) for joints in (self.joint, self.leader))
        self.period = follower.period
        if np.isinf(leader.period):
            return follower, leader
        if len(self.polynomial.trim().coef) > 2:
            raise SceneError(f"{self.name}: the leader is continuous, so that its polynomial must be linear")
        ratio = abs(float(self.polynomial.deriv()(0.0)))
        if np.isinf(follower.period):
            self.period = ratio * leader.period or np.inf
            return follower, leader
        fraction = Fraction(ratio * leader.period / follower.period).limit_denominator(MOST_TEETH)
        if abs(float(fraction) * follower.period - ratio * leader.period) > SAME_TURN * leader.period:
            raise SceneError(
                f"{self.name}: both joints are continuous, so that the ratio must be a fraction with a denominator "
                f"of at most {MOST_TEETH}, not {ratio:g}"
            )
        self.period = follower.period / fraction.denominator
        return follower, leader


class Rolling:
    """A body rolls on a surface without slip: 1 row of g and 2 of gamma.

    Args:
        body: name of the geometry that rolls.
        surface: name of the geometry it rolls on.
        name: by default made from the kind and the names.
    """

    def __init__(self, body: str, surface: str, name: str | None = None):
        self.body, self.surface = (checks.name(f"{type(self).__name__}: geometry", g) for g in (body, surface))
        self.name = named(name, f"{type(self).__name__} {body}/{surface}")

    def check(self, scene: Declared) -> None:
        """The geometries exist and are on two bodies; whether they fit is found when the scene is compiled."""
        if scene.geometry(self.body).parentJoint == scene.geometry(self.surface).parentJoint:
            raise SceneError(f"{self.name}: {self.body!r} and {self.surface!r} are on one and the same body")


class RollingSphere(Rolling):
    """A coal.Sphere rolls on a half-space, a sphere or a cylinder (from outside, or inside a `Hollow`)."""


class RollingDisc(Rolling):
    """The rim of a thin disc, a coal.Cylinder of whose height nothing is seen, rolls on a half-space or a sphere."""


def named(given: str | None, default: str) -> str:
    """The name that was given, or the default."""
    return default if given is None else checks.name("name of a constraint", given)


def place_of(scene: Declared, frame: str) -> tuple[int, pin.SE3]:
    """Joint of a frame and its pose there; the world is joint 0."""
    if checks.name("frame", frame) == WORLD and not scene.model.existFrame(WORLD):
        return 0, pin.SE3.Identity()
    found = scene.frame(frame)
    return int(found.parentJoint), found.placement


def basis_along(axis: Sequence[float], name: str) -> np.ndarray:
    """A rotation whose z-axis is the given one; for a coordinate axis it permutes the axes.

    Raises:
        SceneError: the axis is not a finite vector of length 3 other than zero.
    """
    z = checks.direction(f"{name}: axis", axis)
    i = (int(np.argmax(np.abs(z))) + 1) % 3
    x = np.eye(3)[i] - z[i] * z
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(z, x), z))
