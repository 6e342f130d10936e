"""Drake as a line of the report: the scene as a discrete MultibodyPlant, q and v read back in Pinocchio's coordinates.

Contact is Drake's point contact with its default stiffness and the SAP solver. A shape with faces touches a plane in a
single point there, so that its corners take part as small spheres. It has no coefficient of restitution, no shape that
is touched from inside, and no dry friction of joints.
"""

from __future__ import annotations

import logging
import time
from importlib import metadata
from itertools import product
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from pydrake.geometry import (
    AddContactMaterial,
    Box,
    Capsule,
    CollisionFilterDeclaration,
    Convex,
    Cylinder,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PrismaticJoint,
    PrismaticSpring,
    RevoluteJoint,
    RevoluteSpring,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from ngalpha_pin.errors import SceneError
from ngalpha_pin.report.lines import Line, March, Start
from ngalpha_pin.scene.joint_pd import JointPD
from ngalpha_pin.scene.joints import joint_limits
from ngalpha_pin.scene.meshes import hull_of_mesh
from ngalpha_pin.scene.scene import Scene

from .tree import joint_axis, joint_kind, no_beams, touching, wxyz

logging.getLogger("drake").setLevel(logging.ERROR)  # it warns of half-spaces, which do all that is wanted here
CORNER = 1e-4  # radius of the spheres that stand for corners [m]


def line() -> Line:
    """The line of the report."""
    version = metadata.version("drake")
    return Line("Drake", march, f"Drake {version}: discrete plant, SAP, point contact with default stiffness")


def march(start: Start) -> March:
    """Run the scene; only the loop over the steps is timed, without reading the positions."""
    begin = time.perf_counter()
    world = World(start.scene, start.dt)
    world.put(start.q0, start.v0)
    setup = time.perf_counter() - begin
    q, seconds, message = [np.array(start.q0, dtype=float)], 0.0, ""
    v = np.array(start.v0, dtype=float)
    for i in range(start.n):
        begin = time.perf_counter()
        try:
            world.simulator.AdvanceTo((i + 1) * start.dt)
        except RuntimeError as error:
            message = f"its solver gave up: {' '.join(str(error).split())}"
            break
        seconds += time.perf_counter() - begin
        now, v = world.state()
        if not np.isfinite(now).all():
            message = "the numbers are not finite any more"
            break
        q.append(now)
    return March(np.array(q), seconds, setup, message=message, v=v)


class World:
    """The scene in Drake.

    Args:
        scene: what is run.
        dt: step [s].

    Raises:
        SceneError: something in the scene has no counterpart.
    """

    def __init__(self, scene: Scene, dt: float):
        self.scene, self.model = scene, scene.model
        self.kinds = [""] + [joint_kind(self.model, j) for j in range(1, self.model.njoints)]
        self._check()
        builder = DiagramBuilder()
        self.plant, self.graph = AddMultibodyPlantSceneGraph(builder, time_step=dt)
        self.plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        self.plant.mutable_gravity_field().set_gravity_vector(np.array(self.model.gravity.linear))
        self.bodies: list[Any] = [self.plant.world_body()]
        self.joints: list[list[Any]] = [[]]
        limits = {(x.joint, x.sign): x.value for x in joint_limits(self.model, scene.joints)}
        for j in range(1, self.model.njoints):
            self._add_body(j, limits)
        self._add_springs()
        shapes = self._add_shapes()
        self.plant.Finalize()
        self._only_pairs(shapes)
        diagram = builder.Build()
        self.simulator = Simulator(diagram)
        self.context = self.plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())

    def put(self, q: np.ndarray, v: np.ndarray) -> None:
        """Set the state."""
        positions, velocities = self.plant.GetPositions(self.context), self.plant.GetVelocities(self.context)
        for j, kind in enumerate(self.kinds[1:], start=1):
            own_q = q[self.model.idx_qs[j] :][: self.model.nqs[j]]
            own_v = v[self.model.idx_vs[j] :][: self.model.nvs[j]]
            if kind == "free":
                pose = self.model.jointPlacements[j] * pin.XYZQUATToSE3(own_q)
                quaternion, R = wxyz(pin.SE3ToXYZQUAT(pose)[3:]), pose.rotation
                i, k = self._places(j)
                positions[i : i + 7] = *quaternion, *pose.translation
                velocities[k : k + 6] = *(R @ own_v[3:]), *(R @ own_v[:3])
                continue
            values = [float(np.arctan2(own_q[1], own_q[0]))] if kind == "angle" else own_q
            for joint, x, x_dot in zip(self.joints[j], values, own_v, strict=True):
                positions[joint.position_start()], velocities[joint.velocity_start()] = x, x_dot
        self.plant.SetPositions(self.context, positions)
        self.plant.SetVelocities(self.context, velocities)
        self.simulator.Initialize()

    def _places(self, j: int) -> tuple[int, int]:
        """Where the coordinates of a body that moves freely begin."""
        body = self.bodies[j]
        return int(body.floating_positions_start()), int(body.floating_velocities_start_in_v())

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """The q and v of now."""
        q, v = np.empty(self.model.nq), np.empty(self.model.nv)
        positions, velocities = self.plant.GetPositions(self.context), self.plant.GetVelocities(self.context)
        for j, kind in enumerate(self.kinds[1:], start=1):
            if kind == "free":
                i, k = self._places(j)
                turn = pin.Quaternion(*positions[i : i + 4]).normalized()
                own = self.model.jointPlacements[j].inverse() * pin.SE3(turn.matrix(), positions[i + 4 : i + 7])
                q_j, R = pin.SE3ToXYZQUAT(own), turn.matrix()
                v_j = np.concatenate((R.T @ velocities[k + 3 : k + 6], R.T @ velocities[k : k + 3]))
            else:
                q_j = np.array([positions[joint.position_start()] for joint in self.joints[j]])
                v_j = np.array([velocities[joint.velocity_start()] for joint in self.joints[j]])
                q_j = np.array([np.cos(q_j[0]), np.sin(q_j[0])]) if kind == "angle" else q_j
            q[self.model.idx_qs[j] :][: self.model.nqs[j]] = q_j
            v[self.model.idx_vs[j] :][: self.model.nvs[j]] = v_j
        return q, v

    def _check(self) -> None:
        scene, model = self.scene, self.model
        no_beams(scene)
        touching(scene)
        if scene.constraints:
            raise SceneError("constraints are not carried over")
        if any(pair.law.contact_radius or pair.law.e_N or pair.law.e_F for pair in scene.contacts):
            raise SceneError("it has neither coefficients of restitution nor Coulomb-Contensou friction")
        if "ball" in self.kinds:
            raise SceneError("a joint that turns freely is not carried over")
        if scene.joints.friction and np.any(model.upperDryFrictionLimit):
            raise SceneError("dry friction of joints is not carried over")
        if np.any(model.armature):
            raise SceneError("armature is not carried over")
        if any(kind == "free" and model.parents[j] for j, kind in enumerate(self.kinds)):
            raise SceneError("only the root can be a free flyer")

    def _add_body(self, j: int, limits: dict[tuple[int, float], float]) -> None:
        model, kind = self.model, self.kinds[j]
        body = self.plant.AddRigidBody(f"body_{j}", _inertia(model.inertias[j]))
        self.bodies.append(body)
        self.joints.append([])
        if kind == "free":
            return
        parent = self.bodies[model.parents[j]].body_frame()
        frame = self.plant.AddFrame(FixedOffsetFrame(f"at_{j}", parent, _pose(model.jointPlacements[j])))
        axes = np.eye(3) if kind == "translation" else [joint_axis(model, j)]
        for n, axis in enumerate(axes):
            last = n == len(axes) - 1
            child = body if last else self.plant.AddRigidBody(f"carrier_{j}_{n}", SpatialInertia.Zero())
            options = {"damping": float(model.damping[model.idx_vs[j] + n])}
            if (j, 1.0) in limits or (j, -1.0) in limits:
                options["pos_lower_limit"] = limits.get((j, 1.0), -np.inf)
                options["pos_upper_limit"] = limits.get((j, -1.0), np.inf)
            make = PrismaticJoint if kind in ("slide", "translation") else RevoluteJoint
            joint = make(f"joint_{j}_{n}", frame, child.body_frame(), np.asarray(axis), **options)
            self.joints[j].append(self.plant.AddJoint(joint))
            frame = child.body_frame()

    def _add_springs(self) -> None:
        """PD laws: springs, and dampers that the solver takes implicitly."""
        for force in self.scene.forces:
            if not isinstance(force, JointPD) or force.energy is None:
                raise SceneError(f"the force {type(force).__name__} is not carried over")
            for j, joints in enumerate(self.joints):
                for n, joint in enumerate(joints):
                    k = self.model.idx_vs[j] + n
                    joint.set_default_damping(joint.default_damping() + float(force.kd[k]))
                    if not force.kp[k]:
                        continue
                    if self.kinds[j] == "angle":
                        raise SceneError("springs of continuous joints are not carried over")
                    rest = float(force.q_ref[self.model.idx_qs[j] + n])
                    spring = PrismaticSpring if isinstance(joint, PrismaticJoint) else RevoluteSpring
                    self.plant.AddForceElement(spring(joint, rest, float(force.kp[k])))

    def _add_shapes(self) -> dict[str, list[Any]]:
        """The geometries of the contacts, and what stands for each."""
        scene, mu = self.scene, self._friction()
        planes = {name for name in mu if isinstance(scene.geometry(name).geometry, coal.Halfspace)}
        meets = {
            name: {other for pair in scene.contacts if name in pair.key for other in pair.key - {name}} for name in mu
        }
        found = {}
        for name, friction in mu.items():
            geometry, properties = scene.geometry(name), ProximityProperties()
            AddContactMaterial(friction=CoulombFriction(friction, friction), properties=properties)
            body = self.bodies[int(geometry.parentJoint)]
            found[name] = [
                self.plant.RegisterCollisionGeometry(
                    body, _pose(geometry.placement * at), shape, f"{name}_{i}", properties
                )
                for i, (at, shape) in enumerate(_shapes(geometry, meets[name] <= planes))
            ]
        return found

    def _friction(self) -> dict[str, float]:
        """Coefficients of the geometries, of which it takes the harmonic mean.

        Raises:
            SceneError: those of the pairs are no such means.
        """
        names, laws = touching(self.scene), self.scene.contacts
        if len({pair.law.mu for pair in laws}) == 1:
            return dict.fromkeys(names, laws[0].law.mu)
        incidence = np.array([[float(name in pair.key) for name in names] for pair in laws]).reshape(
            len(laws), len(names)
        )
        wanted = np.array([2.0 / max(pair.law.mu, 1e-9) for pair in laws])
        of = np.linalg.lstsq(incidence, wanted, rcond=None)[0] if laws else np.zeros(0)
        if np.abs(incidence @ of - wanted).max(initial=0.0) > 1e-9 * wanted.max(initial=1.0) or (of <= 0.0).any():
            raise SceneError("it takes the harmonic mean of two coefficients, and those of the pairs are no such means")
        return dict(zip(names, 1.0 / of, strict=True))

    def _only_pairs(self, shapes: dict[str, list[Any]]) -> None:
        """Only the pairs of the scene touch each other."""
        filters = self.graph.collision_filter_manager()
        every = [shape for group in shapes.values() for shape in group]
        filters.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(every)))
        for pair in self.scene.contacts:
            a, b = (GeometrySet(shapes[name]) for name in (pair.geometry_a, pair.geometry_b))
            filters.Apply(CollisionFilterDeclaration().AllowBetween(a, b))


def _pose(pose: pin.SE3) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(pose.rotation), pose.translation)


def _inertia(inertia: pin.Inertia) -> SpatialInertia:
    if inertia.mass <= 0:
        return SpatialInertia.Zero()
    J = np.asarray(inertia.inertia)
    central = RotationalInertia(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    return SpatialInertia.MakeFromCentralInertia(inertia.mass, np.asarray(inertia.lever), central)


def _shapes(geometry: pin.GeometryObject, on_planes: bool) -> list[tuple[pin.SE3, Any]]:
    """What stands for a geometry, each with its place there.

    Args:
        geometry: of a contact.
        on_planes: it touches nothing but half-spaces.

    Raises:
        SceneError: it has no counterpart.
    """
    shape, here = geometry.geometry, pin.SE3.Identity()
    if isinstance(shape, coal.Halfspace):
        normal = np.asarray(shape.n)
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
        return [(pin.SE3(turn, normal * shape.d), HalfSpace())]
    if isinstance(shape, coal.Sphere):
        return [(here, Sphere(max(float(shape.radius), CORNER)))]
    if isinstance(shape, coal.Capsule):
        return [(here, Capsule(shape.radius, 2 * shape.halfLength))]
    if isinstance(shape, coal.Cylinder):
        return [(here, Cylinder(shape.radius, 2 * shape.halfLength))]
    if isinstance(shape, coal.BVHModelBase):  # its hull, as here
        shape = hull_of_mesh(shape, geometry.name)
    if isinstance(shape, coal.Box):
        half = np.asarray(shape.halfSide)
        corners = np.array(list(product((-1.0, 1.0), repeat=3))) * (half - CORNER)
        whole: Any = Box(*(2 * half))
    elif isinstance(shape, coal.ConvexBase):
        points = np.asarray(shape.points())
        corners = points - CORNER * np.sign(points - points.mean(axis=0))
        whole = Convex(points=points.T, label=geometry.name)
    else:
        raise SceneError(f"the shape {type(shape).__name__} of {geometry.name!r} is not carried over")
    return [(pin.SE3(np.eye(3), x), Sphere(CORNER)) for x in corners] if on_planes else [(here, whole)]
