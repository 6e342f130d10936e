"""Geometries as meshcat objects, as Pinocchio's own viewer draws them, without a server."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common.optional import require
from ngalpha_pin.errors import SceneError

from .collada import collada_object
from .planes import Plane, grid_segments

EXT_KINDS = {0x12: "u1", 0x15: "i4", 0x16: "u4", 0x17: "f4"}  # meshcat's typed arrays in msgpack
SMOOTH_SPHERE = {"widthSegments": 48, "heightSegments": 32}
FACETED = (coal.ConvexBase, coal.HeightFieldAABB, coal.HeightFieldOBBRSS)
BACK_SIDE = 1  # three.js: only the faces that look away are drawn


class Recorder:
    """Stands where meshcat has its connection to a server, and keeps what is sent."""

    def __init__(self) -> None:
        self.commands: list[dict[str, Any]] = []

    def send(self, command: Any) -> None:
        """Keep the command in the form that goes over the wire."""
        self.commands.append(command.lower())


def recorded_objects(geometries: Sequence[pin.GeometryObject], hollow: Collection[str] = ()) -> list[dict[str, Any]]:
    """Descriptions of geometries in meshcat's form of three.js, with the colours that Pinocchio's viewer gives them.

    Args:
        geometries: what to draw; half-spaces are drawn by `planes`, not here.
        hollow: names of those that are seen from the inside.

    Returns:
        The `object` of meshcat's command `set_object` for each geometry.

    Raises:
        SceneError: a geometry that cannot be drawn.
    """
    meshcat = require("meshcat", "drawing in 3D", "pip install meshcat")
    pinocchio_viewer = require("pinocchio.visualize", "drawing in 3D", "pip install pin")
    recorder = Recorder()
    viewer = pinocchio_viewer.MeshcatVisualizer()
    viewer.initViewer(viewer=meshcat.Visualizer(window=recorder))
    viewer.viewerVisualGroupName = "recorded"
    return [_record(viewer, recorder, geometry, geometry.name in hollow) for geometry in geometries]


def _record(viewer: Any, recorder: Recorder, geometry: pin.GeometryObject, hollow: bool) -> dict[str, Any]:
    shape = geometry.geometry
    if geometry.meshPath.lower().endswith(".dae") and isinstance(shape, coal.BVHModelBase):
        with suppress(OSError, ParseError, LookupError, ValueError):  # not there or not readable: the shape is drawn
            return collada_object(Path(geometry.meshPath))
    if isinstance(shape, coal.TriangleP):
        return surface(np.array([shape.a, shape.b, shape.c]), np.array([[0, 1, 2]]), geometry.meshColor)
    recorder.commands.clear()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is not complete is replaced
        viewer.loadViewerGeometryObject(geometry, pin.GeometryType.VISUAL)
        replaced = not recorder.commands
        if replaced:
            viewer.loadViewerGeometryObject(_stand_in(geometry), pin.GeometryType.VISUAL)
    if not recorder.commands:
        raise SceneError(f"there is no way to draw {geometry.name!r}, of the kind {type(shape).__name__}")
    description = recorder.commands[-1]["object"]
    if replaced:  # coal has the mesh in its scale already, the viewer scales the node
        description["object"]["matrix"] = np.diag([*(1 / geometry.meshScale), 1.0]).ravel().tolist()
    _adjust(description, isinstance(shape, FACETED), hollow)
    return description


def _adjust(description: dict[str, Any], flat: bool, hollow: bool) -> None:
    """What the page does better than meshcat's defaults: round spheres, flat facets, insides of hollow shapes."""
    for shape in description["geometries"]:
        if shape["type"] == "_meshfile":  # the name that meshcat's page has dropped
            shape["type"] = "_meshfile_geometry"
        if shape["type"] == "SphereGeometry":
            shape.update(SMOOTH_SPHERE)
        if hollow and shape["type"] == "CylinderGeometry":
            shape["openEnded"] = True
    for material in description["materials"]:
        material["flatShading"] = flat
        if hollow:
            material["side"] = BACK_SIDE


def _stand_in(geometry: pin.GeometryObject) -> pin.GeometryObject:
    """The same geometry as coal has it, for a mesh whose file is not there, or with the faces that a hull lacks."""
    stand_in = geometry.copy()
    stand_in.meshPath = ""
    if isinstance(geometry.geometry, coal.ConvexBase):
        points = coal.StdVec_Vec3s()
        for point in geometry.geometry.points():
            points.append(point)
        stand_in.geometry = coal.Convex.convexHull(points, True, "Qt")
    return stand_in


def surface(vertices: Any, faces: Any, color: Sequence[float], lit: bool = True) -> dict[str, Any]:
    """A triangulated surface seen from both sides, in meshcat's form.

    Args:
        vertices: shape (n, 3) [m].
        faces: indices of vertices, shape (m, 3).
        color: RGBA in [0, 1].
        lit: by the lamps of the viewer, or of its own colour everywhere.
    """
    meshcat_geometry = require("meshcat.geometry", "drawing in 3D", "pip install meshcat")
    kind = meshcat_geometry.MeshLambertMaterial if lit else meshcat_geometry.MeshBasicMaterial
    material = kind(
        color=int(color[0] * 255) * 65536 + int(color[1] * 255) * 256 + int(color[2] * 255),
        opacity=float(color[3]),
        polygonOffset=not lit,  # lines on the surface stay in front of it
        polygonOffsetFactor=1,
        polygonOffsetUnits=1,
    )
    return meshcat_geometry.Mesh(meshcat_geometry.TriangularMeshGeometry(vertices, faces), material).lower()


def grid_lines(plane: Plane) -> dict[str, Any]:
    """The grid of a plane as line segments just above it, in meshcat's form."""
    meshcat_geometry = require("meshcat.geometry", "drawing in 3D", "pip install meshcat")
    # in short pieces: drivers lose lines that begin far behind the camera
    begin, end = grid_segments(plane).reshape(-1, 2, 3).swapaxes(0, 1)
    marks = begin + np.linspace(0, 1, 13)[:, None, None] * (end - begin) + 1e-4 * plane.radius * plane.normal
    ends = np.stack([marks[:-1], marks[1:]], axis=2).reshape(-1, 3)
    material = meshcat_geometry.LineBasicMaterial(color=0xA9B4BF)
    return meshcat_geometry.LineSegments(meshcat_geometry.PointsGeometry(ends.T), material).lower()


def solid(value: Any) -> Any:
    """The same description with its numpy arrays packed for the wire, as meshcat packs its own."""
    if isinstance(value, dict):
        return {key: solid(item) for key, item in value.items()}
    if isinstance(value, list):
        return [solid(item) for item in value]
    if isinstance(value, np.ndarray):
        code = {kind: code for code, kind in EXT_KINDS.items()}[f"{value.dtype.kind}{value.dtype.itemsize}"]
        return require("umsgpack", "drawing in 3D", "pip install meshcat").Ext(code, value.tobytes())
    return value
