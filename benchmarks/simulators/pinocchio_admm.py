"""A time-stepping loop over Pinocchio's own ADMM contact solver as a line of the report.

Semi-implicit Euler with the forces at the start of the step, damping at its end; impulses P with

    J v1 + b in the dual cone,  P in the cone,  v1 = v0 + dt M^-1 (tau - nle) + M^-1 J^T P

where b holds the gaps over dt, so that contacts and limits close at the end of a step. Pinocchio has no restitution:
here a closed contact with e_N > 0 gets Newton's law in b. It needs no other package.
"""

from __future__ import annotations

import time
from collections import Counter
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError
from ngalpha_pin.report.bounded import Deadline
from ngalpha_pin.report.lines import GIVEN_UP, Line, March, Start
from ngalpha_pin.scene.constraints import Constraint, PointJoint, RevoluteJoint, Weld
from ngalpha_pin.scene.contact import ContactLaw
from ngalpha_pin.scene.joints import JointLimit, joint_limits
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.system import System

from .tree import no_beams, touching

TOLERANCE = 1e-10  # of the solver, absolute [N s and m/s]
SWEEPS = 1000
ARM = 0.1  # between the two points that stand for a revolute joint [m]


def line() -> Line:
    """The line of the report."""
    note = (
        f"a loop over the ADMM contact solver of Pinocchio {pin.__version__}: semi-implicit Euler, rigid contact with "
        f"Coulomb's cone, tolerance {TOLERANCE:g}"
    )
    return Line("Pinocchio ADMM", march, note)


def march(start: Start) -> March:
    """Run the scene; only the loop over the steps is timed."""
    begin = time.perf_counter()
    loop = Loop(start.scene, start.dt)
    q, v = np.array(start.q0, dtype=float), np.array(start.v0, dtype=float)
    setup = time.perf_counter() - begin
    found, sweeps, rungs, message = [q], 0, Counter[str](), ""
    begin, deadline = time.perf_counter(), Deadline(start.limit)
    for i in range(start.n):
        q, v, done = loop.step(start.t0 + i * start.dt, q, v)
        if not np.isfinite(q).all():
            message = "the numbers are not finite any more"
            break
        found.append(q)
        sweeps += done.sweeps
        rungs[done.by] += 1
        if deadline.passed():
            message = f"{GIVEN_UP} after {start.limit:g} s of computing"
            break
    seconds = time.perf_counter() - begin
    return March(np.array(found), seconds, setup, sweeps / max(len(found) - 1, 1), dict(rungs), message, v=v)


class Done(NamedTuple):
    """How a step was solved: sweeps of the solver, and a word for it."""

    sweeps: int
    by: str


class Rows(NamedTuple):
    """One constraint model, the velocity b that belongs to its rows [m/s or rad/s], and restitution of the normal."""

    model: Any
    b: np.ndarray
    e_N: float = 0.0


class Loop:
    """The scene in the words of Pinocchio.

    Args:
        scene: what is run.
        dt: step [s].

    Raises:
        SceneError: something in it has no counterpart.
    """

    def __init__(self, scene: Scene, dt: float):
        no_beams(scene)
        touching(scene)
        if any(pair.law.contact_radius or pair.law.e_F for pair in scene.contacts):
            raise SceneError("Pinocchio's cone has neither drilling friction nor tangential restitution")
        self.dt, self.model, self.geometries = dt, scene.model, scene.collision_model
        self.data, self.placed = self.model.createData(), pin.GeometryData(self.geometries)
        self.system = System(scene)  # for the forces alone
        index = self.geometries.getGeometryId
        self.pairs = [(index(pair.geometry_a), index(pair.geometry_b), pair.law) for pair in scene.contacts]
        for geometry in self.geometries.geometryObjects:
            geometry.geometry.computeLocalAABB()
        self.anchors = [anchor for constraint in scene.constraints for anchor in anchors_of(scene, constraint)]
        self.limits = joint_limits(self.model, scene.joints)
        self.friction = self._dry_friction(scene)
        self.settings, self.impulses = pin.ADMMSolverSettings(), np.zeros(0)
        self.settings.absolute_feasibility_tol = self.settings.absolute_complementarity_tol = TOLERANCE
        self.settings.relative_feasibility_tol = self.settings.relative_complementarity_tol = TOLERANCE
        self.settings.max_iterations = SWEEPS

    def step(self, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, Done]:
        """One step from (q, v) at t."""
        model, data, dt = self.model, self.data, self.dt
        force = -pin.nonLinearEffects(model, data, q, v)
        M = pin.crba(model, data, q, pin.Convention.LOCAL)
        loads = self.system.loads(t, q, v)
        if loads is not None:
            tau, _, D = loads
            force, M = force + tau, M - dt * D  # damping is implicit, or that of a robot would be unstable
        pin.computeJointJacobians(model, data, q)
        free = v + dt * np.linalg.solve(M, force)
        rows = self._rows(q, v, free)
        done = Done(0, "free")
        if rows:
            free, done = self._with_impulses(M, v, free, rows)
        return pin.integrate(model, q, dt * free), free, done

    def _with_impulses(
        self, M: np.ndarray, v: np.ndarray, free: np.ndarray, rows: list[Rows]
    ) -> tuple[np.ndarray, Done]:
        """Velocity at the end of the step."""
        models, datas, jacobians, b = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData(), [], []
        for row in rows:
            constraint = pin.ConstraintModel(row.model)
            values = constraint.createData()
            constraint.calc(self.model, self.data, values)
            J = np.atleast_2d(constraint.jacobian(self.model, self.data, values))  # one row comes as a vector
            bounce = np.zeros(len(J))
            if row.e_N:
                bounce[2] = row.e_N * min(J[2] @ v, 0.0)
            models.append(constraint)
            datas.append(values)
            jacobians.append(J)
            b.append(row.b + bounce)
        J = np.vstack(jacobians)
        by_M = np.linalg.solve(M, J.T)
        # the solver changes the damping of the operator it is given, so that every step needs a new one
        delassus, result = pin.DelassusOperatorDense(J @ by_M), pin.ADMMSolverResult()
        if len(self.impulses) == len(J):
            result.setConstraintImpulseGuess(self.impulses)
        solver = pin.ADMMConstraintSolver()
        solved = solver.solve(delassus, J @ free + np.concatenate(b), models, datas, self.settings, result)
        self.impulses = np.array(result.retrieveConstraintImpulses())
        done = Done(result.iterations, "ADMM" if solved else "ADMM, tolerance missed")
        return free + by_M @ self.impulses, done

    def _rows(self, q: np.ndarray, v: np.ndarray, free: np.ndarray) -> list[Rows]:
        """Constraints, contacts and limits that can close within the step, dry friction."""
        found = [self._closed(anchor) for anchor in self.anchors]
        found += self._contacts(q, v) if self.pairs else []
        for limit in self.limits:
            gap = limit.sign * (q[limit.q] - limit.value)
            if gap + self.dt * limit.sign * free[limit.dof] <= 0.0:
                found.append(self._limit(limit, gap, v))
        return found + ([Rows(self.friction, np.zeros(self.friction.residualSize()))] if self.friction else [])

    def _closed(self, anchor: Any) -> Rows:
        """A loop, whose error is gone at the end of the step."""
        constraint = pin.ConstraintModel(anchor)
        values = constraint.createData()
        constraint.calc(self.model, self.data, values)
        error = anchor.createData()
        anchor.calc(self.model, self.data, error)
        return Rows(anchor, np.array(error.constraint_position_error) / self.dt)

    def _limit(self, limit: JointLimit, gap: float, v: np.ndarray) -> Rows:
        """One bound of one coordinate; Pinocchio takes those of the whole configuration, the others infinite."""
        one = pin.StdVec_Index()
        one.append(limit.joint)
        lower, upper = np.full(self.model.nq, -np.inf), np.full(self.model.nq, np.inf)
        (lower if limit.sign > 0 else upper)[limit.q] = limit.value
        b = gap / self.dt
        if limit.e_N and gap <= 0.0:
            b = limit.e_N * min(limit.sign * v[limit.dof], 0.0)
        return Rows(pin.JointLimitConstraintModel(self.model, one, lower, upper), np.array([b]))

    def _contacts(self, q: np.ndarray, v: np.ndarray) -> list[Rows]:
        """Points of contact of the pairs that can touch within the step."""
        pin.updateGeometryPlacements(self.model, self.data, self.geometries, self.placed, q)
        pin.forwardKinematics(self.model, self.data, q, v)
        found = []
        for a, b, law in self.pairs:
            reach = self.dt * (self._speed(a) + self._speed(b) + self.dt * np.linalg.norm(self.model.gravity.linear))
            if self._apart(a, b) > reach:
                continue
            for point, normal, gap in contact_points(self.geometries, self.placed, a, b, reach):
                # a contact that bounces acts once it is closed, else Newton's law would see a braked velocity
                if law.e_N == 0.0 or gap <= 0.0:
                    found.append(self._contact(a, b, law, point, normal, gap))
        return found

    def _apart(self, a: int, b: int) -> float:
        """Lower bound of the gap of two geometries, from the spheres around them [m]."""
        (shape_a, pose_a), (shape_b, pose_b) = (
            (self.geometries.geometryObjects[i].geometry, self.placed.oMg[i]) for i in (a, b)
        )
        if isinstance(shape_b, coal.Halfspace):
            shape_a, pose_a, shape_b, pose_b = shape_b, pose_b, shape_a, pose_a
        centre = pose_b.act(shape_b.aabb_center)
        if isinstance(shape_a, coal.Halfspace):
            return float(shape_a.n @ pose_a.actInv(centre) - shape_a.d - shape_b.aabb_radius)
        return float(
            np.linalg.norm(centre - pose_a.act(shape_a.aabb_center)) - shape_a.aabb_radius - shape_b.aabb_radius
        )

    def _contact(self, a: int, b: int, law: ContactLaw, point: np.ndarray, normal: np.ndarray, gap: float) -> Rows:
        """Point of contact, seen from b, with the normal towards a as its z-axis."""
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), -normal).matrix()
        pose, joints = pin.SE3(turn, point), [self.geometries.geometryObjects[i].parentJoint for i in (b, a)]
        places = [self.data.oMi[j].actInv(pose) for j in joints]
        model = pin.PointContactConstraintModel(self.model, joints[0], places[0], joints[1], places[1])
        model.setFriction(law.mu)
        return Rows(model, np.array([0.0, 0.0, 0.0 if law.e_N else gap / self.dt]), law.e_N)

    def _speed(self, i: int) -> float:
        """Bound of the speed of the points of a geometry [m/s]."""
        geometry = self.geometries.geometryObjects[i]
        j = geometry.parentJoint
        if j == 0:
            return 0.0
        centre, velocity = geometry.placement.act(geometry.geometry.aabb_center), self.data.v[j]
        at_centre = velocity.linear + np.cross(velocity.angular, centre)
        return float(np.linalg.norm(at_centre) + geometry.geometry.aabb_radius * np.linalg.norm(velocity.angular))

    def _dry_friction(self, scene: Scene) -> Any:
        model = self.model
        lower, upper = np.array(model.lowerDryFrictionLimit), np.array(model.upperDryFrictionLimit)
        joints = [j for j in range(1, model.njoints) if (upper > lower)[model.idx_vs[j] :][: model.nvs[j]].any()]
        if not joints or not scene.joints.friction:
            return None
        chosen = pin.StdVec_Index()
        chosen.extend(joints)
        friction = pin.JointFrictionConstraintModel(model, chosen, lower, upper)
        friction.setTimeStep(self.dt)
        return friction


def anchors_of(scene: Scene, constraint: Constraint) -> list[Any]:
    """Constraint models of Pinocchio that do what the constraint does.

    Raises:
        SceneError: there are none.
    """
    if not isinstance(constraint, (PointJoint, RevoluteJoint, Weld)):
        raise SceneError(f"Pinocchio has no counterpart of {type(constraint).__name__} {constraint.name!r}")
    (joint_a, pose_a), (joint_b, pose_b) = constraint.poses(scene)
    if isinstance(constraint, Weld):
        return [pin.FrameAnchorConstraintModel(scene.model, joint_a, pose_a, joint_b, pose_b)]
    # Pinocchio closes loops with three or six rows, not with the five of a hinge: two points of its axis, one of the
    # six rows dependent
    places = [0.0] if isinstance(constraint, PointJoint) else [-ARM / 2, ARM / 2]
    shifts = [pin.SE3(np.eye(3), np.array([0.0, 0.0, z])) for z in places]
    return [
        pin.PointAnchorConstraintModel(scene.model, joint_a, pose_a * shift, joint_b, pose_b * shift)
        for shift in shifts
    ]


def contact_points(
    geometries: pin.GeometryModel, placed: pin.GeometryData, a: int, b: int, reach: float
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Contact patch of two shapes that are nearer than `reach`: point, normal from a to b, gap [m] of each corner."""
    shapes = [geometries.geometryObjects[i].geometry for i in (a, b)]
    poses = [coal.Transform3s(placed.oMg[i].rotation, placed.oMg[i].translation) for i in (a, b)]
    request, result = coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, 1), coal.CollisionResult()
    request.security_margin, request.gjk_tolerance, request.epa_tolerance = reach, 1e-10, 1e-10
    coal.collide(shapes[0], poses[0], shapes[1], poses[1], request, result)
    if not result.numContacts():
        return []
    patches = coal.ContactPatchResult()
    coal.computeContactPatch(shapes[0], poses[0], shapes[1], poses[1], result, coal.ContactPatchRequest(), patches)
    if not patches.numContactPatches():
        return []
    patch = patches.getContactPatch(0)
    normal = np.asarray(patch.getNormal())
    return [
        (
            np.asarray(patch.getPoint(i)),
            normal,
            float(normal @ (np.asarray(patch.getPointShape2(i)) - np.asarray(patch.getPointShape1(i)))),
        )
        for i in range(patch.size())
    ]
