"""Constraints from the user's own functions: those of the package, ratios of gears, and what differences leave."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.constraints.user_defined import user_functions
from ngalpha_pin.system.system import System


def pendulum():
    """A point mass on three sliders."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "mass")
    model.appendBodyToJoint(joint, pin.Inertia(2.0, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("mass", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return nga.Scene(model)


def test_distance_of_ones_own():
    q0, v0, runs = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.3, 0.0]), []
    for own in (False, True):
        scene = pendulum()
        if own:
            scene.add_constraint(nga.PositionConstraint(lambda t, q: np.array([np.sqrt(q @ q) - 1.0])))
        else:
            scene.add_constraint(nga.Distance("world", "mass", 1.0))
        runs.append(nga.simulate(scene, q0, v0, t_end=0.5, dt=2e-3))
    np.testing.assert_allclose(runs[1].q, runs[0].q, atol=1e-8)
    np.testing.assert_allclose(runs[1].la_g, runs[0].la_g, atol=1e-5)
    # and the force is that of the pendulum: m v^2 / L + m g along the string
    run, g = runs[1], 9.81
    tension = 2.0 * (run.v**2).sum(axis=1) - 2.0 * g * run.q[:, 2]
    assert np.abs(run.la_g[1:, 0]) == pytest.approx(tension[1:], abs=1e-3)


def test_velocity_constraint_of_ones_own():
    """A point that runs along x as fast as along y stays on the diagonal."""
    scene = pendulum()
    scene.add_constraint(nga.VelocityConstraint(lambda t, q, v: np.array([v[0] - v[1]])))
    scene.add_force(nga.Control(lambda t, q, v: np.array([4.0, 0.0, 2.0 * 9.81])))
    run = nga.simulate(scene, np.zeros(3), t_end=1.0, dt=1e-2)
    assert run.q[-1] == pytest.approx([0.5, 0.5, 0.0], abs=1e-9)
    assert user_functions(scene, scene.model).names_gamma == (scene.constraints[0].name,)


TORQUE = 0.01


def gear(rows, **step):
    """A planetary gear, teeth 20 (sun), 20 (three planets), 60 (ring, fixed), with a torque at its sun."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    carrier = 0
    for name, J in (("sun", 1e-4), ("carrier", 4e-4), ("planet0", 1e-5), ("planet1", 1e-5), ("planet2", 1e-5)):
        angle = 2 * np.pi / 3 * int(name[-1]) if carrier else 0.0
        centre = 0.04 * np.array([np.cos(angle), np.sin(angle), 0.0]) if carrier else np.zeros(3)
        joint = model.addJoint(carrier, pin.JointModelRZ(), pin.SE3(np.eye(3), centre), name)
        model.appendBodyToJoint(joint, pin.Inertia(0.1, np.zeros(3), J * np.eye(3)), pin.SE3.Identity())
        carrier = joint if name == "carrier" else carrier
    scene = nga.Scene(model)

    def teeth(t, q):
        on_the_sun = [q[0] - q[1] + planet for planet in q[2:]]
        return np.array([planet + 3 * q[1] for planet in q[2:]] + on_the_sun[: rows - 3])

    scene.add_constraint(nga.PositionConstraint(teeth, **step))
    scene.add_force(nga.Control(lambda t, q, v: np.array([TORQUE, 0, 0, 0, 0])))
    return scene


# seen from the sun; the planets' centres move with the carrier
INERTIA = 1e-4 + (4e-4 + 3 * 0.1 * 0.04**2 + 3 * 1e-5 * 2**2) / 16


@pytest.mark.parametrize("step", [{}, {"step": 2e-4}, {"step": 0.1}], ids=str)
@pytest.mark.parametrize("rows", [4, 6])
def test_planetary_gear_turns_by_its_ratio(rows, step):
    """The sun turns four times as fast as the carrier; six rows have rank 4."""
    run = nga.simulate(gear(rows, **step), np.zeros(5), t_end=0.2, dt=4e-3)
    sun = TORQUE / INERTIA * run.t**2 / 2
    assert run.q[:, 0] == pytest.approx(sun, abs=1e-8)
    assert run.q[:, 1] == pytest.approx(sun / 4, abs=1e-8)
    assert np.median(run.n_iter) <= 3
    assert run.n_iter.max() <= 10
    assert run.audit().ok, str(run.audit())


def test_planetary_gear_with_chosen_accuracy():
    run = nga.simulate(gear(4), np.zeros(5), t_end=0.2, rtol=1e-6)
    assert run.q[-1, 0] == pytest.approx(TORQUE / INERTIA * 0.02, rel=1e-6)


def test_own_constraint_beside_contacts():
    """Two balls joined by a function that keeps their distance roll off a table's height and rest on the ground."""
    model = pin.Model()
    for i in range(2):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"ball{i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(0.1, 0.05), pin.SE3.Identity())
        model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    for i in range(2):
        scene.add_geometry(f"shape{i}", coal.Sphere(0.05), f"ball{i}")
        scene.add_contact(f"shape{i}", "ground", mu=0.3)
    scene.add_constraint(nga.PositionConstraint(lambda t, q: np.sum((q[:3] - q[7:10]) ** 2) - 0.09))
    q0 = np.concatenate(([0, 0, 0.15, 0, 0, 0, 1], [0.3, 0, 0.15, 0, 0, 0, 1]))
    run = nga.simulate(scene, q0, t_end=0.3, dt=2e-3)
    assert run.q[-1, [2, 9]] == pytest.approx(0.05, abs=1e-9)
    assert run.la_N[-1].sum() == pytest.approx(0.2 * 9.81, rel=1e-6)
    assert np.linalg.norm(run.q[:, :3] - run.q[:, 7:10], axis=1) == pytest.approx(0.3, abs=1e-9)


@pytest.mark.parametrize("speed", [0.1, 1.0, 30.0, 1000.0])
def test_noise_bounds_what_differences_leave(speed):
    """A linear row, whose differences are nothing but rounding: acceleration W a, rate W v."""
    model = pin.Model()
    for i in range(3):
        joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), f"wheel{i}")
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    row, rng = np.array([1.0, -np.pi, 1 / 3]), np.random.default_rng(1)
    scene = nga.Scene(model)
    scene.add_constraint(nga.PositionConstraint(lambda t, q: row @ q))
    scene.add_constraint(nga.VelocityConstraint(lambda t, q, v: row @ v))
    system = System(scene)
    worst, bounds = np.zeros((3, 2)), []
    for _ in range(20):
        q, v, a = 10 * rng.normal(size=3), speed * rng.normal(size=3), 100 * rng.normal(size=3)
        system.dynamics(0.0, q, v, a)
        rows = system.constraint_rows(0.0, q, v, a)
        left = np.abs([rows.acceleration - row @ a, rows.rate - row @ v, [rows.g[0] - row @ q, 0.0]])
        bounds.append(rows.noise)
        assert (left <= rows.noise + 1e-13 * np.array([[100.0], [speed], [1.0]])).all()
        worst = np.maximum(worst, left)
    assert (np.mean(bounds, axis=0)[0] < 1e3 * worst[0]).all()
