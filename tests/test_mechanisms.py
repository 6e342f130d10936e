"""Mechanisms with loops against references: second order in q, v and the forces, no drift on any level."""

import numpy as np
import pinocchio as pin
import pytest
import references
from loops import Loops, displacements, pin_force, slope

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.robots import andrews

LENGTH, MASS, ANGLE = 0.5, 2.0, 1.2


def point_pendulum():
    """A point on a massless rod: two coordinates, one constraint; the angle counts from the downward vertical."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    joint = model.addJoint(joint, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    model.appendBodyToJoint(joint, pin.Inertia(MASS, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_constraint(nga.Distance("world", "z", LENGTH, name="rod"))
    return scene, LENGTH * np.array([np.sin(ANGLE), -np.cos(ANGLE)]), np.zeros(2)


def rigid_pendulum():
    """A free body, hung up at a point 0.5 m above its centre: six coordinates, three constraints."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia(MASS, np.zeros(3), np.diag([0.3, 0.2, 0.1])), pin.SE3.Identity())
    scene = nga.Scene(model)
    top = pin.SE3(np.eye(3), np.array([0.0, 0.0, LENGTH]))
    scene.add_constraint(nga.PointJoint("world", "body", placement_b=top, name="hook"))
    turn = pin.exp3(np.array([0.0, -ANGLE, 0.0]))
    q0 = np.concatenate((turn @ [0, 0, -LENGTH], pin.Quaternion(turn).coeffs()))
    return scene, q0, np.zeros(6)


def swing(t, inertia):
    """Angle, its rate, and the force of the pivot in x and z for a pendulum of this moment about the pivot."""
    omega = np.sqrt(MASS * 9.81 * LENGTH / inertia)
    angle, rate = (x[:, 0] for x in references.pendulum(t, ANGLE, omega))
    a = -(omega**2) * np.sin(angle)
    s, c = np.sin(angle), np.cos(angle)
    force = MASS * LENGTH * np.stack((a * c - rate**2 * s, a * s + rate**2 * c), 1) + [0, MASS * 9.81]
    return angle, rate, force


def errors_of_point(run):
    angle, rate, force = swing(run.t, MASS * LENGTH**2)
    s, c = np.sin(angle), np.cos(angle)
    q, v = LENGTH * np.stack((s, -c), 1), (LENGTH * rate)[:, None] * np.stack((c, s), 1)
    # a positive force drives the ends apart: the rod pulls the point
    return run.q - q, run.v - v, run.la_g[:, 0] + force[:, 1] * c - force[:, 0] * s


def errors_of_body(run):
    angle, rate, force = swing(run.t, 0.2 + MASS * LENGTH**2)
    s, c = np.sin(angle), np.cos(angle)
    q = LENGTH * np.stack((s, np.zeros_like(s), -c), 1)
    return run.q[:, :3] - q, run.v[:, 4] + rate, run.la_g[:, [0, 2]] - force


@pytest.mark.parametrize("rho_inf", [0.0, 0.5, 0.9])
@pytest.mark.parametrize(
    ("build", "wrong"), [(point_pendulum, errors_of_point), (rigid_pendulum, errors_of_body)], ids=["point", "body"]
)
def test_pendulum_with_constraint(build, wrong, rho_inf):
    sizes, found = [1e-2, 5e-3, 2.5e-3], []
    scene, q0, v0 = build()
    for dt in sizes:
        run = nga.simulate(scene, q0, v0, t_end=1.0, dt=dt, method=nga.GeneralizedAlpha(rho_inf=rho_inf))
        assert_no_drift(run)
        half = len(run.t) // 2
        found.append([np.abs(x[half:]).max() for x in wrong(run)])
    for quantity, error in zip(("q", "v", "la_g"), np.transpose(found), strict=True):
        assert 1.9 <= slope(sizes, error) <= 2.1, f"{quantity}: {error}"


def assert_no_drift(run, tol=1e-10):
    """Relative to the size of what the rows subtract."""
    motion = run.constraint_motion
    speed, size = np.abs(run.v).max(), np.abs(run.a).max()
    assert np.abs(motion.g).max() <= tol
    assert np.abs(motion.rate).max() <= tol * speed
    assert np.abs(motion.acceleration).max() <= 1e-8 * size


LOOPS = {
    "four_bar": ({"speed": 12.0}, 0.5, [8e-3, 4e-3, 2e-3], [("coupler_tip", "rocker_tip")]),
    "slider_crank": ({"speed": 15.0}, 0.2, [2e-3, 1e-3, 5e-4], [("rod_tip", "slider")]),
}


@pytest.mark.parametrize("name", LOOPS)
def test_loop_converges_with_second_order(name):
    parameters, t_end, sizes, pins = LOOPS[name]
    scene, q0, v0 = robots.load(name, **parameters)
    found = []
    for dt in sizes:
        run = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(rho_inf=0.8))
        assert_no_drift(run)
        x, v, force = Loops(scene.model, pins).run(q0, v0, run.t)
        half = len(run.t) // 2
        wrong = displacements(run) - x, run.v - v, pin_force(run, "pin") - force[:, 0]
        found.append([np.abs(e[half:]).max() for e in wrong])
    for quantity, error in zip(("q", "v", "la_g"), np.transpose(found), strict=True):
        assert 1.9 <= slope(sizes, error) <= 2.1, f"{quantity}: {error}"
