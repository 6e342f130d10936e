"""What joints carry: against Pinocchio's rnea, and against the forces of constraints that do the same."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots


def test_quadruped_against_rnea_with_external_forces():
    """Feet are spheres: one point each, so that contact_frames has all that rnea needs."""
    run = nga.simulate(*robots.load("quadruped", height=0.05), t_end=0.4, dt=2e-3)
    scene, model = run.scene, run.scene.model
    data = model.createData()
    unit = float(np.abs(run.la_N).max())
    feet = [
        (k, scene.geometry(name.split("/")[0]).parentJoint) for k, name in enumerate(run.contact_names) if "/" in name
    ]
    checked = 0
    for i in range(0, len(run.t), 7):
        points, normals, directions = run.contact_frames(i)
        outside = pin.StdVec_Force()
        pin.forwardKinematics(model, data, run.q[i])
        for _ in range(model.njoints):
            outside.append(pin.Force.Zero())
        for k, joint in feet:
            rows = run.friction_rows[k]
            force = normals[k] * run.la_N[i, k] + directions[rows].T @ run.la_F[i, rows]
            outside[joint] += data.oMi[joint].actInv(pin.Force(force, np.cross(points[k], force)))
        tau = pin.rnea(model, data, run.q[i], run.v[i], run.a[i], outside)
        for joint in range(1, model.njoints):
            found = run.joint_reaction(model.names[joint])
            R = data.oMi[joint].rotation
            assert R.T @ found.force[i] == pytest.approx(data.f[joint].linear, abs=1e-9 * unit)
            assert R.T @ found.moment[i] == pytest.approx(data.f[joint].angular, abs=1e-9 * unit)
            checked += 1
        # nothing holds the base, and along a hinge its motor acts
        assert tau[:6] == pytest.approx(0.0, abs=1e-8 * unit)
        hinge = run.joint_reaction("FL_knee")
        R = data.oMi[model.getJointId("FL_knee")].rotation
        law = scene.forces[0]
        own = model.joints[model.getJointId("FL_knee")].idx_v
        reference, kp, kd = law.q_ref, law.kp, law.kd
        motor = np.broadcast_to(kp, (model.nv,))[own] * (reference[own + 1] - run.q[i, own + 1])
        motor -= np.broadcast_to(kd, (model.nv,))[own] * run.v[i, own]
        assert (R.T @ hinge.moment[i])[1] == pytest.approx(motor, abs=1e-7 * unit)
    assert checked > 300


def pendulum(second_in_tree):
    """Two rods on hinges; the second one hangs on the first by a joint of the tree, or by a constraint."""
    model = pin.Model()
    down = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
    rod = pin.Inertia(1.5, np.array([0.0, 0.0, -0.4]), np.diag([0.2, 0.21, 0.02]))
    first = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "first")
    model.appendBodyToJoint(first, rod, pin.SE3.Identity())
    model.addFrame(pin.Frame("end", first, down, pin.FrameType.OP_FRAME))
    if second_in_tree:
        second = model.addJoint(first, pin.JointModelRY(), down, "second")
    else:
        second = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "second")
    model.appendBodyToJoint(second, rod, pin.SE3.Identity())
    model.addJointFrame(first)
    model.addJointFrame(second)
    scene = nga.Scene(model)
    if not second_in_tree:
        scene.add_constraint(nga.RevoluteJoint("end", "second", axis=(0.0, 1.0, 0.0)))
    scene.add_force(nga.Wrench("second", force=(0.0, 3.0, 1.0), moment=(0.1, 0.2, 0.3)))
    scene.add_force(nga.Spring("first", "second", 5.0, 0.5, 0.2, placement_b=down))
    scene.add_force(nga.Gravity((1.0, 2.0, -8.0)))
    return scene


@pytest.mark.parametrize("joint", ["first", "second"])
def test_a_constraint_carries_what_the_joint_of_a_tree_carries(joint):
    """At one and the same motion, with spring, wrench and another gravity on the bodies."""
    q_1, v_1 = np.array([0.4, -1.1]), np.array([0.7, 0.3])
    tree, cut = pendulum(True), pendulum(False)
    data = tree.model.createData()
    pin.forwardKinematics(tree.model, data, q_1, v_1)
    pose, twist = data.oMi[2], data.v[2]
    q_2 = np.concatenate((q_1[:1], pin.SE3ToXYZQUAT(pose)))
    v_2 = np.concatenate((v_1[:1], twist.vector))
    runs = [nga.simulate(s, q, v, t_end=2e-3, dt=1e-3) for s, q, v in ((tree, q_1, v_1), (cut, q_2, v_2))]
    in_tree = runs[0].joint_reaction(joint)
    unit = np.abs(in_tree.force).max()
    if joint == "first":
        by_cut = runs[1].joint_reaction("first")
        assert by_cut.force[0] == pytest.approx(in_tree.force[0], abs=1e-9 * unit)
        assert by_cut.moment[0] == pytest.approx(in_tree.moment[0], abs=1e-9 * unit)
    else:
        # a free joint carries nothing: the constraint does
        free = runs[1].joint_reaction("second")
        assert np.abs([free.force[0], free.moment[0]]).max() < 1e-9 * unit
        assert np.linalg.norm(runs[1].la_g[0][:3]) == pytest.approx(np.linalg.norm(in_tree.force[0]), rel=1e-9)


def test_rolling_and_driven_constraints_leave_nothing_on_a_free_joint():
    """The forces of every kind of constraint between bodies are what moves the body."""
    for name in ("rolling_disc", "turntable"):
        scene, q0, v0 = robots.load(name)
        run = nga.simulate(scene, q0, v0, t_end=2e-2, dt=1e-3)
        free = [j for j in range(1, scene.model.njoints) if scene.model.nvs[j] == 6]
        for joint in free:
            found = run.joint_reaction(scene.model.names[joint])
            assert np.abs(found.force).max() < 1e-6 and np.abs(found.moment).max() < 1e-6, name


def test_sphere_that_rolls_without_slip():
    scene = nga.Scene()
    scene.add_plane("ground", normal=(0.1, 0.2, 1.0))
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    scene.add_constraint(nga.RollingSphere("ball", "ground"))
    normal = np.array([0.1, 0.2, 1.0]) / np.linalg.norm([0.1, 0.2, 1.0])
    run = nga.simulate(scene, [*(0.1 * normal), 0.0, 0.0, 0.0, 1.0], t_end=0.1, dt=1e-2)
    found = run.joint_reaction("ball")
    assert np.abs(found.force).max() < 1e-8 and np.abs(found.moment).max() < 1e-8


def test_names_and_files(tmp_path):
    run = nga.simulate(pendulum(True), np.zeros(2), t_end=2e-3, dt=1e-3)
    with pytest.raises(nga.UnknownName, match="no joint named 'third'"):
        run.joint_reaction("third")
    run.save(tmp_path / "run.npz")
    with pytest.raises(nga.SceneError, match="joint_reaction needs the forces"):
        nga.Trajectory.load(tmp_path / "run.npz").joint_reaction("first")
