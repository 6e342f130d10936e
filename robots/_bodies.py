"""What the rolling systems share: a body that moves freely, with a mark that shows how it turns."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

MARK = np.array([0.9, 0.3, 0.1, 1.0])


def free_body(model: pin.Model, name: str, inertia: pin.Inertia) -> int:
    """Add a body on a joint that translates and, behind it, a spherical joint of the given name.

    Its velocity is that of the centre in the frame of the world, and the angular velocity in the frame of the body. A
    free flyer takes the velocity of the centre in the frame of the body too, where it turns with the spin; at the same
    dt its error is several times as large.

    Args:
        model: the tree, which grows.
        name: of the body and its frame.
        inertia: of the body, about its centre.

    Returns:
        The number of the spherical joint.
    """
    centre = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), f"{name}_centre")
    joint = model.addJoint(centre, pin.JointModelSpherical(), pin.SE3.Identity(), name)
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addJointFrame(joint)
    return joint


def free_model(name: str, inertia: pin.Inertia) -> tuple[pin.Model, int]:
    """A model with one such body, and the number of its joint."""
    model = pin.Model()
    model.name = name
    return model, free_body(model, name, inertia)


def mark(joint: int, shape: coal.CollisionGeometry, at: np.ndarray) -> pin.GeometryModel:
    """A visual model of one shape on a body.

    Args:
        joint: of the body.
        shape: what is drawn.
        at: its centre in the frame of the joint, shape (3,) [m].
    """
    geometry = pin.GeometryObject("mark", joint, pin.SE3(np.eye(3), np.asarray(at, dtype=float)), shape)
    geometry.meshColor = MARK
    model = pin.GeometryModel()
    model.addGeometryObject(geometry)
    return model
