"""MuJoCo as a line of the report: the scene as an MJCF model, q read back in Pinocchio's coordinates.

Contact is MuJoCo's soft one with its default parameters and an elliptic cone; the integrator is `implicitfast`. It has
no coefficient of restitution, no surface that is touched from inside, and no body that moves without mass and inertia.
"""

from __future__ import annotations

import time
import xml.etree.ElementTree as ET

import coal
import mujoco
import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError
from ngalpha_pin.report.lines import Line, March, Start
from ngalpha_pin.scene.joint_pd import JointPD
from ngalpha_pin.scene.joints import joint_limits
from ngalpha_pin.scene.meshes import hull_of_mesh
from ngalpha_pin.scene.scene import Scene

from .tree import joint_axis, joint_kind, no_beams, principal_axes, touching, wxyz

NEVER = 1e6  # an end of a range that is not there [rad or m]


def line() -> Line:
    """The line of the report."""
    note = f"MuJoCo {mujoco.__version__}: soft contact with default parameters, elliptic cone, implicitfast"
    return Line("MuJoCo", march, note)


def march(start: Start) -> March:
    """Run the scene; only the loop over the steps is timed."""
    begin = time.perf_counter()
    try:
        model = mujoco.MjModel.from_xml_string(mjcf(start.scene, start.dt))
    except ValueError as error:
        raise SceneError(" ".join(str(error).split())) from error
    data = mujoco.MjData(model)
    joints = Joints(start.scene.model)
    data.qpos[:], data.qvel[:] = joints.to_mujoco(start.q0, start.v0)
    setup = time.perf_counter() - begin
    positions = np.empty((start.n + 1, model.nq))
    positions[0] = data.qpos
    message, made = "", start.n
    begin = time.perf_counter()
    for i in range(start.n):
        mujoco.mj_step(model, data)
        positions[i + 1] = data.qpos
    seconds = time.perf_counter() - begin
    if not np.isfinite(positions).all():
        message, made = "the numbers are not finite any more", int(np.argmin(np.isfinite(positions).all(axis=1))) - 1
    q = np.array([joints.from_mujoco(x) for x in positions[: made + 1]])
    return March(q, seconds, setup, message=message, v=joints.velocity(q[-1], np.array(data.qvel)))


class Joints:
    """Coordinates of both sides, joint by joint.

    Args:
        model: the tree of Pinocchio.
    """

    def __init__(self, model: pin.Model):
        self.model = model
        self.kinds = [joint_kind(model, j) for j in range(1, model.njoints)]

    def to_mujoco(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The qpos and qvel of q and v."""
        qpos: list[float] = []
        qvel: list[float] = []
        for j, kind in enumerate(self.kinds, start=1):
            own_q = q[self.model.idx_qs[j] :][: self.model.nqs[j]]
            own_v = v[self.model.idx_vs[j] :][: self.model.nvs[j]]
            if kind == "free":
                pose = self.model.jointPlacements[j] * pin.XYZQUATToSE3(own_q)  # MuJoCo's is that in the world
                qpos += [*pose.translation, *wxyz(pin.SE3ToXYZQUAT(pose)[3:])]
                qvel += [*(pose.rotation @ own_v[:3]), *own_v[3:]]
            elif kind == "ball":
                qpos, qvel = qpos + wxyz(own_q), [*qvel, *own_v]
            elif kind == "angle":
                qpos, qvel = [*qpos, float(np.arctan2(own_q[1], own_q[0]))], [*qvel, *own_v]
            else:
                qpos, qvel = [*qpos, *own_q], [*qvel, *own_v]
        return np.array(qpos), np.array(qvel)

    def from_mujoco(self, qpos: np.ndarray) -> np.ndarray:
        """The q of qpos."""
        q: list[float] = []
        i = 0
        for j, kind in enumerate(self.kinds, start=1):
            if kind == "free":
                w, x, y, z = qpos[i + 3 : i + 7]
                pose = pin.XYZQUATToSE3(np.array([*qpos[i : i + 3], x, y, z, w]))
                q, i = [*q, *pin.SE3ToXYZQUAT(self.model.jointPlacements[j].inverse() * pose)], i + 7
            elif kind == "ball":
                w, x, y, z = qpos[i : i + 4]
                q, i = [*q, x, y, z, w], i + 4
            elif kind == "angle":
                q, i = [*q, np.cos(qpos[i]), np.sin(qpos[i])], i + 1
            else:
                n = self.model.nqs[j]
                q, i = [*q, *qpos[i : i + n]], i + n
        return np.array(q)

    def velocity(self, q: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """The v of qvel, at q."""
        v: list[float] = []
        for j, kind in enumerate(self.kinds, start=1):
            own = qvel[len(v) :][: self.model.nvs[j]]
            if kind == "free":
                pose = self.model.jointPlacements[j] * pin.XYZQUATToSE3(q[self.model.idx_qs[j] :][:7])
                own = np.concatenate((pose.rotation.T @ own[:3], own[3:]))
            v += [*own]
        return np.array(v)


def mjcf(scene: Scene, dt: float) -> str:
    """The scene as MJCF.

    Raises:
        SceneError: something in it has no counterpart.
    """
    model = scene.model
    if scene.constraints:
        raise SceneError("constraints are not carried over")
    bouncing = [pair for pair in scene.contacts if pair.law.e_N or pair.law.e_F]
    if bouncing:
        raise SceneError("it has no coefficient of restitution, the scene has e_N or e_F > 0")
    no_beams(scene)
    shapes = touching(scene)
    root = ET.Element("mujoco")
    ET.SubElement(
        root, "compiler", angle="radian", autolimits="true", boundmass="0", boundinertia="0", balanceinertia="false"
    )
    gravity = _text(model.gravity.linear)
    ET.SubElement(root, "option", timestep=repr(dt), gravity=gravity, integrator="implicitfast", cone="elliptic")
    assets = ET.SubElement(root, "asset")
    world = ET.SubElement(root, "worldbody")
    bodies, springs = {0: world}, _springs(scene)
    for j in range(1, model.njoints):
        if _is_carrier(scene, j):
            continue
        chain = [j]  # massless carriers in front of the body: MuJoCo writes their joints on the body itself
        while model.parents[chain[0]] and _is_carrier(scene, model.parents[chain[0]]):
            chain.insert(0, model.parents[chain[0]])
        poses = [model.jointPlacements[i] for i in chain]
        at = poses[0]
        for pose in poses[1:]:
            at = at * pose
        where = {"pos": _text(at.translation), "quat": _quat(at.rotation)}
        bodies[j] = ET.SubElement(bodies[model.parents[chain[0]]], "body", name=f"body_{j}", **where)
        for n, i in enumerate(chain):
            seen = pin.SE3.Identity()  # the frame of joint i from that of the body
            for pose in poses[:n:-1]:
                seen = seen * pose.inverse()
            _joint(bodies[j], scene, i, springs, seen)
        _inertia(bodies[j], model.inertias[j])
    for name in shapes:
        _geometry(bodies[int(scene.geometry(name).parentJoint)], scene.geometry(name), assets)
    contact = ET.SubElement(root, "contact")
    for pair in scene.contacts:
        law = pair.law
        roll = law.rolling_resistance
        friction = _text([law.mu, law.mu, 3 * np.pi / 16 * law.contact_radius * law.mu, roll, roll])
        condim = "1" if law.mu == 0 else "6" if roll else "4" if law.contact_radius else "3"
        ET.SubElement(contact, "pair", geom1=pair.geometry_a, geom2=pair.geometry_b, friction=friction, condim=condim)
    return ET.tostring(root, encoding="unicode")


def _is_carrier(scene: Scene, j: int) -> bool:
    """A joint without mass that carries one other joint and no geometry of a contact."""
    model = scene.model
    return (
        model.inertias[j].mass == 0
        and list(model.parents)[1:].count(j) == 1
        and all(scene.geometry(name).parentJoint != j for name in touching(scene))
    )


def _springs(scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stiffness, damping and rest position of every velocity coordinate."""
    model = scene.model
    kp, kd, rest = np.zeros(model.nv), np.array(model.damping, dtype=float), pin.neutral(model)
    for force in scene.forces:
        if not isinstance(force, JointPD) or force.energy is None:
            raise SceneError(f"the force {type(force).__name__} is not carried over")
        kp, kd, rest = kp + force.kp, kd + force.kd, force.q_ref
    return kp, kd, rest


def _joint(
    body: ET.Element, scene: Scene, j: int, springs: tuple[np.ndarray, np.ndarray, np.ndarray], seen: pin.SE3
) -> None:
    model = scene.model
    kind, name, i = joint_kind(model, j), model.names[j], model.idx_vs[j]
    if kind == "free":
        if model.parents[j]:
            raise SceneError("only the root can be a free flyer")
        ET.SubElement(body, "freejoint", name=name)
    elif kind == "ball":
        ET.SubElement(body, "joint", name=name, type="ball")
    elif kind == "translation":
        for n, axis in enumerate(seen.rotation.T):
            ET.SubElement(body, "joint", name=f"{name}_{n}", type="slide", axis=_text(axis))
    else:
        kp, kd, rest = springs
        options = {
            "stiffness": repr(float(kp[i])),
            "damping": repr(float(kd[i])),
            "armature": repr(float(model.armature[i])),
        }
        if scene.joints.friction and model.upperDryFrictionLimit[i] > 0:
            options["frictionloss"] = repr(float(model.upperDryFrictionLimit[i]))
        if kind != "angle":
            options["springref"] = repr(float(rest[model.idx_qs[j]]))
            ends = {limit.sign: limit.value for limit in joint_limits(model, scene.joints) if limit.joint == j}
            if ends:
                options["range"] = _text([ends.get(1.0, -NEVER), ends.get(-1.0, NEVER)])
        options |= {"axis": _text(seen.rotation @ joint_axis(model, j)), "pos": _text(seen.translation)}
        ET.SubElement(body, "joint", name=name, type="slide" if kind == "slide" else "hinge", **options)


def _inertia(body: ET.Element, inertia: pin.Inertia) -> None:
    if inertia.mass <= 0:
        return
    values, axes = principal_axes(inertia)
    where = {"pos": _text(inertia.lever), "quat": _quat(axes)}
    size = {"mass": repr(float(inertia.mass)), "diaginertia": _text(values)}
    ET.SubElement(body, "inertial", **where, **size)


def _geometry(body: ET.Element, geometry: pin.GeometryObject, assets: ET.Element) -> None:
    shape, placement = geometry.geometry, geometry.placement
    if isinstance(shape, coal.BVHModelBase):  # its hull, as here
        shape = hull_of_mesh(shape, geometry.name)
    if isinstance(shape, coal.Halfspace):
        z = np.asarray(shape.n)
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), z).toRotationMatrix()
        placement = placement * pin.SE3(turn, z * shape.d)
        kind, size = "plane", "0 0 1"
    elif isinstance(shape, coal.Sphere):
        kind, size = "sphere", repr(max(float(shape.radius), 1e-6))
    elif isinstance(shape, coal.Box):
        kind, size = "box", _text(shape.halfSide)
    elif isinstance(shape, (coal.Capsule, coal.Cylinder)):
        kind = "capsule" if isinstance(shape, coal.Capsule) else "cylinder"
        size = _text([shape.radius, shape.halfLength])
    elif isinstance(shape, coal.ConvexBase):
        ET.SubElement(assets, "mesh", name=geometry.name, vertex=_text(np.ravel(shape.points())))
        kind, size = "mesh", ""
    else:
        raise SceneError(f"the shape {type(shape).__name__} of {geometry.name!r} is not carried over")
    where = {"pos": _text(placement.translation), "quat": _quat(placement.rotation)}
    # only the pairs of the scene touch each other
    form = {"mesh": geometry.name} if kind == "mesh" else {"size": size}
    nothing = {"contype": "0", "conaffinity": "0", "mass": "0"}
    ET.SubElement(body, "geom", name=geometry.name, type=kind, **form, **nothing, **where)


def _quat(rotation: np.ndarray) -> str:
    return _text(wxyz(pin.Quaternion(np.asarray(rotation)).coeffs()))


def _text(values: object) -> str:
    return " ".join(repr(float(x)) for x in np.asarray(values, dtype=float))
