"""URDF and MJCF files, read by Pinocchio: the model with its collision and its visual geometries."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import pinocchio as pin

from ngalpha_pin import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.height_field import FIELDS, pieces
from ngalpha_pin.scene.model_checks import check_model, checked_geometry

Models = tuple[pin.Model, pin.GeometryModel, pin.GeometryModel]


def read_urdf(
    path: str | os.PathLike[str],
    root_joint: pin.JointModel | None,
    package_dirs: Sequence[str | os.PathLike[str]] | None,
) -> Models:
    """Model, collision and visual geometries of a URDF file; see `Scene.from_urdf`.

    Raises:
        SceneError: the file is missing, or a mesh is not found.
    """
    path = Path(path).resolve()
    if not path.is_file():
        raise SceneError(f"no URDF file at {path}")
    directories = [str(d) for d in (package_dirs if package_dirs is not None else path.parents)]
    try:
        joint = (root_joint,) if root_joint is not None else ()
        model = pin.buildModelFromUrdf(str(path), *joint)
        collision = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=directories)
        visual = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.VISUAL, package_dirs=directories)
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"{path.name} cannot be read: {error}; meshes are looked up in package_dirs") from error
    return model, collision, visual


def read_mjcf(path: str | os.PathLike[str]) -> Models:
    """Model, collision and visual geometries of an MJCF file.

    Raises:
        SceneError: the file is missing or cannot be read.
    """
    path = Path(path).resolve()
    if not path.is_file():
        raise SceneError(f"no MJCF file at {path}")
    try:
        model = pin.buildModelFromMJCF(str(path))
        collision = pin.buildGeomFromMJCF(model, str(path), pin.GeometryType.COLLISION)
        visual = pin.buildGeomFromMJCF(model, str(path), pin.GeometryType.VISUAL)
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"{path.name} cannot be read: {error}") from error
    return model, collision, visual


def checked_model(model: pin.Model) -> pin.Model:
    """The model, unless it cannot be simulated.

    Raises:
        SceneError: it is no `pin.Model`, a number in it is impossible, or its joints are not in a row branch by branch.
    """
    check_model(checks.instance("model", model, pin.Model, "a pin.Model"))
    for name, subtree in zip(model.names, model.subtrees, strict=True):
        if len(subtree) and subtree[-1] - subtree[0] != len(subtree) - 1:  # Pinocchio relies on it without a word
            raise SceneError(f"add the joints to the model branch by branch: those behind {name!r} are not in a row")
    return model


def checked_geometries(model: pin.Model, geometries: pin.GeometryModel | None) -> pin.GeometryModel:
    """A copy of the collision geometries, with height fields in convex pieces, or an empty model.

    Raises:
        SceneError: one of them is on a joint that the model does not have, or is no shape.
    """
    if geometries is None:
        return pin.GeometryModel()
    checks.instance("collision_model", geometries, pin.GeometryModel, "a pin.GeometryModel")
    for geometry in geometries.geometryObjects:
        if geometry.parentJoint >= model.njoints:
            raise SceneError(
                f"the collision geometry {geometry.name!r} is on joint {geometry.parentJoint}, but the model has only "
                f"{model.njoints}: it belongs to another model"
            )
    found, changed = pin.GeometryModel(), False
    for geometry in geometries.geometryObjects:
        kept = list(pieces(geometry)) if isinstance(geometry.geometry, FIELDS) else [checked_geometry(geometry)]
        changed |= len(kept) != 1 or kept[0] is not geometry
        for piece in kept:
            found.addGeometryObject(piece)
    return found if changed else geometries.copy()
