"""Whether a contact is between surfaces, where bodies are made of pieces that touch each other; see `pieces`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.features import NORMAL, SIDE, Face
from ngalpha_pin.collision.polytope import Polytope
from ngalpha_pin.collision.shapes import Solid

# a shape and the pose of its joint
Placed = tuple[Solid, pin.SE3]


def surface_test(on: Face, below: Placed, above: Placed) -> Callable[[np.ndarray, bool], bool] | None:
    """Tells of a point of one shape above a face of another, and whether it is none of its corners, if it is surface.

    Args:
        on: the face.
        below: whose face it is.
        above: whose points are asked for.

    Returns:
        None where both are surface everywhere.
    """
    (under, at), (upon, to), n = below, above, on.normal
    if under.exposed is None and upon.exposed is None:
        return None

    def felt(p: np.ndarray, cut: bool) -> bool:
        if upon.exposed is not None and not upon.exposed.felt(to.actInv(p), -(to.rotation.T @ n)):
            return False
        # a corner of the other one may be anywhere on the face, but what a side of the face cuts needs that side
        foot = p + (n @ (on.feature.c - p)) * n
        return not cut or under.exposed is None or under.exposed.felt(at.actInv(foot), at.rotation.T @ n)

    return felt


def row_is_surface(solids: tuple[Solid, Solid], X: pin.SE3, row: np.ndarray) -> bool:
    """The features of a packed row, of which one is a corner or both are edges, are surface.

    Args:
        solids: the shapes A and B.
        X: pose of joint B in joint A.
        row: the features and their normal.
    """
    n, places = row[NORMAL], (row[:3], X.act(row[SIDE : SIDE + 3]))
    E = (row[3:9].reshape(3, 2), X.rotation @ row[SIDE + 3 : SIDE + 9].reshape(3, 2))
    for i, (solid, m) in enumerate(zip(solids, (n, -n), strict=True)):
        if solid.exposed is None:
            continue
        pose = X if i else pin.SE3.Identity()
        p, direction = places[i], pose.rotation.T @ m
        if E[i].any(axis=0).all():
            if solid.face(direction) is None:
                return False
            continue
        if not E[1 - i].any():  # the point of a line beside that of the other side
            p = p + E[i] @ (E[i].T @ (places[1 - i] - p))
        if not solid.exposed.felt(pose.actInv(p), direction):
            return False
    return True


def farthest_faces(solids: tuple[Solid, Solid], X: pin.SE3) -> tuple[Face | None, Face | None]:
    """Of either shape with neighbours the face that is surface and that the other shape is farthest above.

    Args:
        solids: the shapes A and B.
        X: pose of joint B in joint A.
    """
    found: list[Face | None] = []
    for solid, other, pose in ((solids[0], solids[1], X), (solids[1], solids[0], X.inverse())):
        if solid.exposed is None or not isinstance(solid, Polytope):
            found.append(None)
            continue
        lowest = [m @ pose.act(other.support(-(pose.rotation.T @ m))) for m in solid.normals]
        heights = np.where(solid.exposed.faces, lowest - solid.offsets, -np.inf)
        i = int(np.argmax(heights))
        found.append(solid.side(i) if heights[i] > -np.inf else None)
    return found[0], found[1]
