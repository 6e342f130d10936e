"""States of the first order: a motor with its current, a cylinder with its pressure, against other integrators."""

import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.system.system import System

J, L, R, K, U = 0.02, 0.05, 0.8, 0.3, 6.0
"""Inertia [kg m^2], inductance [H], resistance [ohm], constant [N m/A = V s/rad] and voltage [V] of a motor."""


def motor(derivatives=False):
    """A wheel on a motor: L i_dot = U - R i - K omega, J omega_dot = K i."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "wheel")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.diag([J, J, J])), pin.SE3.Identity())
    scene = nga.Scene(model)
    slopes = ([[0.0]], [[-K / L]], [[-R / L]], [[0.0]], [[0.0]], [[K]])
    scene.add_state(
        "current",
        lambda t, q, v, i: (U - R * i - K * v[0]) / L,
        start=0.5,
        force=lambda t, q, v, i: K * i,
        derivatives=(lambda t, q, v, i: slopes) if derivatives else None,
    )
    return scene


def exact_motor(t):
    """(omega, i) after a start at rest with 0.5 A."""
    A = np.array([[0.0, K / J], [-K / L, -R / L]])
    steady = np.array([U / K, 0.0])
    return steady + expm(A * t) @ (np.array([0.0, 0.5]) - steady)


@pytest.mark.parametrize("derivatives", [False, True])
def test_motor_is_of_second_order(derivatives):
    errors = []
    for dt in (1e-2, 5e-3, 1e-3):
        run = nga.simulate(motor(derivatives), [0.0], t_end=0.5, dt=dt)
        errors.append(np.abs(run.v[-1] - exact_motor(0.5)).max())
        assert run.states["current"] is not None and run.states["current"][0] == 0.5
    assert np.log2(errors[0] / errors[1]) > 1.9 and np.log(errors[1] / errors[2]) / np.log(5) > 1.9
    assert run.audit().ok, str(run.audit())


def test_motor_with_a_chosen_accuracy():
    for rtol in (1e-4, 1e-6, 1e-8):
        run = nga.simulate(motor(), [0.0], t_end=0.5, rtol=rtol)
        assert np.abs(run.v[-1] - exact_motor(0.5)).max() < 10 * rtol * np.abs(run.v).max()
    run = nga.simulate(motor(), [0.0], t_end=0.5, rtol=1e-11)
    assert run.v[-1] == pytest.approx(exact_motor(0.5), abs=1e-9)
    assert run.states["current"][-1] == pytest.approx(exact_motor(0.5)[1], abs=1e-9)


AREA, MASS, BULK, VOLUME, FLOW, DAMPING, SPRING = 1e-3, 20.0, 1e8, 2e-4, 1e-4, 400.0, 3e4


def cylinder():
    """A piston on a spring, pushed by oil: p_dot = bulk (flow - A v) / (V + A x), with p in pascals."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "piston")
    model.appendBodyToJoint(joint, pin.Inertia(MASS, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_force(nga.JointSpring("piston", SPRING, 0.0, DAMPING))
    scene.add_state(
        "pressure",
        lambda t, q, v, p: BULK * (FLOW * np.sin(20.0 * t) - AREA * v[0]) / (VOLUME + AREA * q[0]),
        start=1e5,
        force=lambda t, q, v, p: AREA * p,
        scale=1e5,
    )
    return scene


def exact_cylinder(t_end):
    def rate(t, y):
        x, v, p = y
        a = (AREA * p - SPRING * x - DAMPING * v) / MASS
        return v, a, BULK * (FLOW * np.sin(20.0 * t) - AREA * v) / (VOLUME + AREA * x)

    return solve_ivp(rate, (0.0, t_end), (0.0, 0.0, 1e5), method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]


def test_cylinder_in_both_modes():
    x, v, p = exact_cylinder(0.1)
    errors = []
    for dt in (4e-4, 2e-4):  # the oil swings with 160 rad/s
        run = nga.simulate(cylinder(), [0.0], t_end=0.1, dt=dt)
        errors.append([abs(run.q[-1, 0] - x) / 1e-3, abs(run.states["pressure"][-1] - p) / 1e5])
    slopes = np.log2(np.array(errors[0]) / np.array(errors[1]))
    assert (slopes > 1.9).all(), (slopes, errors)
    assert run.audit().ok, str(run.audit())
    run = nga.simulate(cylinder(), [0.0], t_end=0.1, rtol=1e-11)
    assert run.q[-1, 0] == pytest.approx(x, abs=1e-9) and run.states["pressure"][-1] == pytest.approx(p, rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_of_the_equations_of_motion(seed):
    """Of the residual with several states that feel and drive a whole arm."""
    scene, q0, _ = robots.load("arm")
    rng = np.random.default_rng(seed)
    A, B, C = rng.normal(size=(2, 7)), rng.normal(size=(2, 7)), rng.normal(size=(7, 2))

    def rate(t, q, v, z):
        return np.array([np.sin(A @ q).sum(), z[0] * z[1]]) + B @ v - z

    scene.add_state("filters", rate, start=(0.3, -0.2), force=lambda t, q, v, z: C @ np.tanh(z) * np.cos(q[0]))
    system = System(scene)
    q = np.concatenate((q0 + 0.1 * rng.normal(size=7), np.zeros(2)))
    v, a = rng.normal(size=(2, 9))
    found = system.dynamics(0.1, q, v, a)
    K, D = np.array(found.K), np.array(found.D)
    h = 1e-6
    for i, e in enumerate(np.eye(9)):
        by_q = [system.dynamics(0.1, q + s * h * e, v, a).residual.copy() for s in (1, -1)]
        by_v = [system.dynamics(0.1, q, v + s * h * e, a).residual.copy() for s in (1, -1)]
        assert K[:, i] == pytest.approx((by_q[0] - by_q[1]) / (2 * h), abs=1e-4)
        assert D[:, i] == pytest.approx((by_v[0] - by_v[1]) / (2 * h), abs=1e-4)


def filtered():
    """A cube that falls onto the ground; a filter of its height, and one that pushes."""
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("cube", coal.Box(0.2, 0.2, 0.2), mass=1.0)
    scene.add_contact("cube", "ground", mu=0.3)
    scene.add_state("height", lambda t, q, v, z: 10.0 * (q[2] - z))
    scene.add_state("thrust", lambda t, q, v, z: 5.0 * (2.0 - z), force=lambda t, q, v, z: np.append(z, np.zeros(5)))
    return scene


@pytest.mark.parametrize("how", [{"dt": 4e-3}, {"rtol": 1e-7}], ids=("dt", "rtol"))
def test_with_contact(how):
    run = nga.simulate(filtered(), [0.0, 0.0, 0.15, 0.0, 0.0, 0.0, 1.0], t_end=0.3, **how)
    assert run.states["thrust"] == pytest.approx(2.0 * (1.0 - np.exp(-5.0 * run.t)), abs=1e-4)
    # no jump where the cube lands, and friction holds until the thrust is more than mu m g = 2.9 N: it never is
    assert np.abs(np.diff(run.states["height"])).max() < 0.05
    assert run.q[-1, 2] == pytest.approx(0.1, abs=1e-9)
    assert run.audit().ok, str(run.audit())
    assert np.abs(run.v[-1, :6]).max() < 1e-6


@pytest.mark.parametrize("side", [-0.01, 0.01])
@pytest.mark.parametrize("how", [{"dt": 1e-2}, {"rtol": 1e-8}], ids=("dt", "rtol"))
def test_a_thrust_that_grows_to_what_friction_holds(side, how):
    """A filter pushes a block with mu m g (1 +- 1 %) in the end: it stays, or slips from the moment in closed form."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene, hold = nga.Scene(model), 0.3 * 9.81
    scene.add_plane("ground")
    scene.add_geometry("block", coal.Sphere(0.1), parent="block")
    scene.add_contact("block", "ground", mu=0.3)
    end = hold * (1 + side)
    thrust = lambda t, q, v, z: np.array([z[0], 0.0, 0.0])  # noqa: E731
    scene.add_state("thrust", lambda t, q, v, z: 20.0 * (end - z), start=0.9 * end, force=thrust)
    run = nga.simulate(scene, [0.0, 0.0, 0.1], t_end=0.25, **how)
    exact = 0.0
    if side > 0.0:
        s = 0.25 - np.log(0.1 * end / (end - hold)) / 20.0  # since it slips
        exact = side * hold * (s**2 / 2 - s / 20 + (1 - np.exp(-20 * s)) / 400)
    assert run.q[-1, 0] == pytest.approx(exact, abs=1e-14 if side < 0 else 1e-6 if "dt" in how else 1e-8)
    assert run.audit().ok, str(run.audit())


def test_saved_resumed_pickled_and_by_hand(tmp_path):
    scene, q0 = filtered(), [0.0, 0.0, 0.15, 0.0, 0.0, 0.0, 1.0]
    whole = nga.simulate(scene, q0, t_end=0.16, dt=4e-3)
    nga.simulate(scene, q0, t_end=0.08, dt=4e-3).save(tmp_path / "half.npz")
    half = nga.Trajectory.load(tmp_path / "half.npz")
    assert np.array_equal(half.states["thrust"], whole.states["thrust"][:21])
    rest = nga.simulate(scene, state=half.final_state, t_end=0.16)
    assert np.array_equal(rest.v[-1], whole.v[-1])
    again = nga.simulate(scene=filtered(), q0=q0, t_end=0.16, dt=4e-3)
    assert np.array_equal(again.v, whole.v)
    simulator = nga.Simulator(scene, 4e-3, record=True)
    state = simulator.initial_state(q0)
    for _ in range(40):
        state = simulator.step(state)
    assert np.array_equal(simulator.trajectory().v, whole.v)
    state = simulator.step(state, tau=np.zeros(6))
    assert simulator.sensors(state).contact_force("cube").force[2] == pytest.approx(9.81, rel=1e-6)
    # a scene pickles with functions that do
    linear = nga.Scene()
    linear.add_body("cube", coal.Box(0.2, 0.2, 0.2), mass=1.0)
    linear.add_state("decay", decay, start=2.0)
    copy = pickle.loads(pickle.dumps(linear))
    assert nga.simulate(copy, q0, t_end=0.1, dt=1e-3).states["decay"][-1] == pytest.approx(2 * np.exp(-0.1), abs=1e-6)


def decay(t, q, v, z):
    return -z


def test_on_a_robot_with_servos_and_limits():
    """A quadruped whose servos, joint limits and contacts know nothing of the state that filters its height."""
    scene, q0, v0 = robots.load("quadruped", height=0.01)
    scene.add_state("filter", lambda t, q, v, z: 20.0 * (q[2] - z), start=q0[2])
    run = nga.simulate(scene, q0, v0, t_end=0.1, dt=2e-3)
    plain = nga.simulate(*robots.load("quadruped", height=0.01), t_end=0.1, dt=2e-3)
    assert run.q[:, :19] == pytest.approx(plain.q, abs=1e-9)
    assert run.audit().ok, str(run.audit())


def test_errors_say_what_to_do():
    scene = filtered()
    with pytest.raises(nga.SceneError, match="already"):
        scene.add_state("thrust", decay)
    with pytest.raises(nga.SceneError, match="rate.*shape"):
        scene.add_state("wrong", lambda t, q, v, z: np.zeros(3))
    with pytest.raises(nga.SceneError, match="force.*shape"):
        scene.add_state("wrong", decay, force=lambda t, q, v, z: np.zeros(2))
    with pytest.raises(nga.SceneError, match="six matrices"):
        scene.add_state("wrong", decay, derivatives=lambda t, q, v, z: np.zeros(2))
    with pytest.raises(nga.SceneError, match="scale = 0.0"):
        scene.add_state("wrong", decay, scale=0.0)
    count = iter(range(10**6))
    with pytest.raises(nga.SceneError, match="must depend on its arguments alone"):
        scene.add_state("wrong", lambda t, q, v, z: float(next(count)))
    with pytest.raises(nga.SceneError, match="add models before states"):
        scene.add_body("late", coal.Sphere(0.1), mass=1.0)
    beams = robots.load("cantilever")[0]
    with pytest.raises(nga.SceneError, match="beams cannot have states"):
        beams.add_state("wrong", decay)
    with pytest.raises(nga.SceneError, match="beams cannot have own unilateral"):
        beams.add_unilateral(nga.UnilateralConstraint(lambda t, q: 1.0, name="wrong"))
    with pytest.raises(nga.SceneError, match="states or own unilateral constraints cannot have beams"):
        scene.add_beam(nga.PlanarBeam(1.0, EA=1e5, EI=20.0, line_density=0.5, elements=2), "late")
    assert [state.name for state in scene.states] == ["height", "thrust"]
