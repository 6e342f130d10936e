"""Pinocchio's anchor constraints, as joints between frames."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.scene.anchors import from_anchor


def scene_of():
    model = pin.Model()
    for name in ("left", "right"):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        model.addJointFrame(joint)
    return nga.Scene(model)


@pytest.mark.parametrize(
    "anchor, kind", [(pin.PointAnchorConstraintModel, nga.PointJoint), (pin.FrameAnchorConstraintModel, nga.Weld)]
)
def test_joint_and_placements(anchor, kind):
    scene = scene_of()
    at = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.4, 0.5, 0.6]))
    joint = from_anchor(scene, anchor(scene.model, 1, at, 2, at.inverse()))
    assert type(joint) is kind
    (a, pose_a), (b, pose_b) = joint.poses(scene)
    assert (a, b) == (1, 2)
    assert pose_a.translation == pytest.approx(at.translation)
    assert pose_b.homogeneous == pytest.approx(at.inverse().homogeneous)


def test_a_desired_offset_is_refused():
    scene = scene_of()
    anchor = pin.FrameAnchorConstraintModel(scene.model, 1, pin.SE3.Identity(), 2, pin.SE3.Identity())
    anchor.desired_constraint_velocity = np.ones(6)
    with pytest.raises(nga.SceneError, match="a desired velocity is not supported"):
        from_anchor(scene, anchor)
