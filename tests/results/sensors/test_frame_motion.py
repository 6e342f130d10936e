"""Frames and inertial measurement units against closed forms."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga

G = 9.81


def spinning(omega):
    """A ball in flight that turns about z; its unit sits 0.3 m beside the centre, turned about z by 90 degrees."""
    scene = nga.Scene()
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    joint = scene.model.getJointId("ball")
    pose = pin.SE3(pin.utils.rotate("z", np.pi / 2), np.array([0.3, 0.0, 0.0]))
    scene.model.addFrame(pin.Frame("imu", joint, pose, pin.FrameType.OP_FRAME))
    return scene, pin.neutral(scene.model), np.array([1.0, 0.0, 2.0, 0.0, 0.0, omega])


def test_unit_on_a_spinning_body():
    omega = 5.0
    run = nga.simulate(*spinning(omega), t_end=0.5, dt=1e-3)
    shown = run.imu("imu")
    assert shown.gyroscope == pytest.approx(np.tile([0.0, 0.0, omega], (len(run.t), 1)), abs=1e-12)
    # in flight only the way round is felt: towards the axis, which is the y-axis of the unit
    assert shown.accelerometer == pytest.approx(np.tile([0.0, 0.3 * omega**2, 0.0], (len(run.t), 1)), abs=1e-9)


def test_frame_on_a_spinning_body():
    omega = 5.0
    run = nga.simulate(*spinning(omega), t_end=0.5, rtol=1e-10)
    found, angle = run.frame("imu"), omega * run.t
    arm = 0.3 * np.column_stack((np.cos(angle), np.sin(angle), 0.0 * angle))
    across = np.column_stack((-arm[:, 1], arm[:, 0], 0.0 * angle))
    # the velocity that the ball starts with is in its own axes, which are those of the world then
    flight = np.column_stack((run.t, 0.0 * run.t, 2.0 * run.t - 0.5 * G * run.t**2))
    assert found.position == pytest.approx(flight + arm, abs=1e-8)
    assert found.velocity == pytest.approx(
        np.column_stack((1.0 + 0.0 * run.t, 0.0 * run.t, 2.0 - G * run.t)) + omega * across, abs=1e-8
    )
    assert found.acceleration == pytest.approx(np.array([0.0, 0.0, -G]) - omega**2 * arm, abs=1e-7)
    assert found.rotation[0] == pytest.approx(pin.utils.rotate("z", np.pi / 2))


def test_at_rest_it_shows_the_ground_and_gravity_that_tilts():
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("box", coal.Box(0.2, 0.2, 0.2), mass=1.0)
    scene.add_contact("box", "ground", mu=2.0)
    scene.add_force(nga.Gravity([1.0, 0.0, -5.0]))
    run = nga.simulate(scene, [0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0], t_end=0.05, dt=1e-2)
    assert run.imu("box").accelerometer == pytest.approx(np.tile([-1.0, 0.0, 5.0], (6, 1)), abs=1e-8)


def test_point_of_a_beam_moves_as_its_coordinates_say():
    from ngalpha_pin import robots

    scene, q0, _ = robots.load("cantilever")
    simulator, name = nga.Simulator(scene, 1e-4), scene.beam_points[-1].name
    rng = np.random.default_rng(0)
    v, a = 0.1 * rng.normal(size=(2, len(q0)))
    start = simulator.initial_state(q0)

    def at(s):
        return simulator.sensors(replace(start, q=q0 + s * v + 0.5 * s * s * a, v=v, a=a)).frame(name)

    h = 1e-4
    now, before, after = at(0.0), at(-h), at(h)
    assert now.velocity == pytest.approx((after.position - before.position) / (2 * h), abs=1e-8)
    second = (after.position - 2 * now.position + before.position) / h**2
    assert np.abs(second).max() > 1e-2 and now.acceleration == pytest.approx(second, abs=1e-5)
    turned = pin.log3(after.rotation @ before.rotation.T) / (2 * h)
    assert now.angular_velocity == pytest.approx(turned, abs=1e-5)


def test_unknown_frame():
    scene, q0, v0 = spinning(1.0)
    with pytest.raises(nga.UnknownName, match="no frame named 'inu'"):
        nga.simulate(scene, q0, v0, t_end=0.02, dt=1e-2).imu("inu")
