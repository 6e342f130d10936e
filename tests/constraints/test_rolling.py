"""Rolling without slip and knife edges against closed forms: order 2 in motion and forces, no drift, energy kept."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.robots.rolling_disc import RADIUS, angular_rate
from ngalpha_pin.robots.turntable import circle


def assert_no_drift(trajectory):
    motion = trajectory.constraint_motion
    assert np.abs(motion.g).max(initial=0.0) <= 1e-12
    assert np.abs(motion.rate).max() <= 1e-12
    assert np.abs(motion.acceleration).max() <= 1e-7 * (1.0 + np.abs(trajectory.a).max())
    audit = trajectory.audit()
    assert audit.ok, audit


def order(errors):
    return np.log2(np.array(errors[:-1]) / errors[1:])


def runs(load, dts, t_end, rho_inf):
    for dt in dts:
        trajectory = nga.simulate(*load(), t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(rho_inf=rho_inf))
        assert_no_drift(trajectory)
        yield trajectory


def precession_errors(trajectory, theta, rho, normal):
    """Of the position, the velocity, the normal force and the friction against the closed form of `rolling_disc`."""
    t, rate = trajectory.t, angular_rate(theta, rho)
    e = np.stack((np.cos(rate * t), np.sin(rate * t)), axis=1)
    x = trajectory.q[:, :2] - rho * e
    v = trajectory.v[:, :2] - rho * rate * np.stack((-e[:, 1], e[:, 0]), axis=1)
    force = np.array([-(rate**2) * rho, 9.81])  # of 1 kg, radial and upwards
    N, F = normal @ force, normal[0] * force[1] - normal[1] * force[0]
    along, across = trajectory.la_gamma.T  # of the rim
    friction = np.hypot(along, np.abs(across) - abs(F))
    return [np.abs(error).max() for error in (x, v, trajectory.la_g[:, 0] - N, friction)]


def test_disc_precesses_as_in_its_closed_form():
    def load():
        return robots.load("rolling_disc", theta=1.0, rho=0.5)

    found = [precession_errors(r, 1.0, 0.5, np.array([0.0, 1.0])) for r in runs(load, (4e-3, 2e-3), 0.4, 0.9)]
    assert found[-1][0] < 1e-4
    assert order(found)[-1] == pytest.approx(4 * [2.0], abs=0.1)


def test_wheel_runs_around_the_wall_of_a_shell():
    theta, rho, R = 0.2, 0.8, 1.0

    def load():
        return robots.load("wheel_in_shell", theta=theta, rho=rho, shell_radius=R)

    r = RADIUS
    x = np.array([rho + r * np.cos(theta), 0.0])
    x[1] = -np.sqrt(R**2 - x[0] ** 2)
    found, rises = [], []
    for run in runs(load, (1e-3, 5e-4), 0.06, 1.0):
        found.append(precession_errors(run, theta, rho, -x / R))
        rises.append(np.ptp(run.energy.total))
    assert found[-1][0] < 1e-4
    assert order(found)[-1] == pytest.approx(4 * [2.0], abs=0.1)
    # rho_inf = 1 keeps the energy to the order of the method or better
    assert rises[-1] < 1e-4 * run.energy.kinetic[0]
    assert order(rises)[-1] > 1.9


@pytest.mark.parametrize("j", [2 / 5, 2 / 3])
def test_ball_runs_circles_on_a_turntable(j):
    radius, rate = circle(rate=3.0, speed=0.1, j=j)
    period, errors = 2 * np.pi / rate, []
    for dt in (period / 150, period / 300):
        (run,) = runs(lambda: robots.load("turntable", j=j), (dt,), period, 0.9)
        angle = rate * run.t
        expected = np.stack((0.15 - radius + radius * np.cos(angle), radius * np.sin(angle)), axis=1)
        errors.append(np.abs(run.q[:, :2] - expected).max())
    assert rate == pytest.approx(3.0 * j / (1 + j))
    assert errors[-1] < 5e-3 * radius
    assert order(errors)[0] == pytest.approx(2.0, abs=0.1)


def test_ball_on_a_turntable_stays_where_its_centre_does_not_move():
    """It turns on the spot, against the table."""
    run = nga.simulate(*robots.load("turntable", speed=0.0), t_end=0.5, dt=1e-2)
    assert np.abs(run.q[:, :3] - run.q[0, :3]).max() < 1e-14
    assert_no_drift(run)


def sleigh(mass=2.0, inertia=0.1, ahead=0.3):
    """Chaplygin's sleigh: a knife edge at the origin of a body whose centre of mass is ahead of it."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "sleigh")
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.array([ahead, 0, 0]), inertia * np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_constraint(nga.KnifeEdge("sleigh", (0, 1, 0)))
    return scene


def sleigh_errors(dt, m=2.0, inertia=0.1, ahead=0.3, V=1.0):
    """Of the speed, the rate of turning and the force on the edge."""
    J = inertia + m * ahead**2
    kappa = ahead * V * m / J
    phase = kappa * np.arange(round(2.0 / dt) + 1) * dt - 2.0  # it starts tail first and turns around
    u, w = V * np.tanh(phase), V * np.sqrt(m / J) / np.cosh(phase)
    force = m * (u * w - ahead * kappa * w * np.tanh(phase))
    scene = sleigh(m, inertia, ahead)
    start = pin.neutral(scene.model), np.array([u[0], 0.0, w[0]])
    (run,) = runs(lambda: (scene, *start), (dt,), 2.0, 1.0)
    assert np.abs(run.v[:, 1]).max() < 1e-12
    sign = np.sign(run.la_gamma[0, 0] * force[0])
    return [np.abs(e).max() for e in (run.v[:, 0] - u, run.v[:, 2] - w, sign * run.la_gamma[:, 0] - force)]


def test_chaplygin_sleigh_turns_into_its_straight_run():
    """The speed of the edge is V tanh, the rate of turning V sqrt(m / J) sech of V m l (t - t_c) / J."""
    errors = [sleigh_errors(dt) for dt in (8e-3, 4e-3)]
    assert max(errors[-1]) < 2e-4
    assert order(errors)[0] == pytest.approx([2.0, 2.0, 2.0], abs=0.1)


def rim(q):
    R = pin.Quaternion(q[3:7]).toRotationMatrix()
    down = R[:, 2] * R[2, 2] - [0.0, 0.0, 1.0]
    return R, RADIUS * down / np.linalg.norm(down)


def height(t, q):
    return q[2] + rim(q)[1][2]


def slip(t, q, v):
    R, r = rim(q)
    return (v[:3] + np.cross(R @ v[3:], r))[:2]


def test_own_functions_roll_like_the_disc():
    """G and gamma written by hand, singular at the neutral configuration, where the disc lies flat."""
    scene, q0, v0 = robots.load("rolling_disc")
    own = nga.Scene(scene.model)
    own.add_constraint(nga.PositionConstraint(height))
    own.add_constraint(nga.VelocityConstraint(slip))
    a, b = (nga.simulate(s, q0, v0, t_end=0.04, dt=4e-3) for s in (scene, own))
    assert b.constraint_names == ("PositionConstraint height", *2 * ["VelocityConstraint slip"])
    assert np.abs(a.q - b.q).max() < 1e-11
    assert np.abs(a.v - b.v).max() < 1e-10
    assert np.abs(a.la_g - b.la_g).max() < 1e-7
    motion = b.constraint_motion
    assert np.abs(motion.g).max() < 1e-12
    assert np.abs(motion.rate).max() < 1e-11


@pytest.mark.parametrize(
    ("constraint", "message"),
    [
        (lambda s: nga.RollingDisc("rim", "nothing"), "no geometry named 'nothing'"),
        (lambda s: nga.RollingDisc("block", "ground"), "'block' must be a coal.Cylinder"),
        (lambda s: nga.RollingSphere("rim", "ground"), "'rim' must be a coal.Sphere"),
        (lambda s: nga.RollingDisc("rim", "cube"), "a disc rolls on a half-space or on a sphere, not on 'cube'"),
        (lambda s: nga.RollingDisc("rim", "bowl"), "the disc does not fit into 'bowl'"),
    ],
)
def test_what_cannot_roll_is_named(constraint, message):
    scene, q0, _ = robots.load("rolling_disc")
    scene.constraints.clear()
    scene.add_geometry("cube", coal.Box(1.0, 1.0, 1.0))
    scene.add_geometry("block", coal.Box(1.0, 1.0, 1.0), parent=scene.model.names[-1])
    scene.add_geometry("bowl", nga.Hollow(coal.Sphere(0.05)))
    with pytest.raises(nga.SceneError, match=message):
        scene.add_constraint(constraint(scene))
        nga.simulate(scene, q0, t_end=0.1, dt=1e-2)


def test_disc_that_does_not_touch_the_ground_is_refused_and_assembled():
    scene, q0, v0 = robots.load("rolling_disc")
    lifted = q0 + np.array([0, 0, 0.01, 0, 0, 0, 0])
    with pytest.raises(nga.SceneError, match="RollingDisc rim/ground"):
        nga.simulate(scene, lifted, v0, t_end=0.1, dt=1e-2)
    found = nga.assemble(scene, lifted, v0)
    assert nga.simulate(scene, found.q, found.v, t_end=0.02, dt=1e-2).success
