"""Which geometries may touch at all: neighbours in the mechanism, SRDF, shapes that overlap at the start."""

from __future__ import annotations

import os
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import coal
import numpy as np
import pinocchio as pin

from .errors import SceneError

if TYPE_CHECKING:
    from .scene import Scene
    from .system import System

LISTED = 8


def neighbours(model: pin.Model, a: pin.GeometryObject, b: pin.GeometryObject) -> bool:
    """Two geometries on one joint, or on two that follow each other in the mechanism."""
    i, j = int(a.parentJoint), int(b.parentJoint)
    # a base may touch the world that it moves in
    return i == j or (min(i, j) > 0 and (model.parents[i] == j or model.parents[j] == i))


def unbounded(geometry: pin.GeometryObject) -> bool:
    """A half-space or a plane."""
    return isinstance(geometry.geometry, (coal.Halfspace, coal.Plane))


def pairs_of_srdf(scene: Scene, srdf: str | os.PathLike[str]) -> set[frozenset[str]]:
    """Pairs of geometries that an SRDF file, or its text, disables.

    Raises:
        SceneError: the file is missing or cannot be read.
    """
    text = str(srdf)
    if not text.lstrip().startswith("<"):
        if not Path(text).is_file():
            raise SceneError(f"no SRDF file at {text}")
        text = Path(text).read_text(encoding="utf-8")
    geometries = scene.collision_model.copy()
    geometries.addAllCollisionPairs()
    before = _names_of_pairs(geometries)
    try:
        pin.removeCollisionPairsFromXML(scene.model, geometries, text)
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"the SRDF cannot be read: {error}") from error
    return before - _names_of_pairs(geometries)


def _names_of_pairs(geometries: pin.GeometryModel) -> set[frozenset[str]]:
    names = [g.name for g in geometries.geometryObjects]
    return {frozenset((names[p.first], names[p.second])) for p in geometries.collisionPairs}


def leave_out_overlaps(scene: Scene, system: System, q0: np.ndarray) -> bool:
    """Take pairs that overlap at q0 and that no one has named out of the contacts of a scene, with a warning.

    Returns:
        Whether there were any.
    """
    names = {re.sub(r"\[\d+\]", "", name) for name in system.overlaps(q0)}
    found = [p for p in scene.contacts if p.found and f"{p.geometry_a}/{p.geometry_b}" in names]
    if found:
        scene.contacts = [p for p in scene.contacts if p not in found]
        scene.left_out += found
        listed = ", ".join(f"{p.geometry_a}/{p.geometry_b}" for p in found[:LISTED])
        more = f" and {len(found) - LISTED} more" if len(found) > LISTED else ""
        warnings.warn(f"overlap at q0 and are left out of the contacts: {listed}{more}", stacklevel=3)
    return bool(found)
