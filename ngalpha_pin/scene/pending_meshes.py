"""Meshes that a file declares and that are loaded when something asks for their shape.

Until then a geometry has the path and scale of its mesh and an empty shape, in whatever model it is copied to. What
contact has asked for has no tree for distances, which is made where somebody asks for the geometry itself.
"""

from __future__ import annotations

from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.scene.meshes import is_pending, load_mesh, searchable
from ngalpha_pin.scene.model_checks import checked_shape

CONVERTED = "collision_checking"  # of a link, which Pinocchio reads its shapes by


def load_pending(geometries: pin.GeometryModel, name: str | None = None) -> None:
    """Load meshes in place, each file once.

    Args:
        geometries: with meshes that are pending.
        name: of the geometry whose mesh is needed; those of the same file and scale share it. None is all of them.

    Raises:
        SceneError: a file cannot be read, or has no shape.
    """
    chosen = [g for g in geometries.geometryObjects if name in (None, g.name) and is_pending(g)]
    wanted = {_source(g): g.name for g in reversed(chosen)}
    loaded: dict[tuple[str, bytes], coal.CollisionGeometry] = {}
    for geometry in geometries.geometryObjects if wanted else ():
        if not is_pending(geometry) or (source := _source(geometry)) not in wanted:
            continue
        if source not in loaded:
            loaded[source] = _loaded(geometry)
        if not isinstance(loaded[source], coal.BVHModelBase):  # a plate of a flat mesh, which no file has
            geometry.meshPath, geometry.meshScale = "", np.ones(3)
        geometry.geometry = loaded[source]


def loaded(geometries: pin.GeometryModel, name: str) -> pin.GeometryObject:
    """The geometry of a name, with its mesh as contact takes it.

    Raises:
        UnknownName: there is none. SceneError: as of `load_pending`.
    """
    if not geometries.existGeometryName(checks.name("geometry", name)):
        raise UnknownName("geometry", name, [g.name for g in geometries.geometryObjects])
    found = geometries.geometryObjects[geometries.getGeometryId(name)]
    if is_pending(found):
        load_pending(geometries, name)
    return found


def make_searchable(geometries: pin.GeometryModel, name: str | None = None) -> None:
    """Load meshes as `load_pending`, and give them the tree that coal's distances need, in place.

    Those of the same file and scale share it.
    """
    load_pending(geometries, name)
    light = [g for g in geometries.geometryObjects if g.meshPath and _is_light(g.geometry)]
    wanted = {_source(g) for g in light if name in (None, g.name)}
    made: dict[tuple[str, bytes], coal.BVHModelOBBRSS] = {}
    for geometry in light:
        if (source := _source(geometry)) in wanted:
            if source not in made:
                made[source] = searchable(geometry.geometry)
            geometry.geometry = made[source]


def _is_light(shape: coal.CollisionGeometry) -> bool:
    return isinstance(shape, coal.BVHModelBase) and shape.getNodeType() == coal.NODE_TYPE.BV_AABB


def _source(geometry: pin.GeometryObject) -> tuple[str, bytes]:
    return geometry.meshPath, np.asarray(geometry.meshScale, dtype=float).tobytes()


def _loaded(geometry: pin.GeometryObject) -> coal.CollisionGeometry:
    try:
        mesh = load_mesh(geometry.meshPath, geometry.meshScale)
    except (ValueError, RuntimeError, OSError) as error:
        said = f"geometry {geometry.name!r}: its mesh {geometry.meshPath} cannot be read: {error}"
        raise SceneError(said) from error
    return checked_shape(geometry.name, mesh)


def take_meshes(file: str, robot: ElementTree.Element) -> dict[str, tuple[str, np.ndarray]]:
    """Put a box in the place of the meshes of collision shapes, in the tree of a URDF.

    Args:
        file: its name, for messages.
        robot: root element.

    Returns:
        Path and scale of each by the name that Pinocchio gives to the geometry.

    Raises:
        SceneError: a scale cannot be read; it names the link.
    """
    found: dict[str, tuple[str, np.ndarray]] = {}
    for link in robot.findall("link"):
        if link.find(CONVERTED) is not None:
            continue
        for i, shape in enumerate(link.findall("collision")):
            geometry = shape.find("geometry")
            mesh = None if geometry is None else geometry.find("mesh")
            if geometry is None or mesh is None or len(geometry) != 1:
                continue
            found[f"{link.get('name')}_{i}"] = mesh.get("filename", ""), _scale(file, link, mesh)
            geometry.remove(mesh)
            ElementTree.SubElement(geometry, "box", size="1 1 1")
    return found


def _scale(file: str, link: ElementTree.Element, mesh: ElementTree.Element) -> np.ndarray:
    text = mesh.get("scale")
    try:
        scale = np.ones(3) if text is None else np.array([float(word) for word in text.split()])
    except ValueError:
        scale = np.full(3, np.nan)
    if scale.shape != (3,) or not np.isfinite(scale).all():
        raise SceneError(f"{file}: link {link.get('name')!r}: the scale {text!r} of its mesh: expected three numbers")
    return scale
