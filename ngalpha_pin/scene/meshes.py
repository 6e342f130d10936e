"""Files of meshes: where they are, in which unit, and how much larger their convex hull is."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from operator import itemgetter
from pathlib import Path
from urllib.parse import unquote, urlparse

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.convex_hull import check_hull

SAME = 0.01  # part of the volume of a hull that counts as none
UNIT = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']*)[\"']")
UP_AXIS = re.compile(rb"<up_axis>\s*(\w+)\s*</up_axis>")
HEADER = 1 << 14  # bytes in which a COLLADA file says its unit


def find_mesh(uri: str, urdf: Path, package_dirs: Sequence[str | os.PathLike[str]] | None) -> Path | None:
    """The file of a mesh, or None where there is none.

    Args:
        uri: as in a URDF: package://, model:// or file://, or a path; %20 is a blank.
        urdf: the file that has it.
        package_dirs: folders of packages, by default every folder above the file.
    """
    parts = urlparse(uri)
    folders = [os.path.normpath(d) for d in (package_dirs if package_dirs is not None else _above(os.fspath(urdf)))]
    for rest in dict.fromkeys((unquote(parts.netloc + parts.path), parts.netloc + parts.path)):
        if parts.scheme == "file":
            candidates: Iterable[str] = (rest,)
        elif parts.scheme in ("package", "model"):
            rest = rest.lstrip("/")
            package, _, inside = rest.partition("/")
            named = (d for d in folders if os.path.basename(d) == package)
            candidates = chain((os.path.join(d, rest) for d in folders), (os.path.join(d, inside) for d in named))
        else:
            candidates = (os.path.join(d, rest) for d in (os.fspath(urdf.parent), *folders))
        for candidate in candidates:
            if os.path.isfile(candidate):
                return Path(os.path.realpath(candidate))
    return None


def _above(path: str) -> Iterator[str]:
    """Every folder that a file is in, the innermost first."""
    while (folder := os.path.dirname(path)) != path:
        yield folder
        path = folder


def metres_per_unit(path: str) -> float:
    """What one unit of length of a mesh file is [m]: of COLLADA what the file says, else 1.

    Raises:
        SceneError: the unit is not a positive number.
    """
    text = _of_collada(path, UNIT) or "1"
    try:
        unit = float(text)
    except ValueError:
        unit = 0.0
    if not (np.isfinite(unit) and unit > 0):
        raise SceneError(f"{path}: the unit of length meter={text!r} is not a positive number")
    return unit


def says_another_up_axis(path: str) -> bool:
    """A COLLADA file says that its up axis is x or y.

    Its coordinates count as they stand in it all the same: rviz, MoveIt and Gazebo do not turn them, and a URDF places
    its meshes by how these show them. Assimp turns them in the root of its scene, which coal leaves out, and with it
    the unit.
    """
    return (_of_collada(path, UP_AXIS) or "Z_UP") != "Z_UP"


def _of_collada(path: str, pattern: re.Pattern[bytes]) -> str | None:
    """What the head of a COLLADA file says; None where it says nothing, and of other files."""
    if not path.lower().endswith(".dae"):
        return None
    with open(path, "rb") as file:
        found = pattern.search(file.read(HEADER))
    return found.group(1).decode() if found else None


def load_mesh(path: str, scale: np.ndarray, loader: coal.MeshLoader | None = None) -> coal.BVHModelBase:
    """A mesh in metres.

    Args:
        path: its file.
        scale: of its coordinates, shape (3,) [-].
        loader: one that keeps what it has loaded, where files come several times. By default meshes have the tree that
            is made fastest, which coal has no distances for: see `searchable`.
    """
    loader = coal.MeshLoader(coal.NODE_TYPE.BV_AABB) if loader is None else loader
    return loader.load(path, np.asarray(scale, dtype=float) * metres_per_unit(path))


def searchable(shape: coal.BVHModelBase) -> coal.BVHModelOBBRSS:
    """The same mesh with the tree that Pinocchio's loader gives it, which coal's distances need.

    It is most of the time of loading, and the convex hull, which is all that contact takes, does without.
    """
    vertices, triangles = arrays(shape)
    found = coal.BVHModelOBBRSS()
    found.beginModel(len(triangles), len(vertices))
    found.addVertices(vertices)
    found.addTriangles(triangles)
    found.endModel()
    return found


def arrays(shape: coal.BVHModelBase) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a mesh, shape (n, 3) [m], and numbers of those of its triangles, shape (m, 3)."""
    corners = map(itemgetter(0, 1, 2), map(shape.tri_indices, range(shape.num_tris)))
    triangles = np.fromiter(chain.from_iterable(corners), dtype=int, count=3 * shape.num_tris)
    return np.array(shape.vertices()), triangles.reshape(-1, 3)


def is_pending(geometry: pin.GeometryObject) -> bool:
    """Its mesh has not been loaded."""
    shape = geometry.geometry
    return isinstance(shape, coal.BVHModelBase) and not shape.num_vertices and bool(geometry.meshPath)


def make_pending(geometry: pin.GeometryObject, path: str, scale: np.ndarray) -> None:
    """Make a geometry one of a mesh that is to be loaded, in place.

    Args:
        geometry: of any shape.
        path: file of the mesh.
        scale: of its coordinates, shape (3,) [-].
    """
    geometry.geometry, geometry.meshPath, geometry.meshScale = coal.BVHModelOBBRSS(), path, scale


def in_metres(geometries: pin.GeometryModel) -> pin.GeometryModel:
    """The same, changed in place, with meshes whose file has another unit than metres in their size."""
    loader = coal.CachedMeshLoader()
    for geometry in geometries.geometryObjects:
        path = geometry.meshPath
        mesh = isinstance(geometry.geometry, coal.BVHModelBase) and not is_pending(geometry)
        if mesh and os.path.isfile(path) and metres_per_unit(path) != 1.0:
            geometry.geometry = load_mesh(path, geometry.meshScale, loader)
    return geometries


def hull_of_mesh(shape: coal.BVHModelBase, name: str) -> coal.ConvexBase:
    """The convex hull of the mesh of a geometry, built once.

    Raises:
        SceneError: it has none.
    """
    if shape.convex is None:
        check_hull(f"geometry {name!r}", np.asarray(shape.vertices()))
        try:
            shape.buildConvexHull(True, "Qt")
        except RuntimeError:  # a corner has more neighbours in triangles than coal can count
            shape.buildConvexHull(False, "")
    return shape.convex


def hull_excess(geometry: pin.GeometryObject) -> tuple[float, float] | None:
    """Volume of a mesh and of its convex hull, which is what contact sees [m^3].

    None where they are the same to a part of `SAME`, and of a mesh that is not closed: it has no volume.
    """
    shape = geometry.geometry
    if not isinstance(shape, coal.BVHModelBase) or not shape.num_tris:
        return None
    volume = abs(float(shape.computeVolume()))
    hull = float(hull_of_mesh(shape, geometry.name).computeVolume())
    return (volume, hull) if 0.0 < volume < (1.0 - SAME) * hull and _closed(shape) else None


def _closed(shape: coal.BVHModelBase) -> bool:
    """Every edge has as many triangles on its one side as on the other; corners at one place are one corner."""
    vertices, triangles = arrays(shape)
    order = np.lexsort(vertices.T)
    corner = np.empty(len(vertices), dtype=np.int64)
    corner[order] = np.cumsum(np.append(0, (vertices[order[1:]] != vertices[order[:-1]]).any(axis=1)))
    corners = corner[triangles]
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    way = np.sign(edges[:, 1] - edges[:, 0])
    key = edges.min(axis=1) * (corners.max() + 1) + edges.max(axis=1)
    _, which = np.unique(key, return_inverse=True)
    return not np.bincount(which.ravel(), weights=way).any()
