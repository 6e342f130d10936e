"""Pinocchio's anchor models, taken as joints between frames."""

import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import random_inertia

import ngalpha_pin as nga
from ngalpha_pin.system.system import System


def arms():
    model = pin.Model()
    rng = np.random.default_rng(1)
    for i, name in enumerate(("left", "right")):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3(np.eye(3), np.array([i, 0.0, 0.0])), name)
        model.appendBodyToJoint(joint, random_inertia(rng), pin.SE3.Identity())
    return model


@pytest.mark.parametrize(
    ("kind", "n", "expected"),
    [(pin.PointAnchorConstraintModel, 3, nga.PointJoint), (pin.FrameAnchorConstraintModel, 6, nga.Weld)],
)
def test_anchor_models_of_pinocchio(kind, n, expected):
    """Their own residual vanishes where ours does, and their Jacobian spans the same rows."""
    model = arms()
    rng = np.random.default_rng(2)
    placements = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3)) for _ in range(2)]
    anchor = kind(model, 1, placements[0], 2, placements[1])
    scene = nga.Scene(model)
    constraint = scene.add_constraint(anchor)
    assert type(constraint) is expected
    assert constraint.name == f"{expected.__name__} left-right"
    q = nga.assemble(scene, pin.neutral(model)).q
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    gap = (data.oMi[1] * placements[0]).inverse() * data.oMi[2] * placements[1]
    assert np.abs(gap.translation).max() < 1e-10
    if n == 6:
        assert np.abs(gap.rotation - np.eye(3)).max() < 1e-10
    system = System(scene)
    still = np.zeros(12)
    system.dynamics(0.0, q, still, still)
    W = system.constraint_rows(0.0, q, still, still).W
    constraint_data = anchor.createData()
    pin.computeJointJacobians(model, data, q)
    anchor.calc(model, data, constraint_data)
    J = anchor.jacobian(model, data, constraint_data)
    assert len(W) == n == np.linalg.matrix_rank(np.vstack((W, J)), tol=1e-8)


def test_anchor_models_that_do_not_fit():
    model = arms()
    anchor = pin.PointAnchorConstraintModel(model, 1, pin.SE3.Identity(), 2, pin.SE3.Identity())
    anchor.desired_constraint_offset = np.array([0.0, 0.1, 0.0])
    with pytest.raises(nga.SceneError, match="a desired offset is not supported"):
        nga.Scene(model).add_constraint(anchor)
    anchor = pin.PointAnchorConstraintModel(model, 2, pin.SE3.Identity())
    smaller = pin.Model()
    smaller.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "only")
    with pytest.raises(nga.SceneError, match="joint 2 is not in the model"):
        nga.Scene(smaller).add_constraint(anchor)
    with pytest.raises(nga.SceneError, match="constraint = 'knee', a str: expected a constraint"):
        nga.Scene(model).add_constraint("knee")
