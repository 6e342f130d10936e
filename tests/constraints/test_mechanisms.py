"""Mechanisms with loops against references: second order in q, v and the forces, no drift on any level."""

import numpy as np
import pinocchio as pin
import pytest
from loops import Loops, assert_no_drift, displacements, pin_force, slope

import ngalpha_pin as nga
from ngalpha_pin import references, robots
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


def andrews_load(scene):
    """Torque and spring of the squeezer as a generalized force."""
    model, data = scene.model, scene.model.createData()
    crank, eye = model.idx_vs[model.getJointId("beta")], model.getFrameId("D")
    anchor = np.append(andrews.C, 0.0)

    def load(q, v):
        J = pin.computeFrameJacobian(model, data, q, eye, pin.LOCAL_WORLD_ALIGNED)[:3]
        arm = data.oMi[model.frames[eye].parentJoint].act(model.frames[eye].placement).translation - anchor
        length = np.linalg.norm(arm)
        tau = -4530.0 * (length - 0.07785) / length * J.T @ arm
        tau[crank] += 0.033
        return tau

    return load


def andrews_forces(run):
    return np.stack([pin_force(run, name, (0, 1)) for name in ("K3", "K4", "K6")], 1)


def test_andrews_mechanism_converges_with_second_order():
    scene, q0, v0 = robots.load("andrews")
    pins = [(f"E of {name}", "E of K2") for name in ("K3", "K4", "K6")]
    sizes, found = [4e-5, 2e-5], []
    for dt in sizes:
        run = nga.simulate(scene, q0, v0, t_end=4e-3, dt=dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
        assert_no_drift(run)
        x, v, forces = Loops(scene.model, pins, (0, 1), andrews_load(scene)).run(q0, v0, run.t)
        half = len(run.t) // 2
        wrong = displacements(run) - x, run.v - v, andrews_forces(run) - forces
        found.append([np.abs(e[half:]).max() for e in wrong])
    for quantity, error in zip(("q", "v", "la_g"), np.transpose(found), strict=True):
        assert 1.9 <= slope(sizes, error) <= 2.1, f"{quantity}: {error}"


# velocities [rad/s] and forces [N] of the test set at 0.03 s; there la acts on the left side of the equations
END_VELOCITIES = (
    0.1139920302151208e4, -0.1424379294994111e4, 0.1103291221937134e2, 0.1929337464421385e2,
    0.5735699284790808, -0.1929337464421385e2, 0.3231791658026955,
)  # fmt: skip
END_FORCES = -np.array([
    [0.1991753333731910e3, -0.2975531228015052e2], [0.2306654119098399e2, 0.3145271365475927e2],
    [0.2264249232082739e2, 0.1161740700019673e2],
])  # fmt: skip


def andrews_at_end(dt):
    scene, q0, v0 = robots.load("andrews")
    run = nga.simulate(scene, q0, v0, t_end=andrews.END_TIME, dt=dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
    assert_no_drift(run)
    q, v = (andrews.in_order(scene, x[-1]) for x in (run.q, run.v))
    return [np.abs(x).max() for x in (q - andrews.END_ANGLES, v - END_VELOCITIES, andrews_forces(run)[-1] - END_FORCES)]


def test_andrews_mechanism_against_the_published_values():
    """Relative to angles of 16 rad, velocities of 1,400 rad/s and forces of 200 N."""
    q, v, la = andrews_at_end(1e-4)
    assert max(q / 16, v / 1400, la / 200) < 4e-3


@pytest.mark.long
def test_andrews_mechanism_converges_to_the_published_values():
    sizes = [1e-5, 5e-6]
    found = [andrews_at_end(dt) for dt in sizes]
    for quantity, error in zip(("q", "v", "la_g"), np.transpose(found), strict=True):
        assert 1.9 <= slope(sizes, error) <= 2.1, f"{quantity}: {error}"
    q, v, la = found[-1]
    assert max(q / 16, v / 1400, la / 200) < 1e-5
