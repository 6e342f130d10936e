"""PyBullet as a line of the report: the scene as multibodies, q read back in Pinocchio's coordinates.

Bullet multiplies the friction coefficients of the two bodies that touch, so that those of all pairs must be such
products. Its joints start with a motor and its bodies with damping and a limit of speed; here they have none. Forces of
the scene act as joint torques of the start of each step, damping as Bullet's own.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin
import pybullet

from ngalpha_pin.errors import SceneError
from ngalpha_pin.report.lines import Line, March, Start
from ngalpha_pin.scene.contact import ContactLaw
from ngalpha_pin.scene.joints import joint_limits
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.system import System

from .tree import joint_axis, joint_kind, no_beams, principal_axes, touching

FAST = 1e9  # a limit of speed that is never met [rad/s or m/s]
TINY = 1e-300  # stands for a coefficient of zero where its logarithm is taken
AXES = np.eye(3)


def line() -> Line:
    """The line of the report."""
    note = f"PyBullet {pybullet.getAPIVersion()}: multibodies, contact with default parameters, friction as a pyramid"
    return Line("PyBullet", march, note)


def march(start: Start) -> March:
    """Run the scene; only the loop over the steps is timed, without reading the positions."""
    begin = time.perf_counter()
    client = pybullet.connect(pybullet.DIRECT)
    try:
        world = World(start.scene, client, start.dt)
        world.put(start.q0, start.v0)
        setup = time.perf_counter() - begin
        q, seconds, message = [np.array(start.q0, dtype=float)], 0.0, ""
        v = np.array(start.v0, dtype=float)
        for i in range(start.n):
            begin = time.perf_counter()
            if world.forces is not None:
                world.push(start.t0 + i * start.dt)
            pybullet.stepSimulation(client)
            seconds += time.perf_counter() - begin
            now, v = world.state()
            if not np.isfinite(now).all():
                message = "the numbers are not finite any more"
                break
            q.append(now)
    finally:
        pybullet.disconnect(client)
    return March(np.array(q), seconds, setup, message=message, v=v)


class Link(NamedTuple):
    """Where a joint of Pinocchio is: the body, and its links, of which the last one carries the mass."""

    body: int
    links: tuple[int, ...]


class World:
    """The scene in PyBullet.

    Args:
        scene: what is run.
        client: of the connection.
        dt: step [s].

    Attributes:
        forces: the system whose forces act, or None where there are none.

    Raises:
        SceneError: something in the scene has no counterpart.
    """

    def __init__(self, scene: Scene, client: int, dt: float):
        no_beams(scene)
        if scene.constraints:
            raise SceneError("constraints are not carried over")
        if any(pair.law.contact_radius or pair.law.e_F for pair in scene.contacts):
            raise SceneError("it has neither Coulomb-Contensou friction nor tangential restitution")
        self.scene, self.model, self.at = scene, scene.model, {"physicsClientId": client}
        self.kinds = [""] + [joint_kind(self.model, j) for j in range(1, self.model.njoints)]
        self.forces = System(scene) if scene.forces else None
        pybullet.setGravity(*self.model.gravity.linear, **self.at)
        pybullet.setPhysicsEngineParameter(fixedTimeStep=dt, deterministicOverlappingPairs=1, **self.at)
        self.names = touching(scene)
        self.links: dict[int, Link] = {}
        for root in (j for j in range(1, self.model.njoints) if self.model.parents[j] == 0):
            self._add_tree(root)
        self.fixed = {name: self._add_fixed(name) for name in self.names if scene.geometry(name).parentJoint == 0}
        self._contacts()

    def put(self, q: np.ndarray, v: np.ndarray) -> None:
        """Set the state."""
        for j, kind in enumerate(self.kinds):
            if j == 0:
                continue
            body, links = self.links[j]
            q_j, v_j = q[self.model.idx_qs[j] :][: self.model.nqs[j]], v[self.model.idx_vs[j] :][: self.model.nvs[j]]
            if kind == "free":
                pose = self.model.jointPlacements[j] * pin.XYZQUATToSE3(q_j)
                turn = pose.rotation
                at = pin.SE3ToXYZQUAT(pose * self._inertial(j))
                pybullet.resetBasePositionAndOrientation(body, at[:3], at[3:], **self.at)
                arm = np.cross(turn @ v_j[3:], turn @ np.asarray(self.model.inertias[j].lever))
                pybullet.resetBaseVelocity(body, turn @ v_j[:3] + arm, turn @ v_j[3:], **self.at)
            elif kind == "ball":
                # turned as its principal axes see it
                axes = self._inertial(j).rotation
                seen = pin.Quaternion(axes.T @ pin.Quaternion(q_j).matrix() @ axes).coeffs()
                pybullet.resetJointStateMultiDof(body, links[0], seen, axes.T @ v_j, **self.at)
            elif kind == "angle":
                pybullet.resetJointState(body, links[0], float(np.arctan2(q_j[1], q_j[0])), v_j[0], **self.at)
            else:
                for link, x, x_dot in zip(links, q_j, v_j, strict=True):
                    pybullet.resetJointState(body, link, x, x_dot, **self.at)

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """The q and v of now."""
        q, v = np.empty(self.model.nq), np.empty(self.model.nv)
        for j, kind in enumerate(self.kinds):
            if j == 0:
                continue
            body, links = self.links[j]
            if kind == "free":
                q_j, v_j = self._free(j, body)
            elif kind == "ball":
                axes = self._inertial(j).rotation
                seen, turning = pybullet.getJointStateMultiDof(body, links[0], **self.at)[:2]
                q_j = pin.Quaternion(axes @ pin.Quaternion(np.array(seen)).matrix() @ axes.T).coeffs()
                v_j = axes @ turning
            else:
                q_j, v_j = np.array([pybullet.getJointState(body, link, **self.at)[:2] for link in links]).T
                q_j = np.array([np.cos(q_j[0]), np.sin(q_j[0])]) if kind == "angle" else q_j
            q[self.model.idx_qs[j] :][: self.model.nqs[j]] = q_j
            v[self.model.idx_vs[j] :][: self.model.nvs[j]] = v_j
        return q, v

    def push(self, t: float) -> None:
        """Let the forces of the scene act in the next step.

        Raises:
            SceneError: they act on a joint that has no motor.
        """
        assert self.forces is not None
        q, v = self.state()
        loads = self.forces.loads(t, q, v)
        assert loads is not None
        tau = loads[0] + self.model.damping * v if self.scene.joints.damping else loads[0]  # Bullet has that itself
        for j, kind in enumerate(self.kinds):
            if j == 0:
                continue
            tau_j = tau[self.model.idx_vs[j] :][: self.model.nvs[j]]
            if kind in ("hinge", "slide", "angle"):
                body, links = self.links[j]
                pybullet.setJointMotorControl2(body, links[0], pybullet.TORQUE_CONTROL, force=tau_j[0], **self.at)
            elif tau_j.any():
                raise SceneError(f"a force acts on joint {self.model.names[j]!r}, which has no motor there")

    def _free(self, j: int, body: int) -> tuple[np.ndarray, np.ndarray]:
        at = np.concatenate(pybullet.getBasePositionAndOrientation(body, **self.at))
        world = pin.XYZQUATToSE3(at) * self._inertial(j).inverse()
        linear, angular = (np.array(x) for x in pybullet.getBaseVelocity(body, **self.at))
        turn, lever = world.rotation, np.asarray(self.model.inertias[j].lever)
        velocity = turn.T @ (linear - np.cross(angular, turn @ lever))
        pose = self.model.jointPlacements[j].inverse() * world
        return pin.SE3ToXYZQUAT(pose), np.concatenate([velocity, turn.T @ angular])

    def _inertial(self, j: int) -> pin.SE3:
        """Centre of mass and principal axes of a body in its frame."""
        inertia = self.model.inertias[j]
        return (
            pin.SE3(principal_axes(inertia)[1], np.asarray(inertia.lever)) if inertia.mass > 0 else pin.SE3.Identity()
        )

    def _add_tree(self, root: int) -> None:
        """The bodies behind one joint of the world: a multibody on a fixed or a free base."""
        subtree = list(self.model.subtrees[root])
        free = self.kinds[root] == "free"
        base: dict[str, Any] = {"baseMass": 0.0}
        if free:
            at = self._inertial(root)
            base = {
                "baseMass": self.model.inertias[root].mass, "baseCollisionShapeIndex": self._shape(root),
                "baseInertialFramePosition": at.translation,
                "baseInertialFrameOrientation": pin.Quaternion(at.rotation).coeffs(),
            }  # fmt: skip
        rows: list[dict[str, Any]] = []
        last = {0: -1, root: -1} if free else {0: -1}
        own: dict[int, tuple[int, ...]] = {root: (-1,)} if free else {}
        for j in subtree[1:] if free else subtree:
            if self.kinds[j] == "free":
                raise SceneError(f"only a root can be a free flyer, joint {self.model.names[j]!r} is not")
            first = len(rows)
            rows += self._rows(j, last[self.model.parents[j]] + 1, first)
            own[j], last[j] = tuple(range(first, len(rows))), len(rows) - 1
        columns = {f"link{name}": [row[name] for row in rows] for name in rows[0]} if rows else {}
        body = pybullet.createMultiBody(**base, **columns, **self.at)
        for j, links in own.items():
            self.links[j] = Link(body, links)
            self._dynamics(j)

    def _rows(self, j: int, parent: int, first: int) -> list[dict[str, Any]]:
        """The links of a joint, its mass on the last of them."""
        placement, at, kind = self.model.jointPlacements[j], self._inertial(j), self.kinds[j]
        axes = AXES if kind == "translation" else [np.zeros(3) if kind == "ball" else joint_axis(self.model, j)]
        of_kind = {"ball": pybullet.JOINT_SPHERICAL, "hinge": pybullet.JOINT_REVOLUTE, "angle": pybullet.JOINT_REVOLUTE}
        rows = []
        for n, axis in enumerate(axes):
            carries, pose = n == len(axes) - 1, placement if n == 0 else pin.SE3.Identity()
            inertial = at if carries else pin.SE3.Identity()
            rows.append({
                "Masses": self.model.inertias[j].mass if carries else 0.0,
                "CollisionShapeIndices": self._shape(j) if carries else -1,
                "VisualShapeIndices": -1,
                "Positions": pose.translation,
                "Orientations": pin.Quaternion(pose.rotation).coeffs(),
                "InertialFramePositions": inertial.translation,
                "InertialFrameOrientations": pin.Quaternion(inertial.rotation).coeffs(),
                "ParentIndices": parent if n == 0 else first + n,
                "JointTypes": of_kind.get(kind, pybullet.JOINT_PRISMATIC),
                "JointAxis": axis,
            })  # fmt: skip
        return rows

    def _dynamics(self, j: int) -> None:
        """Inertia, limits, friction and damping of a joint; nothing else brakes it."""
        model, (body, links), i = self.model, self.links[j], self.model.idx_vs[j]
        laws, simple = self.scene.joints, self.kinds[j] in ("hinge", "slide", "angle")
        inertia = model.inertias[j]
        moments = principal_axes(inertia)[0] if inertia.mass > 0 else np.zeros(3)
        ends = {limit.sign: limit.value for limit in joint_limits(model, laws) if limit.joint == j}
        if len(ends) == 1:
            raise SceneError(f"joint {model.names[j]!r} has a limit on one side only")
        if laws.armature and model.armature[i : i + model.nvs[j]].any():
            raise SceneError(f"joint {model.names[j]!r} has an armature")
        options: dict[str, Any] = {
            "linearDamping": 0.0, "angularDamping": 0.0, "maxJointVelocity": FAST,
            "jointDamping": float(model.damping[i]) if simple and laws.damping else 0.0,
        }  # fmt: skip
        for link in links:
            options["localInertiaDiagonal"] = moments if link == links[-1] else np.zeros(3)
            for name, value in options.items():  # one by one: in one call some of them are ignored
                pybullet.changeDynamics(body, link, **{name: value}, **self.at)
            if ends:
                pybullet.changeDynamics(body, link, jointLowerLimit=ends[1.0], jointUpperLimit=ends[-1.0], **self.at)
            if self.kinds[j] == "ball":
                pybullet.setJointMotorControlMultiDof(
                    body, link, pybullet.POSITION_CONTROL, [0, 0, 0, 1], positionGain=0, velocityGain=0,
                    force=[0, 0, 0], **self.at,
                )  # fmt: skip
            elif link >= 0:
                dry = float(model.upperDryFrictionLimit[i]) if simple and laws.friction else 0.0
                pybullet.setJointMotorControl2(body, link, pybullet.VELOCITY_CONTROL, force=max(dry, 0.0), **self.at)

    def _shape(self, j: int) -> int:
        """The shapes of a body that contacts name; -1 where there are none."""
        return self._shapes([name for name in self.names if self.scene.geometry(name).parentJoint == j])

    def _add_fixed(self, name: str) -> Link:
        return Link(pybullet.createMultiBody(0.0, self._shapes([name]), **self.at), (-1,))

    def _shapes(self, names: list[str]) -> int:
        if not names:
            return -1
        options: dict[str, list[Any]] = {key: [] for key in ("shapeTypes", "radii", "halfExtents", "lengths")}
        normals, positions, turns = [], [], []
        for name in names:
            geometry = self.scene.geometry(name)
            shape, at = geometry.geometry, geometry.placement
            one = {"radii": 1.0, "halfExtents": [1.0, 1.0, 1.0], "lengths": 1.0}
            normal = [0.0, 0.0, 1.0]
            if isinstance(shape, coal.Halfspace):
                one["shapeTypes"], normal = pybullet.GEOM_PLANE, list(shape.n)
                at = at * pin.SE3(np.eye(3), np.asarray(shape.n) * shape.d)
            elif isinstance(shape, coal.Sphere):
                one |= {"shapeTypes": pybullet.GEOM_SPHERE, "radii": max(float(shape.radius), 1e-6)}
            elif isinstance(shape, coal.Box):
                one |= {"shapeTypes": pybullet.GEOM_BOX, "halfExtents": list(shape.halfSide)}
            elif isinstance(shape, (coal.Capsule, coal.Cylinder)):
                round_ends = isinstance(shape, coal.Capsule)
                one["shapeTypes"] = pybullet.GEOM_CAPSULE if round_ends else pybullet.GEOM_CYLINDER
                one |= {"radii": shape.radius, "lengths": 2 * shape.halfLength}
            else:
                raise SceneError(f"the shape {type(shape).__name__} of {name!r} is not carried over")
            for key, values in options.items():
                values.append(one[key])
            normals.append(normal)
            positions.append(at.translation)
            turns.append(pin.Quaternion(at.rotation).coeffs())
        return pybullet.createCollisionShapeArray(
            **options, planeNormals=normals, collisionFramePositions=positions, collisionFrameOrientations=turns,
            **self.at,
        )  # fmt: skip

    def _contacts(self) -> None:
        """Only the pairs of the scene touch, with their coefficients."""
        places = {
            name: self.fixed.get(name) or self.links[self.scene.geometry(name).parentJoint] for name in self.names
        }
        sides = sorted({(place.body, place.links[-1]) for place in places.values()})
        pairs: dict[tuple[int, int], ContactLaw] = {}
        for pair in self.scene.contacts:
            a, b = (sides.index((places[n].body, places[n].links[-1])) for n in (pair.geometry_a, pair.geometry_b))
            if pairs.setdefault((min(a, b), max(a, b)), pair.law) != pair.law:
                raise SceneError("friction and restitution belong to bodies, here two shapes of one body differ")
        incidence = np.zeros((len(pairs), len(sides)))
        for row, pair_of_sides in zip(incidence, pairs, strict=True):
            row[list(pair_of_sides)] = 1.0
        mu = _factors(incidence, np.array([law.mu for law in pairs.values()]))
        e_N = _factors(incidence, np.array([law.e_N for law in pairs.values()]))
        for (body, link), friction, restitution in zip(sides, mu, e_N, strict=True):
            pybullet.changeDynamics(body, link, lateralFriction=friction, restitution=restitution, **self.at)
            pybullet.setCollisionFilterGroupMask(body, link, 0, 0, **self.at)
        for a, b in pairs:
            pybullet.setCollisionFilterPair(sides[a][0], sides[b][0], sides[a][1], sides[b][1], 1, **self.at)


def _factors(incidence: np.ndarray, products: np.ndarray) -> np.ndarray:
    """Coefficients of the bodies whose products are those of the pairs.

    Raises:
        SceneError: there are none.
    """
    logs = np.log(np.maximum(products, TINY))
    factors = np.linalg.lstsq(incidence, logs, rcond=None)[0]
    if np.abs(incidence @ factors - logs).max(initial=0.0) > 1e-9:
        raise SceneError("it multiplies coefficients of the two bodies, and those of the pairs are not such products")
    return np.exp(factors)
