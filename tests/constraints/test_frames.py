"""Joints between frames: how many rows each has, and frames that follow a motion."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.constraints.frame_rows import AXES, BLADE, DISTANCE, PLANE
from ngalpha_pin.constraints.frames import frame_rows, moved_frame


def free_body():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.diag([0.1, 0.2, 0.3])), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return nga.Scene(model)


@pytest.mark.parametrize(
    "joint, kinds",
    [
        (nga.PointJoint("world", "tip"), [PLANE] * 3),
        (nga.Weld("world", "tip"), [PLANE] * 3 + [AXES] * 3),
        (nga.RevoluteJoint("world", "tip", axis=(0, 1, 0)), [PLANE] * 3 + [AXES] * 2),
        (nga.UniversalJoint("world", "tip"), [PLANE] * 3 + [AXES]),
        (nga.PrismaticJoint("world", "tip", axis=(0, 1, 0)), [PLANE] * 2 + [AXES] * 3),
        (nga.CylindricalJoint("world", "tip"), [PLANE] * 2 + [AXES] * 2),
        (nga.PlanarJoint("world", "tip"), [PLANE] + [AXES] * 2),
        (nga.Distance("world", "tip", 1.0), [DISTANCE]),
        (nga.KnifeEdge("tip", (0, 1, 0)), [BLADE]),
    ],
)
def test_rows_of_each_joint(joint, kinds):
    assert sorted(row.kind for row in frame_rows(free_body(), joint)) == sorted(kinds)


def turning(t):
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, 2.0 * t])), np.array([np.cos(t), t * t, 0.0]))


def test_moved_frame():
    """Twist and its derivative about the world origin, by hand: omega = (0, 0, 2), v_O = p_dot - omega x p."""
    t = 0.7
    found = moved_frame(nga.FrameTrajectory("tip", turning), t)
    omega, p, p_dot, p_ddot = (
        np.array(x) for x in ([0, 0, 2.0], [np.cos(t), t * t, 0], [-np.sin(t), 2 * t, 0], [-np.cos(t), 2.0, 0])
    )
    assert found.twist == pytest.approx([*(p_dot - np.cross(omega, p)), *omega], abs=1e-9)
    assert found.twist_dot == pytest.approx([*(p_ddot - np.cross(omega, p_dot)), 0, 0, 0], abs=1e-6)


def test_what_is_no_pose_is_refused():
    for given in (
        3.0,
        (pin.SE3.Identity(), np.zeros(6), np.full(6, np.nan)),
        (pin.SE3.Identity(), np.zeros(5), np.zeros(6)),
    ):
        trajectory = nga.FrameTrajectory("tip", turning)
        object.__setattr__(trajectory, "pose", lambda t, given=given: given)
        with pytest.raises(nga.SceneError, match="it must be a finite pin.SE3"):
            moved_frame(trajectory, 0.1)


def test_body_follows_the_frame():
    scene = free_body()
    scene.add_constraint(nga.FrameTrajectory("tip", turning))
    start = nga.assemble(scene, np.array([1.0, 0, 0, 0, 0, 0, 1]), np.array([0.0, 0, 0, 0, 0, 2.0]))
    run = nga.simulate(scene, start.q, start.v, t_end=0.5, dt=1e-3)
    end = pin.XYZQUATToSE3(run.q[-1])
    assert end.homogeneous == pytest.approx(turning(0.5).homogeneous, abs=1e-7)
