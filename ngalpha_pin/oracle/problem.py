"""What the oracle reads of a scene: coordinates, mass matrix, forces, and where contacts and constraints sit.

All that is imported from the rest of the package is imported here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import NotConverged, SceneError
from ngalpha_pin.flexible import PlanarBeam
from ngalpha_pin.scene.constraints import DrivenAngle, FrameConstraint, JointTrajectory, PointJoint
from ngalpha_pin.scene.scene import Scene

__all__ = ["Contact", "Law", "NotConverged", "Place", "Problem", "Scene", "SceneError", "compile_scene"]

NO_LIMIT = 1e300


@dataclass(frozen=True)
class Place:
    """A frame fixed in a body of the tree, or in a cross section of a beam.

    Attributes:
        joint: of the body, 0 for the world; not used on a beam.
        pose: in the frame of that joint, or in that of the cross section.
        beam: name of the beam, or None.
        N, dN: the centreline there is r_OC = N q_b and its derivative by xi is r'_OC = dN q_b, in the plane of the
            beam, shape (2, nv) each.
    """

    joint: int
    pose: pin.SE3
    beam: str | None = None
    N: np.ndarray | None = None
    dN: np.ndarray | None = None


@dataclass(frozen=True)
class Law:
    """Coefficients of one contact (44), (48), (49), (157).

    Attributes:
        mu, e_N, e_F: friction and restitution coefficients [-].
        drilling: 3 pi R / 16 of the contact radius R (157) [m]; zero without drilling friction.
    """

    mu: float
    e_N: float
    e_F: float
    drilling: float


@dataclass(frozen=True)
class Contact:
    """A sphere (a point where its radius is zero) against a surface that stands still.

    Attributes:
        name: of the pair of geometries.
        centre: where the centre of the sphere is fixed.
        radius: of the sphere [m].
        origin: a point of the plane, or of the axis of the hollow cylinder, shape (3,) [m].
        normal: of the plane, out of its material, shape (3,); None for a cylinder.
        axis: of the cylinder, shape (3,); None for a plane.
        surface_radius: of the cylinder [m].
        law: coefficients.
        rows: which of the friction velocities (first and second tangent, drilling) can be other than zero.
    """

    name: str
    centre: Place
    radius: float
    origin: np.ndarray
    normal: np.ndarray | None
    axis: np.ndarray | None
    surface_radius: float
    law: Law
    rows: tuple[int, ...] = ()


@dataclass(frozen=True)
class Joined:
    """Points (origins of two frames) that stay together, the first two rows of (153)."""

    a: Place
    b: Place


@dataclass(frozen=True)
class Turned:
    """The angle from frame a to frame b about their z-axes is a function of time, the last row of (153)."""

    a: Place
    b: Place
    angle: Callable[[float], Any]


@dataclass(frozen=True)
class Driven:
    """A joint with one coordinate that is a function of time.

    Attributes:
        q, dof: place of the coordinate in q and in v.
        turns: q holds its cosine and sine.
        angle: of t -> coordinate, its first and its second derivative.
    """

    q: int
    dof: int
    turns: bool
    angle: Callable[[float], Any]


@dataclass(frozen=True, eq=False)
class Beam:
    """A beam among the coordinates of a problem.

    Attributes:
        beam: its declaration.
        q, v: its places in q and in v.
        M: its mass matrix, shape (n, n).
        weight: force of gravity, shape (n,).
    """

    beam: PlanarBeam
    q: slice
    v: slice
    M: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True, eq=False)
class Problem:
    """A scene as the equations of the paper see it.

    Attributes:
        scene: with its `pin.Model`.
        nq, nv: number of coordinates and of velocities.
        beams: by name; their coordinates follow those of the tree.
        contacts: in the order of declaration.
        constraints: bilateral constraints g(t, q) = 0.
        rows: which rows of g some motion changes.
    """

    scene: Scene
    nq: int
    nv: int
    beams: dict[str, Beam]
    contacts: tuple[Contact, ...]
    constraints: tuple[Joined | Turned | Driven, ...]
    rows: tuple[int, ...] = ()

    @property
    def n_N(self) -> int:
        """Number of contacts."""
        return len(self.contacts)

    @property
    def friction(self) -> tuple[slice, ...]:
        """Of every contact, its entries in vectors such as la_F."""
        ends = np.cumsum([0, *(len(contact.rows) for contact in self.contacts)])
        return tuple(slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True))

    @property
    def n_F(self) -> int:
        """Number of friction velocities of all contacts."""
        return sum(len(contact.rows) for contact in self.contacts)

    def moved(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """The configuration after the tangent step dq, which replaces the sum in (125), shape (nq,)."""
        model = self.scene.model
        tree = pin.integrate(model, q[: model.nq], dq[: model.nv])
        return np.concatenate((tree, q[model.nq :] + dq[model.nv :]))


def compile_scene(scene: Scene) -> Problem:
    """The problem of a scene that has only what the systems of the paper have.

    Raises:
        SceneError: it has something else, which the message names.
    """
    _refuse_the_rest(scene)
    beams = {}
    for name, beam in scene.beams.items():
        at, gravity = scene.slices[beam], beam.plane.rotation[:, :2].T @ scene.model.gravity.linear
        beams[name] = Beam(beam, at.q, at.v, beam.M @ np.eye(beam.nv), np.outer(beam.node_mass, gravity).ravel())
    n = sum(beam.nv for beam in scene.beams.values())
    contacts = tuple(_contact(scene, pair) for pair in scene.contacts)
    constraints = tuple(_constraint(scene, constraint) for constraint in scene.constraints)
    return Problem(scene, scene.model.nq + n, scene.model.nv + n, beams, contacts, constraints)


def _refuse_the_rest(scene: Scene) -> None:
    model, joints = scene.model, scene.joints
    has: dict[str, Any] = {
        "forces": scene.forces,
        "loads on beams": scene.loads,
        "states": scene.states + scene.unilaterals,
    }
    has["coefficients that depend on the slip"] = [pair for pair in scene.contacts if pair.law.curve is not None]
    has["restitution but Newton's with a number"] = [p for p in scene.contacts if p.law.restitution is not None]
    has["compliant contacts"] = [pair for pair in scene.contacts if pair.law.compliance is not None]
    has["friction ellipses"] = [pair for pair in scene.contacts if pair.law.ellipse is not None]
    has["rolling resistance"] = [pair for pair in scene.contacts if pair.law.rolling_resistance > 0.0]
    has["adhesion"] = [pair for pair in scene.contacts if pair.law.adhesion > 0.0]
    has["surfaces that move"] = [pair for pair in scene.contacts if pair.law.surface_velocity is not None]
    if joints.friction:
        has["dry friction in joints"] = np.any(model.upperDryFrictionLimit) or np.any(model.lowerDryFrictionLimit)
    if joints.limits:
        single = [i for i, n in zip(model.idx_qs, model.nqs, strict=True) if n == 1]
        lower, upper = (np.array(x)[single] for x in (model.lowerPositionLimit, model.upperPositionLimit))
        has["joint limits"] = np.any((lower < upper) & ((lower > -NO_LIMIT) | (upper < NO_LIMIT)))
    found = [name for name, value in has.items() if value]
    if found:
        raise SceneError(f"the oracle knows no {found[0]}; it runs the six systems of the paper, use simulate instead")


def _place(scene: Scene, frame: str, pose: pin.SE3) -> Place:
    for point in scene.beam_points:
        if point.name == frame:
            beam, xi = scene.beams[point.beam], np.array([point.xi])
            N, dN = (np.stack([beam.centreline(e, xi, k)[0] for e in np.eye(beam.nv)], axis=1) for k in (0, 1))
            return Place(0, pose, point.beam, N, dN)
    found = scene.frame(frame)
    return Place(int(found.parentJoint), found.placement * pose)


def _contact(scene: Scene, pair: Any) -> Contact:
    """One pair of geometries, a sphere and a surface of the world."""
    sides = [scene.geometry(name) for name in (pair.geometry_a, pair.geometry_b)]
    name, law = f"{pair.geometry_a}/{pair.geometry_b}", pair.law
    for body, surface in (sides, sides[::-1]):
        hollow = surface.name in scene.hollow
        plane = isinstance(surface.geometry, coal.Halfspace)
        if not isinstance(body.geometry, coal.Sphere) or body.name in scene.hollow or surface.parentJoint != 0:
            continue
        if not plane and not (hollow and isinstance(surface.geometry, coal.Cylinder)):
            continue
        on_beam = body.name in {point.name for point in scene.beam_points}
        centre = (
            _place(scene, body.name, pin.SE3.Identity())
            if on_beam
            else Place(int(body.parentJoint), pin.SE3(np.eye(3), body.placement.translation))
        )
        laws = Law(law.coefficient, law.e_N, law.e_F, 3.0 * np.pi / 16.0 * law.contact_radius)  # (157)
        R, origin, radius = (
            surface.placement.rotation,
            surface.placement.translation.copy(),
            float(body.geometry.radius),
        )
        if plane:
            normal = R @ np.array(surface.geometry.n)
            return Contact(name, centre, radius, origin + surface.geometry.d * normal, normal, None, 0.0, laws)
        return Contact(name, centre, radius, origin, None, R[:, 2].copy(), float(surface.geometry.radius), laws)
    raise SceneError(
        f"the oracle knows no contact such as {name!r}: only spheres and points on planes and inside hollow cylinders "
        "that stand still; use simulate instead"
    )


def _constraint(scene: Scene, constraint: Any) -> Joined | Turned | Driven:
    model = scene.model
    if isinstance(constraint, JointTrajectory):
        j = model.getJointId(constraint.joint)
        _three_numbers(constraint.name, constraint.angle)
        return Driven(model.idx_qs[j], model.idx_vs[j], model.nqs[j] == 2, constraint.angle)
    if isinstance(constraint, FrameConstraint):
        frames = zip((constraint.frame_a, constraint.frame_b), constraint.placements, strict=True)
        a, b = (_place(scene, frame, pose * constraint.basis) for frame, pose in frames)
        if isinstance(constraint, DrivenAngle):
            _three_numbers(constraint.name, constraint.angle)
            return Turned(a, b, constraint.angle)
        if type(constraint) is PointJoint:
            return Joined(a, b)
    raise SceneError(f"the oracle knows no constraint such as {constraint.name!r}; use simulate instead")


def _three_numbers(name: str, angle: Callable[[float], Any]) -> None:
    if np.shape(angle(0.0)) != (3,):
        raise SceneError(f"{name}: the oracle needs the angle with its first and second derivative")
