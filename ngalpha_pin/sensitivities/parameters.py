"""Parameters of a scene by their names: their values, a scene with other ones, and what they change in a step."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.scene.joint_pd import JointPD
from ngalpha_pin.scene.names import matching
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.scene.variants import copied
from ngalpha_pin.sensitivities.columns import Columns, Gain
from ngalpha_pin.system.system import System

COEFFICIENTS, GAINS = ("mu", "e_N", "e_F"), ("kp", "kd")
BODIES = ("mass", "inertia")
KINDS = (*COEFFICIENTS, *GAINS, *BODIES, "placement")
INERTIA = ("mass", "mass x", "mass y", "mass z", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
MOVED = 1e-3  # way of a geometry that shows which points and planes are its own [m]


@dataclass(frozen=True, eq=False)
class Parameter:
    """One of `KINDS`, of what a name or a pattern says.

    Attributes:
        name: as it was given.
        kind: one of `KINDS`.
        of: name of a body or geometry, or a pattern.
        labels: of its columns.
        values: now, shape (n,).
    """

    name: str
    kind: str
    of: str
    labels: tuple[str, ...]
    values: np.ndarray


def parameters_of(scene: Scene, names: Sequence[str]) -> tuple[Parameter, ...]:
    """The parameters of those names.

    Raises:
        SceneError: a name says nothing, or its parameter has no derivative in this scene.
    """
    if isinstance(names, str) or not isinstance(names, Sequence):
        raise checks.fail("parameters", names, 'a list of names such as ("mu[foot*]", "mass[body]", "kp")')
    found = tuple(_parameter(scene, name) for name in names)
    labels = [label for parameter in found for label in parameter.labels]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise SceneError(f"parameters: {twice!r} is there twice")
    return found


def scene_with(scene: Scene, parameters: Sequence[Parameter], values: np.ndarray) -> Scene:
    """The scene with other values of its parameters, shape (n,) of all of their columns."""
    new, at = copied(scene), 0
    new.model = scene.model.copy()
    for parameter in parameters:
        value = values[at : at + len(parameter.labels)]
        at += len(parameter.labels)
        new = _with_value(new, parameter, value)
    found: Scene = new
    return found


def columns_of(
    system: System, scene: Scene, parameters: Sequence[Parameter], torques: int, p: int, first: int
) -> Columns:
    """What some columns change: from `first` on those of the torques of each coordinate, then those of parameters.

    Args:
        system: compiled scene.
        scene: of the system.
        parameters: in order.
        torques: number of coordinates with a torque, or none.
        p: number of columns.
        first: number of those of the start.
    """
    columns = Columns(p)
    if torques:
        columns.tau = np.zeros((torques, p))
        columns.tau[np.arange(torques), first + np.arange(torques)] = 1.0
    at = first + torques
    for parameter in parameters:
        where = slice(at, at + len(parameter.labels))
        if parameter.kind in COEFFICIENTS:
            _add_coefficient(columns, system, scene, parameter, at)
        elif parameter.kind in GAINS:
            _add_gain(columns, scene, parameter, at)
        elif parameter.kind in BODIES:
            _add_inertia(columns, scene, parameter, at)
        else:
            _add_placement(columns, system, scene, parameter, where)
        at = where.stop
    return columns


def _parameter(scene: Scene, name: Any) -> Parameter:
    parts = re.fullmatch(r"(\w+)(?:\[(.+)\])?", name) if isinstance(name, str) else None
    if (
        parts is None
        or parts[1] not in KINDS
        or (parts[2] is None) != (parts[1] in GAINS)
        and parts[1] not in COEFFICIENTS
    ):
        raise checks.fail(
            "parameters", name, "mu[...], e_N[...], e_F[...], mass[...], inertia[...], placement[...], kp or kd"
        )
    kind, of = parts[1], parts[2] or "*"
    if kind in COEFFICIENTS:
        return Parameter(name, kind, of, (name,), np.array([_coefficient(scene, name, kind, of)]))
    if kind in GAINS:
        return Parameter(name, kind, of, (name,), np.array([_gain(scene, name, kind)]))
    if kind in BODIES:
        inertia = scene.model.inertias[_joint(scene, name, of)]
        if kind == "mass":
            return Parameter(name, kind, of, (name,), np.array([inertia.mass]))
        labels = tuple(f"{name} {entry}" for entry in INERTIA)
        return Parameter(name, kind, of, labels, np.array(inertia.toDynamicParameters()))
    names = [geometry.name for geometry in scene.declared_shapes.geometryObjects]
    if of not in names:
        raise UnknownName("geometry", of, names)
    placement = scene.declared_shapes.geometryObjects[names.index(of)].placement
    return Parameter(name, kind, of, tuple(f"{name} {x}" for x in "xyz"), np.array(placement.translation))


def _coefficient(scene: Scene, name: str, kind: str, of: str) -> float:
    """The value that all contacts of a pattern have."""
    geometries = sorted({g for pair in scene.contacts for g in (pair.geometry_a, pair.geometry_b)})
    if not geometries:
        raise SceneError(f"{name}: the scene has no contacts")
    own = set(matching("geometry with contacts", of, geometries))
    laws = [pair.law for pair in scene.contacts if pair.key & own]
    if kind == "mu" and any(law.curve is not None for law in laws):
        raise SceneError(f"{name}: the coefficient is a curve over the speed of slip, whose numbers are no parameters")
    values = {float(getattr(law, kind)) for law in laws}
    if len(values) > 1:
        listed = ", ".join(f"{value:g}" for value in sorted(values))
        raise SceneError(f"{name}: its contacts have different values ({listed}); name them one by one")
    value = values.pop()
    if kind == "mu" and value == 0.0:
        raise SceneError(f"{name} is zero: a contact without friction has no derivative by mu; start from a small one")
    return value


def _gain(scene: Scene, name: str, kind: str) -> float:
    gains = [force.gains[GAINS.index(kind)] for force in scene.forces if isinstance(force, JointPD)]
    if not gains:
        raise SceneError(f"{name}: the scene has no JointPD")
    values = {float(x) for gain in gains for x in np.ravel(gain)}
    if len(values) > 1:
        raise SceneError(f"{name}: joints have different gains; give JointPD one number to differentiate by it")
    return values.pop()


def _joint(scene: Scene, name: str, body: str) -> int:
    model = scene.model
    frames = [f.parentJoint for f in model.frames if f.name == body]
    joint = frames[0] if frames else model.getJointId(body) if model.existJointName(body) else None
    if joint is None:
        raise UnknownName("body or joint", body, [f.name for f in model.frames])
    if joint == 0 or not model.inertias[joint].mass > 0.0:
        raise SceneError(f"{name}: it is fixed to the world or has no mass")
    if any(type(force).__name__ == "Gravity" for force in scene.forces):
        raise SceneError(f"{name}: a scene with a Gravity of its own has no derivatives by masses; set model.gravity")
    return int(joint)


def _with_value(scene: Any, parameter: Parameter, value: np.ndarray) -> Any:
    if parameter.kind in COEFFICIENTS:
        return scene.varied(**{parameter.kind: {parameter.of: float(value[0])}})
    if parameter.kind in GAINS:
        return scene.varied(**{parameter.kind: float(value[0])})
    if parameter.kind == "mass":
        return scene.varied(mass={parameter.of: float(value[0])})
    if parameter.kind == "inertia":
        scene.model.inertias[_joint(scene, parameter.name, parameter.of)] = pin.Inertia.FromDynamicParameters(value)
        return scene
    return _moved(scene, parameter.of, value)


def _moved(scene: Any, geometry: str, translation: np.ndarray) -> Any:
    """The scene with a geometry elsewhere in its body."""
    new = copied(scene)
    objects = new.declared_shapes.geometryObjects
    i = [x.name for x in objects].index(geometry)
    objects[i].placement = pin.SE3(objects[i].placement.rotation, translation)
    return new


def _add_coefficient(columns: Columns, system: System, scene: Scene, parameter: Parameter, column: int) -> None:
    """The contacts of the pattern are those whose coefficient differs in a scene with another value."""
    other = 0.5 if parameter.values[0] != 0.5 else 0.25
    table = System(scene_with(scene, [parameter], np.array([other]))).contacts
    now = getattr(system.contacts, parameter.kind)
    array = getattr(columns, parameter.kind)
    array = np.zeros((len(now), columns.p)) if array is None else array
    array[:, column] = getattr(table, parameter.kind) != now
    setattr(columns, parameter.kind, array)


def _add_gain(columns: Columns, scene: Scene, parameter: Parameter, column: int) -> None:
    changed = scene_with(scene, [parameter], parameter.values + 1.0)
    for law, other in zip(scene.forces, changed.forces, strict=True):
        if isinstance(law, JointPD) and isinstance(other, JointPD):
            columns.gains.append(Gain(column, law, other))


def _add_inertia(columns: Columns, scene: Scene, parameter: Parameter, column: int) -> None:
    joint = _joint(scene, parameter.name, parameter.of)
    if parameter.kind == "mass":
        inertia = scene.model.inertias[joint]
        columns.inertias.append((column, joint, np.array(inertia.toDynamicParameters()) / inertia.mass))
        return
    columns.inertias += [(column + i, joint, direction) for i, direction in enumerate(np.eye(10))]


def _add_placement(columns: Columns, system: System, scene: Scene, parameter: Parameter, where: slice) -> None:
    """Points and planes of a geometry are those that move with it."""
    table = system.contacts
    if columns.points is None or columns.planes is None:
        columns.points, columns.planes = np.zeros((2, table.n, 3, columns.p))
    if scene.beams or any(parameter.of in re.split("/", pair.name) for pair in system.slots.pairs):
        raise SceneError(
            f"{parameter.name}: derivatives by placements are those of points and spheres on planes; features of "
            "shapes and beams have none"
        )
    for i, axis in enumerate(np.eye(3)):
        other = System(_moved(scene, parameter.of, parameter.values + MOVED * axis)).contacts
        if other.n != table.n or not np.array_equal(other.centre, table.centre):
            raise SceneError(f"{parameter.name}: derivatives by placements of round surfaces are not there")
        n = table.n_points
        columns.points[:n, :, where.start + i] = (other.point - table.point) / MOVED
        columns.planes[:n, :, where.start + i] = table.normal * ((other.offset - table.offset) / MOVED)[:, None]
        if (columns.points[:n][table.curved].any()) or columns.planes[:n][table.curved].any():
            raise SceneError(f"{parameter.name}: derivatives by placements are those of points on planes")
