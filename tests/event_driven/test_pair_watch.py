"""Steps of high order with shapes whose touching features can change, and where they do."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

import ngalpha_pin as nga

GRAVITY, MU, ARM, RADIUS, RATE, HALF = 9.81, 0.25, 0.5, 0.1, 30.0, 0.02


def at(*p):
    return pin.SE3(np.eye(3), np.array(p))


def plank(below, R):
    """A plank on two rollers that turn inwards: friction mu (N1 - N2) gives x'' = -mu g x / (ARM - mu HALF)."""
    model = pin.Model()
    for side, name in ((-1, "left"), (1, "right")):
        joint = model.addJoint(0, pin.JointModelRY(), at(side * ARM, 0, -RADIUS), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromCylinder(1.0, RADIUS, 0.3), pin.SE3.Identity())
        model.addJointFrame(joint)
    x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    z = model.addJoint(x, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    tilt = model.addJoint(z, pin.JointModelRY(), pin.SE3.Identity(), "tilt")
    model.appendBodyToJoint(tilt, pin.Inertia.FromBox(2.0, 2.0, 0.2, 2 * HALF), pin.SE3.Identity())
    model.addJointFrame(tilt)
    scene = nga.Scene(model)
    for name, sign in (("left", 1), ("right", -1)):
        scene.add_geometry(f"{name}_roller", below, name, pin.SE3(R, np.zeros(3)))
        scene.add_constraint(nga.JointTrajectory(name, lambda t, sign=sign: (sign * RATE * t, sign * RATE, 0.0)))
    scene.add_geometry("plank", coal.Box(2.0, 0.2, 2 * HALF), "tilt")
    scene.add_contact("plank", "*_roller", mu=MU)
    return scene


@pytest.mark.parametrize(
    "below, R", [(coal.Sphere(RADIUS), np.eye(3)), (coal.Cylinder(RADIUS, 0.3), pin.utils.rotate("x", 0.5 * np.pi))]
)
def test_a_plank_on_rollers_keeps_the_tolerance_in_few_steps(below, R):
    """Two points on each cylinder are redundant: their forces are not unique, the motion is."""
    q0 = np.array([0, 0, 0.1, HALF, 0])
    run = nga.simulate(plank(below, R), q0, np.array([RATE, -RATE, 0, 0, 0]), t_end=0.3, rtol=1e-8)
    swings = 0.1 * np.cos(np.sqrt(MU * GRAVITY / (ARM - MU * HALF)) * run.t)
    assert np.abs(run.q[:, 2] - swings).max() < 1e-8
    assert len(run.t) <= 20 and run.audit().ok


def body(inertia, shape):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_geometry("body", shape, "body")
    return scene


def test_a_ball_flies_beside_a_thin_wall_and_does_not_pass_through_it():
    """Shapes that might meet in a step are looked at on the way: a ball does not pass through a thin wall."""
    scene = body(pin.Inertia.FromSphere(1.0, 0.05), coal.Sphere(0.05))
    scene.model.gravity.linear[:] = 0.0
    scene.add_geometry("wall", coal.Box(1e-3, 1.0, 1.0), placement=at(1.0, 0.6, 0.0))
    scene.add_contact("body", "wall", e_N=1.0)
    q0 = pin.neutral(scene.model)
    free = nga.simulate(scene, q0, np.array([20.0, 0, 0, 0, 0, 0]), t_end=0.2, rtol=1e-6)
    assert free.q[-1, 0] == pytest.approx(4.0, abs=1e-9) and len(free.t) < 30
    q0[1] = 0.5
    back = nga.simulate(scene, q0, np.array([20.0, 0, 0, 0, 0, 0]), t_end=0.1, rtol=1e-6)
    assert back.q[-1, 0] == pytest.approx(2 * (1.0 - 0.05 - 0.5e-3) - 2.0, abs=1e-4) and back.audit().penetration < 1e-6


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_a_ball_meets_the_edge_of_a_box_that_turns_and_not_the_plane_beside_it(rtol):
    """In half a step an edge comes between a ball and the face that it would have met, whose plane goes on."""
    model = pin.Model()
    model.gravity.linear[:] = 0.0
    for name in ("ball", "box"):
        carrier = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), f"{name} flies")
        joint = model.addJoint(carrier, pin.JointModelSpherical(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.05), pin.SE3.Identity())
        model.addJointFrame(joint)
    scene, half = nga.Scene(model), np.array([0.05, 0.04, 0.03])
    scene.add_geometry("round", coal.Sphere(0.05), "ball")
    scene.add_geometry("block", coal.Box(*(2 * half)), "box")
    scene.add_contact("round", "block", e_N=1.0)
    ball = [0.212229, -0.298238, 0.0477034, -0.753547, -0.49957, -0.421585, 0.0697332]
    box = [-0.212085, 0.299622, -0.0396986, 0.0867778, -0.514457, 0.157081, -0.838528]
    q0, away = pin.normalize(model, np.array(ball + box)), np.array([0.574932, -0.807931, 0.129229])
    v0 = np.concatenate((-away, [-0.243044, 10.2506, -3.76799], away, [14.1437, -4.29603, -18.7863]))

    def gap(t):
        q = pin.integrate(model, q0, t * v0)
        x = pin.Quaternion(q[10:14]).toRotationMatrix().T @ (q[:3] - q[7:10])
        return np.linalg.norm(x - np.clip(x, -half, half)) - 0.05

    run = nga.simulate(scene, q0, v0, t_end=0.35, rtol=rtol)
    hit = brentq(gap, 0.0, 0.32)
    assert run.impacts.t[0] == pytest.approx(hit, abs=5 * rtol)
    assert run.audit().ok, str(run.audit())


def test_a_box_that_slides_off_a_table_stays_on_it_until_its_middle_has_left():
    """Its corners leave the face one after the other: features change, and the motion stays right."""
    scene = body(pin.Inertia.FromBox(1.0, 0.2, 0.2, 0.1), coal.Box(0.2, 0.2, 0.1))
    scene.add_geometry("table", coal.Box(1.0, 1.0, 0.1), placement=at(-0.5, 0, -0.05))
    scene.add_contact("body", "table")
    q0 = pin.neutral(scene.model)
    q0[:3] = -0.2, 0.0, 0.05
    run = nga.simulate(scene, q0, np.array([1.0, 0, 0, 0, 0, 0]), t_end=0.19, rtol=1e-5)
    assert run.q[-1, 0] == pytest.approx(-0.01, abs=1e-7)
    np.testing.assert_allclose(run.q[:, 2:], np.tile([0.05, 0, 0, 0, 1], (len(run.t), 1)), rtol=0, atol=1e-7)


def test_a_beam_at_rest_takes_no_steps_from_a_pendulum():
    """Both are integrated with an implicit method of high order: the beam is stiff."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "pendulum")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.array([0, 0, -1.0]), np.zeros((3, 3))), pin.SE3.Identity())
    scene = nga.Scene(model)
    beam = scene.add_beam(nga.PlanarBeam(0.2, EA=100.0, EI=1e-3, line_density=0.1, elements=2), "beam")
    scene.add_beam_point("root", "beam", 0.0)
    scene.add_constraint(nga.Weld("world", "root", placement_a=beam.plane))
    q0 = nga.static_equilibrium(scene, scene.q_ref.copy()).q.copy()
    q0[0] = 0.2
    run = nga.simulate(scene, q0, t_end=0.5, rtol=1e-5)
    fine = nga.simulate(scene, q0, t_end=0.5, rtol=1e-8)
    assert abs(run.q[-1, 0] - fine.q[-1, 0]) < 1e-5 and len(run.t) <= 20
    assert np.abs(run.q[:, 1:] - q0[1:]).max() < 1e-9
    # without friction and with unit length, theta'' = -g sin(theta)
    energy = 0.5 * run.v[:, 0] ** 2 - GRAVITY * np.cos(run.q[:, 0])
    assert np.abs(energy - energy[0]).max() < 1e-5
