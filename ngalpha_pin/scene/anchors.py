"""Pinocchio's own anchor constraint models, taken as joints between frames."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.constraints import FrameConstraint, PointJoint, Weld
from ngalpha_pin.scene.protocols import Declared

ANCHORS = (pin.PointAnchorConstraintModel, pin.FrameAnchorConstraintModel)


def from_anchor(
    scene: Declared, anchor: pin.PointAnchorConstraintModel | pin.FrameAnchorConstraintModel
) -> FrameConstraint:
    """The joint between frames that a constraint model of Pinocchio stands for.

    Its Baumgarte parameters have no meaning here: the constraint is fulfilled on position level.

    Raises:
        SceneError: it asks for an offset, a velocity or an acceleration, or it belongs to another model.
    """
    names = scene.model.names
    kind = PointJoint if isinstance(anchor, pin.PointAnchorConstraintModel) else Weld
    if not max(anchor.joint1_id, anchor.joint2_id) < len(names):
        raise SceneError(f"{kind.__name__}: joint {max(anchor.joint1_id, anchor.joint2_id)} is not in the model")
    a, b = names[anchor.joint1_id], names[anchor.joint2_id]
    name = anchor.name or f"{kind.__name__} {a}-{b}"
    for what in ("offset", "velocity", "acceleration"):
        if np.any(getattr(anchor, f"desired_constraint_{what}")):
            raise SceneError(f"{name}: a desired {what} is not supported; put it into a FrameTrajectory or a placement")
    placements = []
    for joint, placement in ((anchor.joint1_id, anchor.joint1_placement), (anchor.joint2_id, anchor.joint2_placement)):
        frame = scene.frame(names[joint])
        if frame.parentJoint != joint:
            raise SceneError(f"{name}: the model has a frame {frame.name!r} that is not on the joint of that name")
        placements.append(frame.placement.inverse() * placement)
    return kind(a, b, placement_a=placements[0], placement_b=placements[1], name=name)
