"""What slides over pieces of a floor slides as over a plane, and rests on steps and rough ground."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga

GRAVITY, HEIGHT = 9.81, 0.05
UPRIGHT, LYING = np.eye(3), pin.utils.rotate("y", 0.5 * np.pi)
SHAPES = {
    "box": (coal.Box(0.2, 0.15, 2 * HEIGHT), UPRIGHT),
    "ball": (coal.Sphere(HEIGHT), UPRIGHT),
    "capsule": (coal.Capsule(HEIGHT, 0.2), LYING),
    "roller": (coal.Cylinder(HEIGHT, 0.2), LYING),
    "cylinder": (coal.Cylinder(0.08, 2 * HEIGHT), UPRIGHT),
}


def thrown(shape="box"):
    """A scene with a body of 1 kg, of which HEIGHT is the half."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, 0.2, 0.15, 2 * HEIGHT), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    form, R = SHAPES[shape]
    scene.add_geometry("body", form, "body", pin.SE3(R, np.zeros(3)))
    return scene


def block(scene, name, low, high):
    low, high = np.array(low), np.array(high)
    scene.add_geometry(name, coal.Box(*(high - low)), placement=pin.SE3(np.eye(3), 0.5 * (low + high)))


def tiles(scene):
    """Tiles in a bond, so that seams end in the middle of others, off by up to 1e-12 m."""
    rng = np.random.default_rng(0)
    for i in range(4):
        for j in range(-1, 4):
            low = np.array([i - 2.0, j - 2.0 + 0.4 * (i % 2), -0.4]) * 0.5
            block(scene, f"floor_{i}_{j}", low, low + [0.5, 0.5, 0.2 + 1e-12 * rng.uniform(-1, 1)])


def field(scene):
    scene.add_height_field("floor", np.zeros((5, 5)), (2.0, 2.0))


@pytest.mark.parametrize(
    "ground, shape, heading, yaw",
    [
        (field, "box", 0.0, 0.0),
        (tiles, "box", 1.2, 0.4),
        (tiles, "cylinder", 1.2, 0.4),
        *(pytest.param(tiles, shape, 0.7, 0.2, marks=pytest.mark.long) for shape in SHAPES),
    ],
)
def test_seams_are_not_felt(ground, shape, heading, yaw):
    """Without friction the velocity stays as it is, for any dt."""
    scene = thrown(shape)
    ground(scene)
    scene.add_contact("body", "floor_*")
    R, way = pin.exp3(yaw * np.array([0.0, 0, 1])), np.array([np.cos(heading), np.sin(heading), 0.0])
    q0 = np.concatenate((-0.08 * way + [0, 0, HEIGHT], pin.Quaternion(R).coeffs()))
    run = nga.simulate(scene, q0, np.concatenate((R.T @ way, np.zeros(3))), t_end=0.16, dt=8e-3)
    velocities = np.array([pin.Quaternion(q[3:]).matrix() @ v[:3] for q, v in zip(run.q, run.v, strict=True)])
    assert np.abs(velocities - way).max() < 1e-9 and np.abs(run.v[:, 3:]).max() < 1e-9
    assert np.abs(run.q[:, 2] - HEIGHT).max() < 3e-12 and run.audit().penetration < 3e-12


def test_a_box_stops_where_friction_says():
    scene, mu = thrown(), 0.3
    tiles(scene)
    scene.add_contact("body", "floor_*", mu=mu)
    q0 = pin.neutral(scene.model)
    q0[:3] = -0.04, 0.03, HEIGHT
    run = nga.simulate(scene, q0, np.array([0.6, 0, 0, 0, 0, 0]), t_end=0.216, dt=6e-3)
    assert run.q[-1, 0] - q0[0] == pytest.approx(0.18 / (mu * GRAVITY), abs=1e-9)
    assert np.abs(run.v[-1]).max() < 1e-12 and run.audit().ok


def test_a_box_stops_at_the_next_step_of_stairs():
    """It slides over a tread, meets the riser with its whole face, and rests against it."""
    scene = thrown()
    for k in range(3):
        block(scene, f"step_{k}", [0.3 * k, -0.5, 0.0], [0.3 * (k + 1), 0.5, 0.1 * (k + 1)])
    scene.add_contact("body", "step_*", mu=0.3)
    q0 = pin.neutral(scene.model)
    q0[:3] = 0.12, 0.0, 0.1 + HEIGHT
    run = nga.simulate(scene, q0, np.array([1.0, 0, 0, 0, 0, 0]), t_end=0.15, dt=3e-3)
    np.testing.assert_allclose(run.q[-1], [0.2, 0, 0.1 + HEIGHT, 0, 0, 0, 1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.q[-1], run.q[-10], rtol=0, atol=1e-14)
    assert np.abs(run.v[-1]).max() < 1e-9 and run.audit().ok


def test_a_plate_of_four_parts_rests_on_a_pedestal_below_their_common_corner():
    model = thrown().model
    scene = nga.Scene(model)
    block(scene, "pedestal", [-0.05, -0.05, -0.2], [0.05, 0.05, 0.0])
    for k in range(4):
        scene.add_geometry(
            f"part_{k}",
            coal.Box(0.2, 0.2, 0.02),
            "body",
            pin.SE3(np.eye(3), 0.2 * np.array([k % 2 - 0.5, k // 2 - 0.5, 0])),
        )
    scene.add_contact("part_*", "pedestal", mu=0.3)
    q0 = pin.neutral(model)
    q0[:3] = 0.01, 0.02, 0.0101
    run = nga.simulate(scene, q0, t_end=0.03, dt=3e-3)
    np.testing.assert_allclose(run.q[-1], [0.01, 0.02, 0.01, 0, 0, 0, 1], rtol=0, atol=1e-9)
    assert np.abs(run.v[-1]).max() < 1e-9 and run.audit().ok
