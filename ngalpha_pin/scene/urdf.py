"""URDF files: checked and completed as text, then read by Pinocchio.

Pinocchio drops `<mimic>`, an inertial that it cannot read and paths with %20, without a word. What is wrong in a file
is told here with the names of the link and the file, before anything is built.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.constraints import JointCoupling
from ngalpha_pin.scene.contents import Entry, listed
from ngalpha_pin.scene.meshes import find_mesh, in_metres, make_pending
from ngalpha_pin.scene.pending_meshes import take_meshes
from ngalpha_pin.scene.urdf_contents import contents
from ngalpha_pin.scene.urdf_elements import check_elements, leave_out_unknown
from ngalpha_pin.scene.urdf_inertia import check_inertials

Element = ElementTree.Element
Folders = Sequence[str | os.PathLike[str]] | None
XACRO = "{http://www.ros.org/wiki/xacro}", "{http://wiki.ros.org/xacro}", "{http://ros.org/wiki/xacro}"


class UrdfFile(NamedTuple):
    """What a file says, in the terms of a scene; the attributes are those of `Scene`."""

    model: pin.Model
    collision_model: pin.GeometryModel
    constraints: list[JointCoupling]
    contents: list[Entry]


def read_urdf(path: str | os.PathLike[str], root_joint: pin.JointModel | None, package_dirs: Folders) -> UrdfFile:
    """Model, collision geometries and couplings of a URDF file; see `Scene.from_urdf`.

    Raises:
        SceneError: the file is missing or is not a URDF, something in it cannot be read or cannot be, or a mesh is not
            found.
    """
    path, robot = _robot(path)
    check_elements(path.name, robot)
    unknown = leave_out_unknown(robot)
    check_inertials(path.name, robot)
    _check_leaders(path.name, robot)
    _resolve_meshes(path, robot, package_dirs, "collision")
    # what is only read here does not need its meshes: contacts and pictures load those that they use
    meshes = take_meshes(path.name, robot)
    text = ElementTree.tostring(_without_visuals(robot), encoding="unicode")
    joint = () if root_joint is None else (_checked_root(root_joint),)
    try:
        model = pin.buildModelFromXML(text, *joint)
        geometries = _geometries(model, text, pin.GeometryType.COLLISION)
        for name, (file, scale) in meshes.items():
            make_pending(geometries.geometryObjects[geometries.getGeometryId(name)], file, scale)
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"{path.name} cannot be read: {error}") from error
    unread = _write_reductions(robot, model)
    return UrdfFile(
        model,
        geometries,
        _mimics(path.name, robot, model),
        contents(robot, model, [file for file, _ in meshes.values()]) + unknown + unread,
    )


def _checked_root(joint: Any) -> pin.JointModel:
    try:
        return pin.JointModel(joint)
    except TypeError as error:  # as Boost.Python's errors of arguments are
        said = f"root_joint = {joint!r}: expected a joint such as pin.JointModelFreeFlyer(), or None for a fixed base"
        raise SceneError(said) from error


def read_urdf_visuals(path: str | os.PathLike[str], package_dirs: Folders) -> tuple[pin.Model, pin.GeometryModel]:
    """The model of a file on a fixed base, and its visual geometries.

    Raises:
        SceneError: as of `read_urdf`.
    """
    path, robot = _robot(path)
    _resolve_meshes(path, robot, package_dirs, "visual")
    text = ElementTree.tostring(robot, encoding="unicode")
    try:
        model = pin.buildModelFromXML(text)
        return model, _geometries(model, text, pin.GeometryType.VISUAL)
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"{path.name} cannot be drawn: {error}") from error


def _without_visuals(robot: Element) -> Element:
    """The same tree without what is only drawn, which takes Pinocchio longer to read than the rest."""
    found = ElementTree.Element(robot.tag, robot.attrib)
    for part in robot:
        if part.tag == "link":
            link = ElementTree.Element(part.tag, part.attrib)
            link.extend(x for x in part if x.tag != "visual")
            part = link
        found.append(part)
    return found


def _geometries(model: pin.Model, text: str, kind: pin.GeometryType) -> pin.GeometryModel:
    loader = coal.CachedMeshLoader()  # robots use one file for several links
    return in_metres(pin.buildGeomFromUrdfString(model, text, kind, package_dirs=[], mesh_loader=loader))


def _robot(path: str | os.PathLike[str]) -> tuple[Path, Element]:
    """The resolved path of a URDF and its root element, xacro expanded.

    Raises:
        SceneError: it is missing, not XML, another format, or has expressions that are not expanded.
    """
    path = checks.path("path of a URDF file", path).resolve()
    if not path.is_file():
        raise SceneError(f"no URDF file at {path}")
    try:
        robot = ElementTree.fromstring(path.read_bytes())
    except ElementTree.ParseError as error:
        raise SceneError(f"{path.name} cannot be read, it is not XML: {error}") from error
    if robot.tag == "sdf":
        raise SceneError(f"{path.name} is an SDF file, which is not read: convert it to URDF or MJCF first")
    if robot.tag in ("mujoco", "mujocoinclude"):
        raise SceneError(f"{path.name} is an MJCF file: read it with Scene.from_mjcf")
    if robot.tag != "robot":
        raise SceneError(f"{path.name} is not a URDF: its root is <{robot.tag}>, not <robot>")
    if any(element.tag.startswith(XACRO) for element in robot.iter() if isinstance(element.tag, str)):
        robot = ElementTree.fromstring(_expanded(path))
    _check_expressions(path.name, robot)
    return path, robot


def _expanded(path: Path) -> str:
    """The text of a xacro file without macros.

    Raises:
        SceneError: xacro is not installed, or fails.
    """
    try:
        from xacrodoc import XacroDoc
    except ImportError as error:
        raise SceneError(
            f"{path.name} is a xacro file: pip install 'ngalpha-pin[xacro]', or run `xacro {path.name} > robot.urdf` "
            "first and read its output"
        ) from error
    try:
        return str(XacroDoc.from_file(str(path)).to_urdf_string())
    except Exception as error:  # xacro raises many kinds
        raise SceneError(f"{path.name}: xacro fails with {error!r}") from error


def _check_expressions(name: str, robot: Element) -> None:
    """No expression of xacro is left in an attribute.

    Raises:
        SceneError: there is one; it names the link or joint.
    """
    for part in robot:
        for element in part.iter():
            for key, value in element.attrib.items():
                if "${" in value or "$(" in value:
                    raise SceneError(
                        f"{name}: {part.tag} {part.get('name')!r} has {key}={value!r} in <{element.tag}>, an "
                        "expression of xacro that is not expanded: run xacro on its source"
                    )


def _resolve_meshes(path: Path, robot: Element, package_dirs: Folders, kind: str) -> None:
    """Write the file of every mesh of a kind, "collision" or "visual", as an absolute path.

    Raises:
        SceneError: a mesh is not found; it names the link.
    """
    known: dict[str, Path | None] = {}
    for link in robot.findall("link"):
        for mesh in (m for shape in link.findall(kind) for m in shape.iter("mesh")):
            uri = mesh.get("filename", "")
            if uri not in known:
                known[uri] = find_mesh(uri, path, package_dirs)
            found = known[uri]
            if found is None:
                raise SceneError(
                    f"{path.name}: link {link.get('name')!r}: there is no mesh {uri!r}; meshes are looked up beside "
                    "the file and in package_dirs"
                )
            mesh.set("filename", str(found))


def _check_leaders(name: str, robot: Element) -> None:
    """What a joint mimics is a joint of the file that can move.

    Raises:
        SceneError: it is not.
    """
    moving = {joint.get("name") for joint in robot.findall("joint") if joint.get("type") != "fixed"}
    for joint in robot.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") != "fixed" and mimic.get("joint") not in moving:
            raise SceneError(
                f"{name}: joint {joint.get('name')!r} mimics {mimic.get('joint')!r}, which is not a joint that moves"
            )


def _mimics(name: str, robot: Element, model: pin.Model) -> list[JointCoupling]:
    """A coupling for every joint that mimics another one and can move.

    Raises:
        SceneError: its numbers cannot be read.
    """
    found = []
    for joint in robot.findall("joint"):
        mimic, follower = joint.find("mimic"), joint.get("name", "")
        if mimic is None or not model.existJointName(follower):
            continue
        leader = mimic.get("joint", "")
        try:
            offset, factor = float(mimic.get("offset") or 0.0), float(mimic.get("multiplier") or 1.0)
        except ValueError as error:
            raise SceneError(f"{name}: the mimic of joint {follower!r} has numbers that cannot be read") from error
        found.append(JointCoupling(follower, leader, (offset, factor), name=f"{follower} mimics {leader}"))
    return found


def _write_reductions(robot: Element, model: pin.Model) -> list[Entry]:
    """Mechanical reductions of the transmissions, as `model.rotorGearRatio`; returned are those that cannot be read.

    These are no reason to refuse a file: without an inertia of a rotor, which URDF has no word for, they move nothing.
    """
    ratios, unread = np.array(model.rotorGearRatio), []
    for transmission in robot.findall("transmission"):
        reductions = [e.text or "" for e in transmission.iter("mechanicalReduction")]
        joints = [e.get("name") or "" for e in transmission.findall("joint")]
        if len(reductions) != 1 or len(joints) != 1 or not model.existJointName(joints[0]):
            continue
        j = model.getJointId(joints[0])
        try:
            ratios[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = float(reductions[0])
        except ValueError:
            unread.append(f"joint {joints[0]!r}: {reductions[0]!r}")
    model.rotorGearRatio = ratios
    what = "mechanical reductions that are not numbers"
    return [Entry(what, len(unread), "left out", listed(unread))] if unread else []
