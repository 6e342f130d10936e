"""Slopes, steps and height fields from arrays."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga


def ball(radius=0.1):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, radius), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_geometry("ball", coal.Sphere(radius), parent="ball")
    return scene


def test_ball_rolls_down_a_sloping_field_as_down_a_plane():
    """A solid ball accelerates with 5/7 g sin(theta); a piece it comes to has no force in the step before."""
    scene, slope = ball(), 0.2
    x = np.linspace(-1.0, 1.0, 5)
    field = scene.add_height_field("hill", np.outer(-slope * x, np.ones(3)), (2.0, 1.0))
    scene.add_contact("ball", field, mu=1.0)
    normal = np.array([slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    along = np.array([normal[2], 0.0, -normal[0]])
    q0 = pin.neutral(scene.model)
    q0[:3] = [-0.73, 0.11, 0.73 * slope]
    q0[:3] += 0.1 * normal
    errors = []
    for dt in (4e-3, 2e-3):
        run = nga.simulate(scene, q0, t_end=0.8, dt=dt)
        s = 5.0 / 7.0 * 9.81 * normal[0] / 2 * run.t**2
        assert s[-1] > 0.4  # into the next piece
        errors.append(np.abs(run.q[:, :3] - q0[:3] - s[:, None] * along).max())
        assert run.audit().penetration < 1e-9
    # on one plane it is half of that: velocities in a frame that turns with the ball, of second order in dt
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_ball_stops_at_a_step():
    scene = ball()
    heights = np.zeros((5, 2))
    heights[3:] = 0.5
    field = scene.add_height_field("step", heights, (2.0, 1.0))
    scene.add_contact("ball", field, mu=0.5)
    q0 = pin.neutral(scene.model)
    q0[:3] = [-0.6, 0.1, 0.1]
    run = nga.simulate(scene, q0, np.array([1.0, 0, 0, 0, 10.0, 0]), t_end=1.5, dt=2e-3)
    audit = run.audit()
    assert audit.ok and audit.penetration < 1e-9
    # the ramp of the field rises from x = 0 with slope 1: the ball climbs at most what its energy allows
    assert run.q[:, 2].max() < 0.1 + 0.7 * 1.0**2 / 9.81 + 1e-6


@pytest.mark.parametrize(
    "heights, size", [(np.zeros(4), (1, 1)), (np.full((3, 3), np.nan), (1, 1)), (np.zeros((3, 3)), (1, -1))]
)
def test_numbers_that_make_no_field(heights, size):
    with pytest.raises(nga.SceneError):
        ball().add_height_field("field", heights, size)
