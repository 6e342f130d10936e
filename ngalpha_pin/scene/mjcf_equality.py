"""The equality constraints of an MJCF file: connect, weld and joint.

They are read from the file itself: of several constraints without a name Pinocchio 4.1 keeps one, it takes constraints
that are switched off for active ones, leaves out those between joints, and puts anchors to the joint instead of the
body where the two frames differ.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.scene.constraints import WORLD, Constraint, JointCoupling, JointTrajectory, PointJoint, Weld
from ngalpha_pin.scene.protocols import Declared


def equality_constraints(scene: Declared, path: Path) -> list[Constraint]:
    """The active constraints of the file, in its order.

    Raises:
        SceneError: a constraint is of another kind, between sites, or its numbers cannot be read; it is named.
        UnknownName: a body or joint is not there.
    """
    found: list[Constraint] = []
    for section in ElementTree.parse(path).getroot().iter("equality"):
        for element in section:
            if element.get("active", "true") == "false":
                continue
            read = READERS.get(element.tag)
            name = element.get("name") or f"{element.tag} {len(found)}"
            if read is None or element.get("site1"):
                what = "between sites" if read else f"of the kind <{element.tag}>"
                raise SceneError(f"{path.name}: equality {name!r} {what} is not supported; constraints=False leaves it")
            found.append(read(scene, element, name))
    return found


def _connect(scene: Declared, element: ElementTree.Element, name: str) -> Constraint:
    """The anchor, given in body1, is where it is in body2 at the configuration of the file."""
    a, b = _bodies(element)
    anchor = pin.SE3(np.eye(3), _numbers(element, "anchor", name, 3))
    return PointJoint(a, b, placement_a=anchor, placement_b=_between(scene, a, b).inverse() * anchor, name=name)


def _weld(scene: Declared, element: ElementTree.Element, name: str) -> Constraint:
    """With the pose of body2 in body1 that is given, or the one of the file where the quaternion is zero."""
    a, b = _bodies(element)
    pose = _numbers(element, "relpose", name, 7) if element.get("relpose") else np.zeros(7)
    if pose[3:].any():
        w, x, y, z = pose[3:]
        relative = pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), pose[:3])
    else:
        relative = _between(scene, a, b)
    return Weld(a, b, placement_a=relative, name=name)


def _joint(scene: Declared, element: ElementTree.Element, name: str) -> Constraint:
    """A polynomial in the displacement of joint2 gives that of joint1; without joint2 it is constant."""
    model, q0 = scene.model, _reference(scene.model)
    terms = _numbers(element, "polycoef", name, None) if element.get("polycoef") else np.array([0.0, 1.0])
    joint, leader = element.get("joint1", ""), element.get("joint2")
    start = q0[_coordinate(model, joint, name)]
    if leader is None:
        return JointTrajectory(joint, lambda t: (start + terms[0], 0.0, 0.0), name=name)
    shift = np.polynomial.Polynomial((-q0[_coordinate(model, leader, name)], 1.0))
    return JointCoupling(joint, leader, (start + np.polynomial.Polynomial(terms)(shift)).coef, name=name)


READERS: dict[str, Callable[[Declared, ElementTree.Element, str], Constraint]] = {
    "connect": _connect,
    "weld": _weld,
    "joint": _joint,
}


def _bodies(element: ElementTree.Element) -> tuple[str, str]:
    return element.get("body1", WORLD), element.get("body2", WORLD)


def _between(scene: Declared, a: str, b: str) -> pin.SE3:
    """Pose of body b in body a at the configuration of the file."""
    data = scene.model.createData()
    pin.forwardKinematics(scene.model, data, _reference(scene.model))
    poses = []
    for body in (a, b):
        if body == WORLD:
            poses.append(pin.SE3.Identity())
            continue
        frame = scene.frame(body)
        poses.append(data.oMi[frame.parentJoint] * frame.placement)
    return poses[0].inverse() * poses[1]


def _reference(model: pin.Model) -> np.ndarray:
    """The configuration in which the bodies stand in the file, shape (nq,)."""
    named = model.referenceConfigurations
    return np.array(named["qpos0"]) if "qpos0" in named else pin.neutral(model)


def _coordinate(model: pin.Model, joint: str, name: str) -> int:
    """Place of the coordinate of a joint in q."""
    if not model.existJointName(joint):
        raise UnknownName("joint", joint, list(model.names)[1:])
    index = model.getJointId(joint)
    if model.nqs[index] != 1:
        raise SceneError(f"{name}: joint {joint!r} has {model.nqs[index]} coordinates, only one is possible")
    return int(model.idx_qs[index])


def _numbers(element: ElementTree.Element, key: str, name: str, n: int | None) -> np.ndarray:
    text = element.get(key, "")
    try:
        numbers = np.array([float(x) for x in text.split()])
    except ValueError as error:
        raise SceneError(f"{name}: {key} = {text!r} is not a list of numbers") from error
    if n not in (None, len(numbers)) or not np.isfinite(numbers).all():
        raise SceneError(f"{name}: {key} = {text!r} must be {n or 'some'} finite numbers")
    return numbers
