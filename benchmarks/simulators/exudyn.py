"""Exudyn as a line of the report: a kinematic tree, or one free body, with penalty contact of spheres.

Exudyn has no rigid contact. The penalty stiffness follows the step: the mass on it swings once in `PERIOD` steps, which
its implicit integrator (generalized-alpha, its default spectral radius) resolves; a smaller step then makes the contact
harder. The damping is that with which a linear spring and damper that do not pull give back e_N.
"""

from __future__ import annotations

import time
from typing import Any

import coal
import exudyn
import numpy as np
import pinocchio as pin
from exudyn import itemInterface
from scipy.optimize import brentq

from ngalpha_pin.errors import SceneError
from ngalpha_pin.report.lines import Line, March, Start
from ngalpha_pin.scene.constraints import PointJoint, RevoluteJoint, Weld
from ngalpha_pin.scene.contact import ContactPair
from ngalpha_pin.scene.joints import joint_limits

from .tree import joint_axis, joint_kind, no_beams, touching, wxyz

PERIOD = 20  # steps of dt in a period of the mass on the contact spring [-]
ZONE = 1e-3  # speed below which friction is linear in it [m/s]
LEAST = 0.02  # restitution that stands for none, of more than three times the critical damping [-]
FIELD = 1e3  # edge of the triangles that stand for a plane [m]
ROWS = {PointJoint: [1, 1, 1, 0, 0, 0], RevoluteJoint: [1, 1, 1, 1, 1, 0], Weld: [1, 1, 1, 1, 1, 1]}


def line() -> Line:
    """The line of the report."""
    note = (
        f"Exudyn {exudyn.__version__}: generalized-alpha, penalty contact with a period of {PERIOD} steps, friction "
        f"linear below {ZONE:g} m/s"
    )
    return Line("Exudyn", march, note)


def march(start: Start) -> March:
    """Run the scene; its solver is timed with its own start and with what it records."""
    begin = time.perf_counter()
    world = World(start)
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.startTime = 0.0
    settings.timeIntegration.endTime = start.n * start.dt
    settings.timeIntegration.numberOfSteps = start.n
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = start.dt
    settings.linearSolver.solverType = exudyn.LinearSolverType.EigenDense
    settings.linearSolver.ignoreSingularJacobian = True  # loops in a plane have dependent rows
    setup = time.perf_counter() - begin
    begin, message = time.perf_counter(), ""
    try:
        if not world.mbs.SolveDynamic(settings):
            message = "its solver gave up"
    except ValueError as error:
        message = f"its solver gave up: {str(error).splitlines()[0]}"
    seconds = time.perf_counter() - begin
    records = np.array(world.mbs.GetSensorStoredData(world.sensor))[:, 1:]
    v = world.velocity(np.array(world.mbs.systemData.GetODE2Coordinates_t()), records[-1])
    world.container.Reset()  # or the interpreter cannot end without a fault
    q = np.array([start.q0, *(world.from_exudyn(x) for x in records[1:])])
    if len(q) <= start.n and not message:
        message = f"it recorded {len(q) - 1} of {start.n} steps"
    for limit in joint_limits(start.scene.model, start.scene.joints):
        if (limit.sign * (q[:, limit.q] - limit.value)).min() < 0.0:
            raise SceneError(f"the motion passes the {limit.name}, and limits are not carried over")
    return March(q[: start.n + 1], seconds, setup, message=message, v=v)


class World:
    """The scene in Exudyn.

    Args:
        start: what is run.

    Attributes:
        mbs: the multibody system.
        sensor: that records the coordinates of every step.

    Raises:
        SceneError: something in the scene has no counterpart.
    """

    def __init__(self, start: Start):
        self.scene, self.model, self.dt = start.scene, start.scene.model, start.dt
        self._check()
        self.kinds = [""] + [joint_kind(self.model, j) for j in range(1, self.model.njoints)]
        self.container = exudyn.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.ground = self.mbs.AddObject(itemInterface.ObjectGround())
        self.free_body = set(self.kinds[1:]) <= {"free", "translation", "ball"}
        if self.free_body:
            self._add_body(start)
        else:
            self._add_tree(start)
        for constraint in self.scene.constraints:
            self._close(constraint)
        for pair in self.scene.contacts:
            self._touch(pair)
        self.mbs.Assemble()

    def from_exudyn(self, x: np.ndarray) -> np.ndarray:
        """The q of recorded coordinates."""
        if self.free_body:
            turn = pin.Quaternion(1.0 + x[3], *x[4:7]).normalized()  # recorded from the reference
            at = pin.SE3(turn.matrix(), x[:3]) * self._centre.inverse()
            return pin.SE3ToXYZQUAT(self.model.jointPlacements[1].inverse() * at)
        q: list[float] = []
        for value, kind in zip(x, self._links, strict=True):
            q += [np.cos(value), np.sin(value)] if kind == "angle" else [value]
        return np.array(q)

    def velocity(self, x_dot: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The v of rates of the coordinates x."""
        if not self.free_body:
            return x_dot
        e, e_dot = np.array([1.0 + x[3], *x[4:7]]), x_dot[3:7]
        R = pin.Quaternion(*e).normalized().matrix()
        omega = 2.0 * (e[0] * e_dot[1:] - e_dot[0] * e[1:] - np.cross(e[1:], e_dot[1:])) / (e @ e)
        velocity = x_dot[:3] - R @ np.cross(omega, self._centre.translation)
        frame = R if len(self.kinds) == 2 else self.model.jointPlacements[1].rotation
        return np.concatenate((frame.T @ velocity, omega))

    def _check(self) -> None:
        scene, model = self.scene, self.model
        no_beams(scene)
        touching(scene)
        if scene.forces or model.damping.any() or model.armature.any() or np.any(model.upperDryFrictionLimit):
            raise SceneError("forces, damping, armature and dry friction of joints are not carried over")
        if any(pair.law.contact_radius or pair.law.e_F for pair in scene.contacts):
            raise SceneError("it has neither Coulomb-Contensou friction nor tangential restitution")

    def _add_body(self, start: Start) -> None:
        """One rigid body with its node in the centre of mass."""
        model = self.model
        if self.kinds[1:] not in (["free"], ["translation", "ball"]):
            raise SceneError("only a single body can be free; a tree on a free base is not carried over")
        if len(self.kinds) == 3 and model.inertias[1].mass:
            raise SceneError("a body on a translating joint alone is not carried over")
        inertia, q = model.inertias[model.njoints - 1], np.asarray(start.q0, dtype=float)
        self._centre = pin.SE3(np.eye(3), np.asarray(inertia.lever))
        pose = model.jointPlacements[1] * pin.XYZQUATToSE3(q)
        turn, v = pose.rotation, np.asarray(start.v0, dtype=float)
        velocity = turn @ v[:3] if len(self.kinds) == 2 else model.jointPlacements[1].rotation @ v[:3]
        omega = v[3:]
        velocity = velocity + turn @ np.cross(omega, inertia.lever)
        e = np.array(wxyz(pin.SE3ToXYZQUAT(pose)[3:]))
        # rate of the Euler parameters from the angular velocity in the body
        rate = 0.5 * np.array([-e[1:] @ omega, *(e[0] * omega + np.cross(e[1:], omega))])
        node = self.mbs.AddNode(
            itemInterface.NodeRigidBodyEP(
                referenceCoordinates=[0, 0, 0, 1, 0, 0, 0],
                initialCoordinates=[*(pose * self._centre).translation, *(e - [1, 0, 0, 0])],
                initialVelocities=[*velocity, *rate],
            )
        )
        moments = inertia.inertia[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
        body = self.mbs.AddObject(
            itemInterface.ObjectRigidBody(mass=inertia.mass, inertia=list(moments), nodeNumber=node)
        )
        mass = self.mbs.AddMarker(itemInterface.MarkerBodyMass(bodyNumber=body))
        self.mbs.AddLoad(itemInterface.LoadMassProportional(markerNumber=mass, loadVector=list(model.gravity.linear)))
        self.body, self.frames = body, {j: (0, self._centre.inverse()) for j in range(1, model.njoints)}
        self.sensor = self._record(node)

    def _add_tree(self, start: Start) -> None:
        """Joints with one degree of freedom along z; a link frame is that of Pinocchio turned so."""
        model, names = self.model, ("types", "parents", "poses", "inertias", "coms", "masses")
        columns: dict[str, list[Any]] = {name: [] for name in names}
        self.frames, x0, v0 = {}, [], []
        self._links: list[str] = []
        for j in range(1, model.njoints):
            if self.kinds[j] in ("free", "ball"):
                raise SceneError(f"joint {model.names[j]!r} turns freely inside of a tree, which is not carried over")
            axes = np.eye(3) if self.kinds[j] == "translation" else [joint_axis(model, j)]
            q, v = start.q0[model.idx_qs[j] :][: model.nqs[j]], start.v0[model.idx_vs[j] :][: model.nvs[j]]
            x0 += [float(np.arctan2(q[1], q[0]))] if self.kinds[j] == "angle" else list(q)
            v0 += list(v)
            parent, behind = self.frames.get(model.parents[j], (-1, pin.SE3.Identity()))
            pose = behind * model.jointPlacements[j]  # of this frame, as the parent link sees it
            for n, axis in enumerate(axes):
                turn = pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix(), np.zeros(3))
                carries = n == len(axes) - 1
                inertia = turn.actInv(model.inertias[j]) if carries else pin.Inertia.Zero()
                slides = self.kinds[j] in ("slide", "translation")
                columns["types"].append(exudyn.JointType.PrismaticZ if slides else exudyn.JointType.RevoluteZ)
                columns["parents"].append(parent)
                columns["poses"].append(pose * turn)
                columns["inertias"].append(np.array(inertia.inertia))
                columns["coms"].append(np.array(inertia.lever))
                columns["masses"].append(inertia.mass)
                parent, pose = len(self._links), turn.inverse()
                self._links.append(self.kinds[j])
            self.frames[j] = (parent, pose)
        n = len(self._links)
        node = self.mbs.AddNode(
            itemInterface.NodeGenericODE2(
                referenceCoordinates=[0.0] * n,
                initialCoordinates=x0,
                initialCoordinates_t=v0,
                numberOfODE2Coordinates=n,
            )
        )
        self.body = self.mbs.AddObject(
            itemInterface.ObjectKinematicTree(
                nodeNumber=node, gravity=list(model.gravity.linear), jointTypes=columns["types"],
                linkParents=columns["parents"],
                jointTransformations=exudyn.Matrix3DList([pose.rotation for pose in columns["poses"]]),
                jointOffsets=exudyn.Vector3DList([pose.translation for pose in columns["poses"]]),
                linkInertiasCOM=exudyn.Matrix3DList(columns["inertias"]),
                linkCOMs=exudyn.Vector3DList(columns["coms"]), linkMasses=columns["masses"],
            )
        )  # fmt: skip
        self.sensor = self._record(node)

    def _record(self, node: int) -> int:
        kind = exudyn.OutputVariableType.Coordinates
        return self.mbs.AddSensor(
            itemInterface.SensorNode(nodeNumber=node, storeInternal=True, writeToFile=False, outputVariableType=kind)
        )

    def _at(self, joint: int, place: pin.SE3) -> pin.SE3:
        """A place on the body of a joint, as the body of Exudyn sees it."""
        return self.frames[joint][1] * place if joint else place

    def _marker(self, joint: int, at: pin.SE3) -> int:
        where = {"localHT": exudyn.HT(rotation=at.rotation, translation=at.translation)}
        if joint == 0 or self.free_body:
            return self.mbs.AddMarker(
                itemInterface.MarkerBodyRigid(bodyNumber=self.body if joint else self.ground, **where)
            )
        link = self.frames[joint][0]
        return self.mbs.AddMarker(
            itemInterface.MarkerKinematicTreeRigid(objectNumber=self.body, linkNumber=link, **where)
        )

    def _close(self, constraint: Any) -> None:
        """A loop."""
        if type(constraint) not in ROWS:
            raise SceneError(f"{type(constraint).__name__} {constraint.name!r} is not carried over")
        markers = [self._marker(joint, self._at(joint, place)) for joint, place in constraint.poses(self.scene)]
        self.mbs.AddObject(
            itemInterface.ObjectJointGeneric(markerNumbers=markers, constrainedAxes=ROWS[type(constraint)])
        )

    def _touch(self, pair: ContactPair) -> None:
        """A contact of its own for every pair, so that nothing else touches."""
        contact = self.mbs.AddGeneralContact()
        contact.SetFrictionPairings(pair.law.mu * np.ones((1, 1)))
        contact.SetFrictionProportionalZone(ZONE)
        contact.SetSearchTreeCellSize(numberOfCells=[1, 1, 1])
        contact.sphereSphereContact = True
        mass = sum(inertia.mass for inertia in self.model.inertias)
        k = mass * (2 * np.pi / (PERIOD * self.dt)) ** 2
        # springs act in series, dampers in parallel
        spring, damper = 2 * k, damping_ratio(pair.law.e_N) * np.sqrt(k * mass)
        shapes = [self.scene.geometry(name) for name in (pair.geometry_a, pair.geometry_b)]
        # planes first: static triangles have to be there before anything else
        for geometry in sorted(shapes, key=lambda g: not isinstance(g.geometry, coal.Halfspace)):
            shape, place = geometry.geometry, geometry.placement
            if isinstance(shape, coal.Halfspace):
                normal = np.asarray(shape.n)
                turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
                place = place * pin.SE3(turn, normal * shape.d)
                at = self._at(geometry.parentJoint, place)
                marker = self._marker(geometry.parentJoint, pin.SE3(np.eye(3), at.translation))
                square = FIELD / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
                triangles = [[0, 1, 2], [0, 2, 3]]
                corners = [list(at.rotation @ x) for x in square]
                contact.AddTrianglesRigidBodyBased(
                    marker, spring, damper, 0, corners, triangles, staticTriangles=geometry.parentJoint == 0
                )
            elif isinstance(shape, coal.Sphere) and shape.radius > 0:
                marker = self._marker(geometry.parentJoint, self._at(geometry.parentJoint, place))
                contact.AddSphereWithMarker(marker, shape.radius, spring, damper, 0)
            else:
                what = type(shape).__name__ if not isinstance(shape, coal.Sphere) else "point"
                raise SceneError(f"the shape of {geometry.name!r}, a {what}, is not carried over")


def damping_ratio(e_N: float) -> float:
    """Of a linear spring and damper that lets go when its force would pull, so that it gives back e_N."""

    def gives_back(ratio: float) -> float:
        # beyond the critical ratio root and angle are both imaginary
        root, angle = np.emath.sqrt(1.0 - ratio**2), np.emath.arccos(2 * ratio**2 - 1)
        return float(np.exp(-ratio * abs(angle) / abs(root)))

    if e_N > 0.999:
        return 0.0
    # not at the critical ratio itself, where the formula is 0 / 0
    return float(brentq(lambda ratio: gives_back(ratio) - max(e_N, LEAST), 1e-9, 9.99))
