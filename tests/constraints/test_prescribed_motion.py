"""Motions that are given as functions of time or as splines, and constraints of the user's own, in whole runs."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, make_interp_spline

import ngalpha_pin as nga
from ngalpha_pin import robots

G = 9.81


def pendulum(length=0.7, mass=2.0):
    """A bob on a cart that can be driven."""
    model = pin.Model()
    cart = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "cart")
    model.appendBodyToJoint(cart, pin.Inertia.FromSphere(3.0, 0.1), pin.SE3.Identity())
    arm = model.addJoint(cart, pin.JointModelRY(), pin.SE3.Identity(), "arm")
    at = pin.SE3(np.eye(3), np.array([0, 0, -length]))
    model.appendBodyToJoint(arm, pin.Inertia.FromSphere(mass, 0.05), at)
    model.addFrame(pin.Frame("bob", arm, at, pin.FrameType.OP_FRAME))
    return nga.Scene(model)


def course(t):
    return 0.2 * np.sin(4 * t)


def three(t):
    return course(t), 0.8 * np.cos(4 * t), -3.2 * np.sin(4 * t)


def driven(angle, dt, t_end=0.6):
    scene = pendulum()
    scene.add_constraint(nga.JointTrajectory("cart", angle))
    return nga.simulate(scene, np.array([0.0, 0.3]), np.array([0.8, 0.0]), t_end=t_end, dt=dt)


def test_driving_force_is_that_of_the_inverse_dynamics():
    """Function, (q, v, a) and splines drive the cart; the force is rnea's for the motion that comes out, to order 2."""
    grid = np.linspace(0.0, 0.6, 400)
    spline = make_interp_spline(grid, course(grid), k=5)
    errors = []
    for dt in (8e-3, 4e-3):
        run = driven(three, dt)
        model, data = run.scene.model, run.scene.model.createData()
        arm = driven(three, dt / 4)
        tau = np.array([pin.rnea(model, data, *x)[0] for x in zip(arm.q, arm.v, arm.a, strict=True)])[::4]
        errors.append([np.abs(run.la_g[:, 0] - tau).max(), np.abs(run.q[:, 1] - arm.q[::4, 1]).max()])
        assert np.abs(run.q[:, 0] - course(run.t)).max() < 1e-14
        assert np.abs(run.v[:, 0] - 0.8 * np.cos(4 * run.t)).max() < 1e-13
        assert np.abs(run.a[:, 0] + 3.2 * np.sin(4 * run.t)).max() < 1e-11
    # against a run with a quarter of the step: 1 - 1/16 of the error
    assert np.log2(np.divide(*errors)) == pytest.approx([2.0, 2.0], abs=0.1)
    for angle, tolerance in ((course, 1e-9), (spline, 1e-7)):
        other = driven(angle, 4e-3)
        assert np.abs(other.q - run.q).max() < tolerance
        assert np.abs(other.la_g - run.la_g).max() < 1e3 * tolerance


def test_cubic_spline_through_points():
    scene = pendulum()
    scene.add_constraint(nga.JointTrajectory("cart", CubicSpline([0.0, 0.3, 0.6], [0.0, 0.1, 0.0], bc_type="clamped")))
    run = nga.simulate(scene, np.array([0.0, 0.0]), t_end=0.6, dt=0.01)
    assert run.q[[30, 60], 0] == pytest.approx([0.1, 0.0], abs=1e-14)


def shaken_table(amplitude, mu, rate=20.0):
    """A table that is shaken along x, and a box on it."""
    model = pin.Model()
    table = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "table")
    model.appendBodyToJoint(table, pin.Inertia.FromBox(4.0, 1.0, 1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(table)
    box = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "box")
    model.appendBodyToJoint(box, pin.Inertia.FromBox(1.0, 0.2, 0.2, 0.1), pin.SE3.Identity())
    model.addJointFrame(box)
    scene = nga.Scene(model)
    scene.add_geometry("top", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), parent="table")
    scene.add_geometry("crate", coal.Box(0.2, 0.2, 0.1), parent="box")
    scene.add_contact("crate", "top", mu=mu)

    def pose(t):
        at = np.array([amplitude * (1 - np.cos(rate * t)), 0.0, 0.0])
        along = np.array([amplitude * rate * np.sin(rate * t), 0, 0, 0, 0, 0])
        return pin.SE3(np.eye(3), at), along, np.array([amplitude * rate**2 * np.cos(rate * t), 0, 0, 0, 0, 0])

    scene.add_constraint(nga.FrameTrajectory("table", pose))
    q0 = pin.neutral(model)
    q0[9] = 0.05
    return scene, q0


@pytest.mark.parametrize("part", [0.99, 1.01])
def test_box_on_a_shaken_table_slips_when_mu_g_is_not_enough(part):
    """The table accelerates with amplitude rate^2 at most, friction the box with mu g."""
    mu, rate = 0.4, 20.0
    scene, q0 = shaken_table(part * mu * G / rate**2, mu, rate)
    run = nga.simulate(scene, q0, t_end=0.04, dt=2e-3)
    slip = np.abs(run.v[:, 6] - run.v[:, 0]).max()
    if part < 1:
        assert slip < 1e-12
        assert run.a[0, 6] == pytest.approx(part * mu * G)
    else:
        assert slip > 1e-6
        assert run.a[0, 6] == pytest.approx(mu * G)
    assert run.audit().ok


def test_hand_of_the_arm_follows_a_pose():
    """A curve drawn by the last link: pose, twist and acceleration are kept at every step."""
    scene, q0, _ = robots.load("arm")
    model, data = scene.model, scene.model.createData()
    name = model.names[model.njoints - 1]
    pin.framesForwardKinematics(model, data, q0)
    start = data.oMi[model.njoints - 1].copy()

    def pose(t):
        s = 0.02 * np.array([1 - np.cos(3 * t), 1 - np.cos(4 * t), 0.0])
        return start * pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.1 * t * t])), s)

    scene.add_constraint(nga.FrameTrajectory(name, pose))
    run = nga.simulate(scene, q0, t_end=0.3, dt=1e-2)
    for t, q in zip(run.t, run.q, strict=True):
        pin.forwardKinematics(model, data, q)
        assert pin.log6(pose(t).inverse() * data.oMi[model.njoints - 1]).vector == pytest.approx(np.zeros(6), abs=1e-10)
    assert run.la_g.shape == (31, 6)
    assert run.audit().ok


def length(t, q):
    return q @ q - (1.0 + 0.1 * np.sin(t)) ** 2


def winding(dt):
    """A bob on a string whose length is given: two coordinates and an own g(t, q)."""
    model = pin.Model()
    x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    z = model.addJoint(x, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    model.appendBodyToJoint(z, pin.Inertia(1.5, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_constraint(nga.PositionConstraint(length))
    run = nga.simulate(scene, np.array([1.0, 0.0]), np.array([0.1, 0.0]), t_end=0.5, dt=dt)
    assert np.abs(run.constraint_motion.g).max() < 1e-12
    assert np.abs(run.constraint_motion.rate).max() < 1e-11
    return run


def test_own_position_constraint_is_of_second_order():
    """A swing whose string gets longer, against its equation of motion."""

    def swing(t, y):
        L, L_dot = 1.0 + 0.1 * np.sin(t), 0.1 * np.cos(t)
        return [y[1], (-G * np.sin(y[0]) - 2 * L_dot * y[1]) / L]

    exact = solve_ivp(swing, (0, 1), [np.pi / 2, 0.0], rtol=1e-11, atol=1e-12, dense_output=True).sol
    errors = []
    for dt in (2e-2, 1e-2):
        run = winding(dt)
        angle, rate = exact(run.t)
        L = 1.0 + 0.1 * np.sin(run.t)
        x = np.stack((L * np.sin(angle), -L * np.cos(angle)), axis=1)
        # the string pulls with m (g cos + l rate^2 - l_ddot), which is 2 l la_g
        pull = 1.5 * (G * np.cos(angle) + L * rate**2 + 0.1 * np.sin(run.t))
        errors.append([np.abs(run.q - x).max(), np.abs(-2 * L * run.la_g[:, 0] - pull).max()])
    assert errors[1][0] < 1e-3
    assert np.log2(np.divide(*errors)) == pytest.approx([2.0, 2.0], abs=0.1)


def skate(t, q, v):
    return np.sin(q[2]) * v[0] - np.cos(q[2]) * v[1]


def test_own_velocity_constraint_is_of_second_order():
    """A skate on an incline, q = (x, y, phi): it runs cycloids and does not slide down for ever."""
    model = pin.Model()
    x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    y = model.addJoint(x, pin.JointModelPY(), pin.SE3.Identity(), "y")
    turn = model.addJoint(y, pin.JointModelRZ(), pin.SE3.Identity(), "turn")
    model.appendBodyToJoint(turn, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    pull, w = 2.0, 3.0
    model.gravity.linear = np.array([pull, 0.0, -9.0])
    scene = nga.Scene(model)
    scene.add_constraint(nga.VelocityConstraint(skate))
    errors = []
    for dt in (2e-2, 1e-2):
        run = nga.simulate(scene, np.zeros(3), np.array([0.0, 0.0, w]), t_end=1.0, dt=dt)
        phi = w * run.t
        expected = pull / (2 * w * w) * np.stack((np.sin(phi) ** 2, phi - np.sin(2 * phi) / 2), axis=1)
        errors.append(np.abs(run.q[:, :2] - expected).max())
        assert np.abs(run.constraint_motion.rate).max() < 1e-12
    assert errors[1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
