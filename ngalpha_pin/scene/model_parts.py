"""A scene from parts: models, free bodies and fixed ones that are put together, and taken away again."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.flexible.rod import Rod
from ngalpha_pin.scene.constraints import FrameTrajectory
from ngalpha_pin.scene.contact import ContactPair
from ngalpha_pin.scene.model_merge import merged, moved_geometries
from ngalpha_pin.scene.protocols import Editable
from ngalpha_pin.scene.strands import StrandForce, joints_of

WORLD = "world"
# of forces and constraints: names of frames, joints and geometries, and their own
NAMED = ("frame_a", "frame_b", "frame", "joint", "leader", "joints", "body", "surface", "name")
# what is a function of all coordinates does not go from one model to another
OF_ALL = ("q_ref", "law", "function")


def part_of(source: Any, root_joint: pin.JointModel | None, kind: Any) -> Any:
    """What `Scene.add_model` adds, as a scene of its own.

    Args:
        source: path of a file, a model or a scene.
        root_joint: of a URDF file.
        kind: `Scene`.

    Raises:
        SceneError: it is none of the possible kinds, or the root joint does not go with it.
    """
    if isinstance(source, (str, os.PathLike)):
        if is_mjcf(Path(source)):
            if root_joint is not None:
                raise SceneError("root_joint is for URDF files; an MJCF file says itself how its root moves")
            return kind.from_mjcf(source)
        return kind.from_urdf(source, root_joint)
    if root_joint is not None:
        raise SceneError("root_joint is for URDF files; a model has its root joint already")
    if isinstance(source, pin.Model):
        return kind(source)
    if isinstance(source, kind):
        return source
    raise SceneError(f"add_model takes the path of a URDF or MJCF file, a pin.Model or a Scene, not {source!r}")


def is_mjcf(path: Path) -> bool:
    """Whether a file is MJCF, by its root element.

    Raises:
        SceneError: it is missing or not XML.
    """
    if not path.is_file():
        raise SceneError(f"no file at {path}")
    try:
        return next(ElementTree.iterparse(path, ["start"]))[1].tag == "mujoco"
    except (ElementTree.ParseError, StopIteration) as error:
        raise SceneError(f"{path.name} cannot be read, it is not XML") from error


def put_together(scene: Editable, part: Editable, prefix: str, on: str | None, placement: pin.SE3) -> None:
    """Add a part to a scene.

    Raises:
        SceneError: a name is taken, the scene or the part has beams, or a force or constraint of either is a function
            of all of its coordinates. UnknownName: there is no frame to carry it.
    """
    if scene.beams or part.beams:
        raise SceneError("add models before beams, whose coordinates follow those of the model")
    if scene.states or part.states or not all(own.by_names for own in (*scene.unilaterals, *part.unilaterals)):
        raise SceneError("add models before states and unilateral constraints, whose functions have all coordinates")
    for declared in (*scene.forces, *scene.constraints, *part.forces, *part.constraints):
        _check_goes_along(declared)
    joint, at = 0, placement
    if on is not None:
        joint, at = int(scene.frame(on).parentJoint), scene.frame(on).placement * placement
    _check_names(scene, part, prefix)
    model, place = merged(scene.model, part.model, joint, at, prefix)
    geometries = pin.GeometryModel()
    for k, (one, pre) in enumerate(((scene, ""), (part, prefix))):
        for geometry in moved_geometries(one.declared_shapes, place, k, at, pre):
            geometries.addGeometryObject(geometry)
    visuals = _visuals(scene, part, place, at, prefix)
    scene.model, scene.declared_shapes, scene.visuals = model, geometries, visuals
    scene.contacts += [ContactPair(prefix + p.geometry_a, prefix + p.geometry_b, p.law, p.found) for p in part.contacts]
    scene.surfaces |= {prefix + name: law for name, law in part.surfaces.items()}
    scene.hollow |= {prefix + name for name in part.hollow}
    scene.disabled |= {frozenset(prefix + name for name in pair) for pair in part.disabled}
    scene.complete += [frozenset(prefix + name for name in names) for names in part.complete]
    scene.added += [prefix + name for name in part.added]
    scene.contents += part.contents
    scene.visual_files += [file.moved(prefix, on, placement) for file in part.visual_files]
    scene.constraints += [moved(constraint, prefix, on or WORLD, placement) for constraint in part.constraints]
    scene.forces += [moved(force, prefix, on or WORLD, placement) for force in part.forces]
    scene.unilaterals += [own.moved(prefix, on or WORLD, placement) for own in part.unilaterals]
    check_again(scene)


def _visuals(
    scene: Editable, part: Editable, place: dict[tuple[int, int], int], at: pin.SE3, prefix: str
) -> pin.GeometryModel | None:
    """What both draw that is no file; of the one that draws nothing, its shapes for contact."""
    found = pin.GeometryModel()
    for k, (one, start) in enumerate(((scene, ""), (part, prefix))):
        if one.visuals is None and not one.visual_files:
            scene.added += [start + g.name for g in one.declared_shapes.geometryObjects if g.name not in one.added]
        elif one.visuals is not None:
            for geometry in moved_geometries(one.visuals, place, k, at, start):
                found.addGeometryObject(geometry)
    return found if found.ngeoms else None


def check_again(scene: Editable) -> None:
    """Look up the joints and frames of every force and constraint in a model that has changed."""
    for declared in _declared(scene):
        declared.check(scene)


def _declared(scene: Editable) -> list[Any]:
    """What is looked up in the model by names."""
    return [*scene.constraints, *scene.forces, *scene.states, *scene.unilaterals]


def _check_goes_along(declared: Any) -> None:
    if any(hasattr(declared, name) for name in OF_ALL):
        raise SceneError(
            f"{type(declared).__name__} is a function of all coordinates: put the models together first, then add it"
        )


def _check_names(scene: Editable, part: Editable, prefix: str) -> None:
    taken = {f.name for f in list(scene.model.frames)[1:]} | set(list(scene.model.names)[1:])
    new = {prefix + f.name for f in list(part.model.frames)[1:]} | {prefix + n for n in list(part.model.names)[1:]}
    shapes = {g.name for g in scene.declared_shapes.geometryObjects}
    clash = (taken & new) | (shapes & {prefix + g.name for g in part.declared_shapes.geometryObjects})
    constraints = {c.name for c in (*scene.constraints, *scene.unilaterals)}
    clash |= constraints & {prefix + c.name for c in (*part.constraints, *part.unilaterals)}
    if clash:
        raise SceneError(f"the scene has something named {min(clash)!r} already; give the part a prefix of its own")


def moved(declared: Any, prefix: str, on: str, placement: pin.SE3) -> Any:
    """A copy of a force or constraint for a scene in which its model is a part.

    Args:
        declared: of the part.
        prefix: of the names of the part.
        on: frame of the scene that carries the world of the part.
        placement: of that world in the frame.

    Raises:
        SceneError: it gives a motion in the world, and the frame is none of the world.
    """
    found = copy.copy(declared)
    if isinstance(declared, FrameTrajectory):
        if on != WORLD:
            raise SceneError(f"{declared.name}: its poses are in the world; add it after the parts are together")
        found.pose = partial(_carried, placement, declared.pose)
    if hasattr(declared, "placements"):
        ends = zip((declared.frame_a, declared.frame_b), declared.placements, strict=True)
        found.placements = tuple(placement * pose if frame == WORLD else pose for frame, pose in ends)
    for key in NAMED:
        value = getattr(declared, key, None)
        if isinstance(value, str):
            setattr(found, key, on if value == WORLD else prefix + value)
        elif isinstance(value, Mapping):
            setattr(found, key, {prefix + name: factor for name, factor in value.items()})
    if hasattr(declared, "ends"):  # of a spring
        found.ends = moved(declared.ends, prefix, on, placement)
    return found


def _carried(placement: pin.SE3, pose: Callable[[float], Any], t: float) -> Any:
    """A given pose, or it with its rates, which are in the axes of the frame, where its world is placed."""
    given = pose(t)
    return (placement * given[0], *given[1:]) if isinstance(given, tuple) else placement * given


def body_model(
    name: str, shape: Any, mass: float | None, density: float | None, joint_model: pin.JointModel | None = None
) -> pin.Model:
    """A body that moves freely, or as a joint lets it, with the inertia of its shape.

    Raises:
        SceneError: not one of mass and density is given, it is not a positive number, the shape has no volume, or the
            joint is none.
    """
    checks.name("body", name)
    if (mass is None) == (density is None):
        raise SceneError(f"body {name!r} takes either its mass [kg] or its density [kg/m^3]")
    what = "density" if mass is None else "mass"
    given = checks.number(f"body {name!r}: {what}", density if mass is None else mass, 0.0, above=True)
    try:
        volume = float(shape.computeVolume())
    except (AttributeError, RuntimeError):
        volume = 0.0
    if not (np.isfinite(volume) and volume > 0):
        raise SceneError(f"body {name!r}: a {type(shape).__name__} has no volume, so that no inertia follows from it")
    density = given / volume if mass is not None else given
    inertia = pin.Inertia(
        density * volume, np.array(shape.computeCOM()).ravel(),
        density * np.array(shape.computeMomentofInertiaRelatedToCOM()),
    )  # fmt: skip
    model, joint_model = pin.Model(), pin.JointModelFreeFlyer() if joint_model is None else joint_model
    try:
        joint = model.addJoint(0, joint_model, pin.SE3.Identity(), name)
    except TypeError:
        raise SceneError(
            f"body {name!r}: joint must be a joint of pin, as pin.JointModelRX(), not {joint_model!r}"
        ) from None
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame(name, joint, pin.SE3.Identity(), pin.FrameType.BODY), False)
    return model


def taken_away(scene: Editable, name: str) -> None:
    """Remove what has a name: a constraint, a force, a body with all it carries, or a geometry with its contacts.

    Raises:
        UnknownName: there is none. SceneError: a force or constraint needs it.
    """
    checks.name("name of what is removed", name)
    strand = next((force for force in scene.forces if isinstance(force, StrandForce) and force.name == name), None)
    if strand is not None:
        _without_strand(scene, strand)
        return
    lists: tuple[list[Any], ...] = (scene.constraints, scene.forces, scene.unilaterals)
    for declared in lists:
        left = [x for x in declared if getattr(x, "name", None) != name]
        if len(left) < len(declared):
            declared[:] = left
            return
    if scene.model.existJointName(name) or any(
        f.name == name and f.type == pin.FrameType.BODY and f.parentJoint for f in scene.model.frames
    ):
        _without_body(scene, name)
        return
    geometries = [g.name for g in scene.declared_shapes.geometryObjects]
    if name not in geometries:
        others = [c.name for c in scene.constraints] + list(scene.model.names)[1:]
        raise UnknownName("constraint, force, body or geometry", name, geometries + others)
    scene.declared_shapes.removeGeometryObject(name)
    _forget_geometries(scene)


def _without_strand(scene: Editable, law: StrandForce) -> None:
    """Take a rod or cable away with its loads, and then its nodes."""
    forces = scene.forces
    scene.forces = [force for force in forces if getattr(force, "strand", None) is not law.strand]
    try:
        _without_body(scene, *joints_of(law.name, law.strand)[:: 2 if isinstance(law.strand, Rod) else 1])
    except SceneError:
        scene.forces = forces
        check_again(scene)
        raise


def _without_body(scene: Editable, *names: str) -> None:
    if scene.beams:
        raise SceneError("remove bodies before beams are added, whose coordinates follow those of the model")
    if scene.states or not all(own.by_names for own in scene.unilaterals):
        raise SceneError("remove bodies before states and unilateral constraints, whose functions have all coordinates")
    model = scene.model
    joints = [model.getJointId(n) if model.existJointName(n) else int(scene.frame(n).parentJoint) for n in names]
    before = scene.model, scene.declared_shapes, scene.visuals
    new, place = merged(model, None, 0, pin.SE3.Identity(), without=joints)
    geometries = pin.GeometryModel()
    for geometry in moved_geometries(scene.declared_shapes, place, 0, pin.SE3.Identity()):
        geometries.addGeometryObject(geometry)
    scene.model, scene.declared_shapes = new, geometries
    if scene.visuals is not None:
        scene.visuals = pin.GeometryModel()
        for geometry in moved_geometries(before[2], place, 0, pin.SE3.Identity()):
            scene.visuals.addGeometryObject(geometry)
    for declared in _declared(scene):
        try:
            declared.check(scene)
        except SceneError as error:
            scene.model, scene.declared_shapes, scene.visuals = before
            check_again(scene)
            who = f"{type(declared).__name__} {getattr(declared, 'name', '')}".strip()
            raise SceneError(f"{names[0]!r} cannot be removed: {who} needs it: {error}") from error
    _forget_geometries(scene)


def _forget_geometries(scene: Editable) -> None:
    """Take contacts and properties of geometries that are gone out of the scene."""
    names: Sequence[str] = [g.name for g in scene.declared_shapes.geometryObjects]
    there = set(names)
    scene.contacts = [pair for pair in scene.contacts if pair.key <= there]
    scene.surfaces = {name: law for name, law in scene.surfaces.items() if name in there}
    scene.hollow &= there
    scene.disabled = {pair for pair in scene.disabled if pair <= there}
    scene.added = [name for name in scene.added if name in there]
