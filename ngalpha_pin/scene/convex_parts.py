"""A mesh as convex parts whose union it is, to an accuracy: what is convex as it is, and parts by coacd of the rest."""

from __future__ import annotations

import hashlib
import io
import os
import subprocess
import sys
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from ngalpha_pin.common.files import replacing
from ngalpha_pin.common.optional import MissingPackageError
from ngalpha_pin.errors import NotWritten, SceneError
from ngalpha_pin.scene.cut_faces import on_faces

INSTALL = "pip install 'ngalpha-pin[convex]'"
FOLDER = "NGALPHA_CACHE"  # variable of the environment with the folder in which parts are kept
RULES = 1  # counted up where what is made of one and the same mesh changes
# coacd has a process of its own: in one with Pinocchio the library that is loaded first takes away the other's streams
# of the standard library (`pinocchio.__version__` becomes empty), and what ends it would end the user's program
COACD = """
import io, os, sys
import numpy as np
out = os.dup(1)
os.dup2(2, 1)
import coacd
coacd.set_log_level("off")
given = np.load(io.BytesIO(sys.stdin.buffer.read()))
mesh = coacd.Mesh(given["vertices"], given["triangles"].astype(np.int32))
found = coacd.run_coacd(mesh, threshold=float(given["threshold"]), max_convex_hull=int(given["most"]))
content = io.BytesIO()
np.savez(content, *(np.asarray(points, dtype=float) for points, _ in found))
with os.fdopen(out, "wb") as file:
    file.write(content.getvalue())
"""
# a hull that is larger by less than this part of itself is the mesh
CONVEX = 1e-9


def convex_parts(
    what: str, vertices: np.ndarray, triangles: np.ndarray, threshold: float, most: int | None
) -> list[np.ndarray]:
    """Corners of convex parts, each of shape (n, 3) [m].

    Args:
        what: whose mesh it is, for messages.
        vertices: shape (n, 3) [m].
        triangles: numbers of their corners, shape (m, 3).
        threshold: how concave a part may be, in parts of the size of the mesh.
        most: at most so many parts of each piece of the mesh; None is as many as the threshold needs.

    Raises:
        SceneError: the mesh is not closed or coacd finds no parts. MissingPackageError: coacd is needed.
    """
    vertices, triangles = _welded(vertices, triangles)
    key = hashlib.sha256(repr((RULES, threshold, most, vertices.shape, triangles.shape)).encode())
    key.update(np.ascontiguousarray(vertices).tobytes() + np.ascontiguousarray(triangles).tobytes())
    file = cache_folder() / f"{key.hexdigest()}.npz"
    with suppress(OSError, ValueError, BadZipFile), np.load(file) as kept:  # none, or one that was damaged
        return [kept[name] for name in kept.files]
    pieces = _pieces(triangles)
    if not all(_is_closed(piece) for piece in pieces):
        raise SceneError(f"{what}: its mesh is not closed, so that it has no inside to make convex parts of")
    parts, cut = [], False
    for piece in pieces:
        own = _hull_that_it_is(vertices, piece)
        cut |= own is None
        parts += _by_coacd(what, vertices, piece, threshold, most) if own is None else [own]
    if cut:
        parts = on_faces(parts, vertices, triangles)
    with suppress(OSError, NotWritten):  # without a place to keep them they are made again
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file) as new:
            np.savez(new, *parts)
    return parts


def cache_folder() -> Path:
    """Where parts are kept: the folder that NGALPHA_CACHE says, or ngalpha_pin in that of the user."""
    own = os.environ.get(FOLDER)
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(own) if own else Path(user) / "ngalpha_pin" / "convex"


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Of what closed triangles enclose, whose corners are counted about the outer normal [m^3]."""
    a, b, c = (vertices[triangles[:, i]] - vertices.mean(axis=0) for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def _welded(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same triangles with one corner at each place, without those of no area."""
    vertices, corner = np.unique(np.asarray(vertices, dtype=float), axis=0, return_inverse=True)
    triangles = corner.ravel()[np.asarray(triangles, dtype=int)]
    different = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return vertices, triangles[different]


def _sides(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of all sides of triangles, one triangle after the other: number of the edge, way along it, triangle."""
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)[1].ravel()
    return edge, np.sign(ends[:, 1] - ends[:, 0]), np.tile(np.arange(len(triangles)), 3)


def _pieces(triangles: np.ndarray) -> list[np.ndarray]:
    """Triangles by pieces that hang together over edges of two triangles."""
    edge, _, of = _sides(triangles)
    order = np.argsort(edge, kind="stable")
    number = np.bincount(edge)
    starts = np.cumsum(number) - number
    pairs = order[starts[number == 2][:, None] + [0, 1]]
    a, b = of[pairs].T
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(triangles), len(triangles)))
    n, which = connected_components(graph, directed=False)
    return [triangles[which == i] for i in range(n)]


def _is_closed(triangles: np.ndarray) -> bool:
    """Every edge has as many triangles on its one side as on the other."""
    edge, way, _ = _sides(triangles)
    return not np.bincount(edge, weights=way).any()


def _hull_that_it_is(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray | None:
    """Corners of the hull of a piece that is convex."""
    points = vertices[np.unique(triangles)]
    try:
        hull = ConvexHull(points)
    except QhullError:
        return points  # flat; what becomes of it is said where it gets a shape
    return points[hull.vertices] if abs(volume(vertices, triangles)) > (1.0 - CONVEX) * hull.volume else None


def _by_coacd(
    what: str, vertices: np.ndarray, triangles: np.ndarray, threshold: float, most: int | None
) -> list[np.ndarray]:
    if find_spec("coacd") is None:
        raise MissingPackageError(f"{what}: a decomposition into convex parts needs coacd: {INSTALL}")
    used, corner = np.unique(triangles, return_inverse=True)
    content = io.BytesIO()
    np.savez(content, vertices=vertices[used], triangles=corner.reshape(-1, 3), threshold=threshold, most=most or -1)
    run = subprocess.run([sys.executable, "-c", COACD], input=content.getvalue(), capture_output=True, check=False)
    if run.returncode:
        said = run.stderr.decode(errors="replace").strip().splitlines()
        raise SceneError(f"{what}: coacd fails: {said[-1] if said else f'it ends with {run.returncode}'}")
    with np.load(io.BytesIO(run.stdout)) as found:
        parts = [found[name] for name in found.files]
    if not parts:
        raise SceneError(f"{what}: coacd finds no convex parts of its mesh")
    return parts
