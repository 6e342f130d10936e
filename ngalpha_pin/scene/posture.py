"""Configurations to start from: named ones, those within the limits, those that stand on something."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.scene.constraints import JointCoupling
from ngalpha_pin.scene.joint_sum import JointSum
from ngalpha_pin.scene.joints import within_limits
from ngalpha_pin.scene.meshes import hull_of_mesh
from ngalpha_pin.scene.pending_meshes import loaded
from ngalpha_pin.scene.protocols import Editable

# what files call the configuration that a robot starts from, the first one that there is
STARTS = ("standing", "half_sitting", "home", "default", "rest", "qpos0")
FREE = 7  # coordinates of a root that moves freely
WORLD = ("world", "universe", "map")  # links that a URDF calls what does not move
ROUNDS = 200  # of the descent onto a surface that is not a plane
EXACT = 1e-10  # accuracy of distances [m]: coal's default of 1e-6 is a visible gap
ARRIVED = 1e-12  # height above it that counts as reached [m]


def references(scene: Editable, srdf: str | None) -> dict[str, np.ndarray]:
    """Named configurations of the model, and of an SRDF or of those beside the URDF that are about the same robot."""
    model = scene.model
    files = [Path(srdf)] if srdf is not None else [f for visual in scene.visual_files for f in _srdfs(visual.path)]
    found = {item.key(): np.array(item.data()) for item in model.referenceConfigurations}
    for file in files:
        if not file.is_file():
            raise SceneError(f"no SRDF file at {file}")
        own = model.copy()
        try:
            pin.loadReferenceConfigurations(own, str(file), False)
        except (ValueError, RuntimeError) as error:
            raise SceneError(f"{file.name} cannot be read: {error}") from error
        for item in own.referenceConfigurations:
            found.setdefault(item.key(), pin.normalize(model, np.array(item.data())))
    return found


def _srdfs(urdf: str) -> Iterator[Path]:
    """SRDF files beside a URDF, or in a folder srdf beside its own, of the same robot or of the same name."""
    path = Path(urdf).resolve()
    if path.suffix != ".urdf" or not path.is_file():
        return
    try:
        robot = ElementTree.parse(path).getroot().get("name")
    except ElementTree.ParseError:
        return
    for folder in (path.parent, path.parent / "srdf", path.parent.parent / "srdf"):
        for file in sorted(folder.glob("*.srdf"), key=lambda f: (f.stem != path.stem, f.stem)):
            try:
                same = ElementTree.parse(file).getroot().get("name") == robot
            except ElementTree.ParseError:
                continue
            if same or file.stem == path.stem:
                yield file


def floats(urdf: str) -> bool:
    """Whether an SRDF of the robot says that its root moves freely: a floating virtual joint, or a pose of the root.

    The pose is that of a joint which the URDF does not have, in a state of mostly joints that it has; a root that is
    the world is fixed whatever an SRDF says.
    """
    try:
        root = ElementTree.parse(urdf).getroot()
    except ElementTree.ParseError:
        return False  # reading the file says so
    joints = {joint.get("name") for joint in root.findall("joint")}
    carried = {child.get("link") for child in root.findall("joint/child")}
    base = {link.get("name") for link in root.findall("link")} - carried
    if base & set(WORLD):
        return False
    for file in _srdfs(urdf):
        srdf = ElementTree.parse(file).getroot()
        virtual = [joint for joint in srdf.iter("virtual_joint") if joint.get("type") == "floating"]
        if any(joint.get("child_link") in base for joint in virtual):
            return True
        if any(_poses_root(state, joints) for state in srdf.iter("group_state")):
            return True
    return False


def _poses_root(state: ElementTree.Element, joints: set[str | None]) -> bool:
    named = [joint for joint in state.iter("joint") if joint.get("value")]
    root = [joint for joint in named if len((joint.get("value") or "").split()) == FREE]
    known = sum(joint.get("name") in joints for joint in named)
    return any(joint.get("name") not in joints for joint in root) and 2 * known >= len(named) - len(root)


def reference(scene: Editable, name: str | None, srdf: str | None) -> np.ndarray:
    """See `Scene.reference`."""
    known = references(scene, srdf)
    if name is not None:
        if name not in known:
            raise UnknownName("reference configuration", name, known)
        return np.concatenate((known[name], scene.q_ref[scene.model.nq :]))
    start = next((n for n in STARTS if n in known), None)
    q = pin.neutral(scene.model) if start is None else known[start]
    return within(scene, np.concatenate((q, scene.q_ref[scene.model.nq :])))


def within(scene: Editable, q: np.ndarray) -> np.ndarray:
    """See `Scene.within_limits`."""
    q = checked(scene, q)
    n = scene.model.nq
    q[:n] = within_limits(scene.model, q[:n])
    for coupling in scene.constraints:
        if isinstance(coupling, JointCoupling) and isinstance(coupling.joint, str):
            leader = JointSum(coupling.name, coupling.leader, scene.model)
            _turn_to(scene.model, q, coupling.joint, float(coupling.polynomial(leader.value(q))))
    return q


def _turn_to(model: pin.Model, q: np.ndarray, joint: str, value: float) -> None:
    j = model.getJointId(joint)
    i = model.idx_qs[j]
    q[i : i + model.nqs[j]] = (np.cos(value), np.sin(value)) if model.nqs[j] == 2 else value


def placed_on(scene: Editable, surface: str, q: np.ndarray, clearance: float, root: str | None) -> np.ndarray:
    """See `Scene.place_on`."""
    q = checked(scene, q)
    surfaces = [loaded(scene.declared_shapes, name) for name in scene.geometries(surface)]
    if any(g.parentJoint for g in surfaces):
        raise SceneError(f"place_on: {surface!r} moves; only what is fixed to the world can be stood on")
    joint = _root(scene, root)
    on_branch = set(int(j) for j in scene.model.subtrees[joint])
    bodies = [g for g in scene.declared_shapes.geometryObjects if int(g.parentJoint) in on_branch]
    pairs = {pair.key for pair in scene.contacts}
    touching = [g for g in bodies if any(frozenset((g.name, s.name)) in pairs for s in surfaces)]
    bodies = [loaded(scene.declared_shapes, g.name) for g in touching or bodies]
    if not bodies:
        raise SceneError(f"place_on: {scene.model.names[joint]!r} carries no geometry that could touch {surface!r}")
    i = scene.model.idx_qs[joint]
    up = scene.model.jointPlacements[joint].rotation.T @ np.array([0.0, 0.0, 1.0])
    walls = all(isinstance(g.geometry, coal.Halfspace) for g in surfaces)
    for _ in range(ROUNDS):
        gap, slope = _gap(scene, q, bodies, surfaces)
        if abs(gap - clearance) <= ARRIVED:
            break
        # onto a plane in one go; elsewhere the distance itself is a step that does not go too far
        q[i : i + 3] += (clearance - gap) / (slope if walls else 1.0) * up
    else:
        raise SceneError(f"place_on: nothing of {scene.model.names[joint]!r} comes down on {surface!r}")
    return q


def _root(scene: Editable, name: str | None) -> int:
    model = scene.model
    free = [j for j in range(1, model.njoints) if model.parents[j] == 0 and model.nvs[j] == 6]
    names = [model.names[j] for j in free]
    if name is not None:
        if checks.name("root", name) not in names:
            raise UnknownName("root that moves freely", name, names)
        return free[names.index(name)]
    if len(free) != 1:
        what = f"name one of the roots {', '.join(names)}" if free else "nothing of this scene moves freely"
        raise SceneError(f"place_on: {what}")
    return free[0]


def _gap(
    scene: Editable, q: np.ndarray, bodies: list[pin.GeometryObject], surfaces: list[pin.GeometryObject]
) -> tuple[float, float]:
    """Smallest distance of bodies and surfaces [m], and how fast it grows upwards [-]."""
    data = scene.model.createData()
    pin.forwardKinematics(scene.model, data, q[: scene.model.nq])
    best = np.inf, 1.0
    request = coal.DistanceRequest()
    request.gjk_tolerance = request.epa_tolerance = EXACT
    for surface in surfaces:
        ground = coal.Transform3s(surface.placement.rotation, surface.placement.translation)
        for body in bodies:
            pose = data.oMi[body.parentJoint] * body.placement
            result = coal.DistanceResult()
            shape = body.geometry
            if isinstance(shape, coal.BVHModelBase):
                shape = hull_of_mesh(shape, body.name)
            d = coal.distance(
                shape, coal.Transform3s(pose.rotation, pose.translation), surface.geometry, ground, request, result
            )
            slope = -float(np.array(result.normal)[2])
            if d < best[0]:
                best = float(d), slope if slope > 0.0 else 1.0
    return best


def checked(scene: Editable, q: np.ndarray) -> np.ndarray:
    """A copy of a configuration of the scene.

    Raises:
        SceneError: its shape is another one, or it is not finite.
    """
    return checks.vector("q", q, len(scene.q_ref))
