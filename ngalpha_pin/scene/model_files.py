"""What a `pin.Model` and its geometries must be for a scene to take them."""

from __future__ import annotations

import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.height_field import FIELDS, pieces
from ngalpha_pin.scene.meshes import in_metres
from ngalpha_pin.scene.model_checks import check_model, checked_geometry


def checked_model(model: pin.Model) -> pin.Model:
    """The model, unless it cannot be simulated.

    Raises:
        SceneError: it is no `pin.Model`, a number in it is impossible, it has mimic joints, or its joints are not in a
            row branch by branch.
    """
    checks.instance("model", model, pin.Model, "a pin.Model")
    mimics = [name for name, joint in zip(model.names, model.joints, strict=True) if "Mimic" in joint.shortname()]
    if mimics:
        raise SceneError(
            f"joint {mimics[0]!r} is a mimic joint of Pinocchio's, which is not simulated: build the model without "
            "mimic=True and add a JointCoupling, or use Scene.from_urdf, which reads <mimic> from the file"
        )
    check_model(model)
    for name, subtree in zip(model.names, model.subtrees, strict=True):
        if len(subtree) and subtree[-1] - subtree[0] != len(subtree) - 1:  # Pinocchio relies on it without a word
            raise SceneError(f"add the joints to the model branch by branch: those behind {name!r} are not in a row")
    return model


def checked_geometries(model: pin.Model, geometries: pin.GeometryModel | None) -> pin.GeometryModel:
    """A copy of the collision geometries in metres, with height fields in convex pieces, or an empty model.

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
                f"{model.njoints}: whoever reduced or rebuilt the model has kept geometries of another one"
            )
    found, changed = pin.GeometryModel(), False
    for geometry in geometries.geometryObjects:
        kept = list(pieces(geometry)) if isinstance(geometry.geometry, FIELDS) else [checked_geometry(geometry)]
        changed |= len(kept) != 1 or kept[0] is not geometry
        for piece in kept:
            found.addGeometryObject(piece)
    return in_metres(found if changed else geometries.copy())
