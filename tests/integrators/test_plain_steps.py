"""Steps in the engine are those of `attempt`, to the last bit, and nothing that happens is passed over."""

import coal
import example_robot_data
import numpy as np
import pinocchio as pin
import pytest
from work import work_of

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.integrators.plain_steps import plain_of, plain_steps
from ngalpha_pin.system.system import System

pytestmark = pytest.mark.skipif(kernel.library is None, reason=f"no compiled kernel: {kernel.origin}")
ARRAYS = ("t", "q", "v", "a", "P_N", "P_F", "La_N", "La_F", "la_N", "la_F", "la_g", "La_g", "tau_f", "P_f", "n_iter")
DT = 1e-3


@pytest.fixture
def in_python(monkeypatch):
    """A function that makes all steps as if the engine knew nothing of the scene."""

    def run(*args, **kwargs):
        with monkeypatch.context() as patch:
            for name in ("plain_steps", "native_attempt"):
                patch.setattr(f"ngalpha_pin.integrators.{name}.plain_of", lambda system: None)
            return nga.simulate(*args, **kwargs)

    return run


def same_bits(found, wanted):
    for name in ARRAYS:
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    assert found.final_state.clearance == wanted.final_state.clearance
    assert np.array_equal(found.final_state.near, wanted.final_state.near)


def arm_with(force, **joints):
    scene, q0, v0 = robots.load("arm")
    scene.forces.clear()
    for name, value in joints.items():
        setattr(scene.joints, name, value)
    scene.add_force(force(scene))
    return scene, q0, v0


def pd(scene):
    return nga.JointPD(scene.q_ref + 0.3, kp=200.0, kd=3.0)


def law(scene):
    return nga.Control(lambda t, q, v: np.sin(5.0 * t) - 2.0 * v)


def at_the_limits(scene):
    scene.model.lowerEffortLimit[:], scene.model.upperEffortLimit[:] = -2.0, 2.0
    return pd(scene)


def pd_and_spring(scene):
    scene.add_force(nga.JointSpring(scene.model.names[2], stiffness=30.0, rest=0.2, damping=0.1))
    return pd(scene)


def pd_and_samples(scene):
    scene.add_force(nga.SampledControl(lambda t, q, v, forces: np.sin(50.0 * t) * np.ones(v.shape), rate=100.0))
    return pd(scene)


@pytest.mark.parametrize(
    "name",
    [
        "rotating_ball",
        "ball_in_corner",
        "ball_in_cylinder",
        "painleve_rod",
        "tippe_top",
        "cradle",
        "quadruped",
        "box_on_incline",
        "four_bar",
        "bricard",
        "n_four_bar",
    ],
)
def test_runs_are_those_without_the_engine(name, in_python):
    scene, q0, v0 = robots.load(name)
    run = nga.simulate(scene, q0, v0, t_end=0.3, dt=DT)
    same_bits(run, in_python(scene, q0, v0, t_end=0.3, dt=DT))


def test_springs_and_wrenches_are_those_of_numpy_to_rounding(in_python):
    scene, q0, v0 = robots.load("andrews")
    run = nga.simulate(scene, q0, v0, t_end=0.06, dt=DT)
    wanted = in_python(scene, q0, v0, t_end=0.06, dt=DT)
    for name in ("q", "v", "a", "la_g", "La_g"):
        found = getattr(run, name)
        assert np.abs(found - getattr(wanted, name)).max() <= 1e-11 * np.abs(found).max()
    assert np.array_equal(run.n_iter, wanted.n_iter)


def beams_between_bodies():
    """A body that floats with an arm, a beam that is clamped and one that is not, tied to each other by rods."""
    model = pin.Model()
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    model.appendBodyToJoint(base, pin.Inertia.FromBox(1.0, 0.2, 0.3, 0.1), pin.SE3.Identity())
    arm = model.addJoint(base, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0])), "arm")
    model.appendBodyToJoint(arm, pin.Inertia.FromSphere(0.3, 0.1), pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.0])))
    scene = nga.Scene(model)
    first = nga.PlanarBeam(0.5, EA=1e3, EI=1.0, line_density=0.4, elements=3, damping=1e-2)
    tilted = pin.SE3(pin.utils.rotate("x", 1.2), np.array([0.0, 0.1, 0.0]))
    scene.add_beam(first, "first")
    scene.add_beam(nga.PlanarBeam(0.3, EA=2e3, EI=0.5, line_density=0.3, degree=2, elements=4, plane=tilted), "second")
    for name, beam, xi in (("a", "first", 0.0), ("b", "first", 0.37), ("c", "second", 1.0)):
        scene.add_beam_point(name, beam, xi)
    scene.add_constraint(nga.Weld("world", "a", placement_a=first.plane))
    scene.add_constraint(nga.Distance("b", "c", length=np.hypot(0.3 - 0.185, 0.1)))
    scene.add_constraint(nga.Distance("arm", "b", length=0.085))
    scene.add_load(nga.PointLoad("c", force=(0.0, 1.0, -2.0), moment=0.1))
    scene.add_force(nga.JointPD(pin.neutral(model), kp=5.0, kd=0.1))
    scene.add_force(nga.Spring("world", "arm", stiffness=20.0, rest=0.05, damping=0.5))
    v0 = np.zeros(len(scene.q_ref) - 1)  # of a beam there are as many as coordinates
    v0[3] = 1.0
    return scene, scene.q_ref, v0


@pytest.mark.parametrize("make", [beams_between_bodies, lambda: robots.load("cantilever", damping=1e-3)])
def test_beams_are_those_of_numpy_to_rounding(make, in_python):
    scene, q0, v0 = make()
    assert plain_of(System(scene)) is not None
    run = nga.simulate(scene, q0, v0, t_end=0.02, dt=DT)
    wanted = in_python(scene, q0, v0, t_end=0.02, dt=DT)
    for name in ("q", "v", "a", "la_g"):
        found = getattr(run, name)
        assert np.abs(found - getattr(wanted, name)).max() <= 1e-9 * np.abs(found).max(), name
    assert np.array_equal(run.n_iter, wanted.n_iter)


@pytest.mark.parametrize("name, t_end", [("go2", 0.08), ("solo12", 0.06)])
def test_robots_that_land_are_those_without_the_engine(name, t_end, in_python):
    """Their feet close one after the other, slip, and stop slipping."""
    scene, q0, v0 = robots.load(name, height=0.005)
    run = nga.simulate(scene, q0, v0, t_end=t_end, dt=DT)
    same_bits(run, in_python(scene, q0, v0, t_end=t_end, dt=DT))
    assert len(run.impacts.t)


def pushed(steps):
    """The end of a quadruped whose joints random torques push about, each for ten steps."""
    scene, q0, _ = robots.load("quadruped", height=0.0, kp=40.0, kd=1.0)
    simulator, random = nga.Simulator(scene, 2e-3), np.random.default_rng(0)
    state, tau = simulator.initial_state(scene.place_on("ground", q0, 1e-3)), np.zeros(18)
    for _ in range(steps // 10):
        tau[6:] = random.uniform(-5.0, 5.0, 12)
        state = simulator.steps(state, 10, tau)[-1].state
    return simulator.system, state


def test_random_torques_make_the_motion_that_they_make_without_the_engine(monkeypatch):
    system, found = pushed(100)
    assert system.plain.engine.attempts > 10
    for name in ("plain_steps", "native_attempt"):
        monkeypatch.setattr(f"ngalpha_pin.integrators.{name}.plain_of", lambda system: None)
    wanted = pushed(100)[1]
    for name in ("q", "v", "a", "la_N", "la_F", "contacts", "near", "clearance"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name


@pytest.mark.parametrize(
    "force", [pd, pytest.param(law, marks=pytest.mark.long), at_the_limits, pd_and_spring, pd_and_samples]
)
def test_forces_are_those_of_the_scene(force, in_python):
    scene, q0, v0 = arm_with(force)
    run = nga.simulate(scene, q0, v0, t_end=0.1, dt=DT)
    same_bits(run, in_python(scene, q0, v0, t_end=0.1, dt=DT))
    assert np.abs(run.v).max() > 0.1


@pytest.mark.parametrize("friction, limit", [(2.0, None), (0.0, 0.1), (2.0, 0.1)])
def test_dry_friction_and_limits_of_joints(friction, limit, in_python):
    """The motors pull the arm 0.3 rad away; its friction holds it before, or it comes to its limits."""
    scene, q0, v0 = arm_with(pd)
    model = scene.model
    model.upperDryFrictionLimit[:], model.lowerDryFrictionLimit[:] = friction, -friction
    if limit is not None:
        model.upperPositionLimit[:], model.lowerPositionLimit[:] = q0 + limit, q0 - limit
    run = nga.simulate(scene, q0, v0, t_end=0.3, dt=DT)
    same_bits(run, in_python(scene, q0, v0, t_end=0.3, dt=DT))
    assert np.abs(run.tau_f).max(initial=0.0) == pytest.approx(friction, rel=1e-6)
    assert (len(run.impacts.t) > 0) == (limit is not None)
    # a joint that sticks at its limit has dependent directions, which are for the solvers behind Newton's method
    plain = work_of(run.system, run.final_state, DT, 20, nga.GeneralizedAlpha()).counts["plain"]
    assert plain >= 8 or (friction > 0.0 and limit is not None)


def test_paper_laws_restitution_and_rho_inf(in_python):
    scene, q0, v0 = robots.load("rotating_ball", omega=50.0)
    method = nga.GeneralizedAlpha(rho_inf=0.9, laws="paper")
    run = nga.simulate(scene, q0, v0, t_end=0.6, dt=DT, method=method)
    same_bits(run, in_python(scene, q0, v0, t_end=0.6, dt=DT, method=method))


def test_limits_of_joints_that_are_near_stop_no_step_and_are_not_passed_over(in_python):
    """A pendulum that swings, at most 0.3 rad from its limits, and falls into them once it is let go."""
    model = pin.Model()
    limits = np.array([np.inf]), np.array([np.inf]), np.array([-0.3]), np.array([0.3])
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "hinge", *limits)
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0])))
    scene = nga.Scene(model)
    arguments = scene, np.array([0.05]), np.array([0.2])
    run = nga.simulate(*arguments, t_end=0.8, dt=DT)
    same_bits(run, in_python(*arguments, t_end=0.8, dt=DT))
    assert run.q.max() == pytest.approx(0.3, abs=1e-12) and run.la_N.max() > 1.0
    simulator = nga.Simulator(scene, DT)
    simulator.steps(simulator.initial_state(*arguments[1:]), 100)
    assert simulator.system.plain.engine.steps >= 98


def test_steps_one_by_one_are_those_of_a_run():
    scene, q0, v0 = robots.load("tippe_top")
    run = nga.simulate(scene, q0, v0, t_end=0.2, dt=DT)
    simulator = nga.Simulator(scene, DT)
    state = simulator.initial_state(q0, v0)
    for _ in range(200):
        state = simulator.step(state)
    assert np.array_equal(state.q, run.q[-1])


def test_torque_that_is_held_is_in_every_step():
    """A wheel on an axle, tau / I t exactly."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "axle")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.diag([1.0, 1.0, 0.5])), pin.SE3.Identity())
    simulator = nga.Simulator(nga.Scene(model), DT)
    state = simulator.initial_state(np.zeros(1))
    for _ in range(100):
        state = simulator.step(state, np.array([2.0]))
    assert simulator.system.plain.engine.steps >= 98
    assert state.v[0] == pytest.approx(2.0 / 0.5 * 0.1, rel=1e-12)


def test_reference_that_is_changed_between_steps_is_the_new_one():
    scene, q0, v0 = arm_with(pd)
    servo, simulator = scene.forces[0], nga.Simulator(scene, DT)
    state = simulator.initial_state(q0, v0)
    for _ in range(3):
        state = simulator.step(state)
    before = simulator.step(state).v
    servo.q_ref = servo.q_ref - 0.6
    change = simulator.step(state).v - before
    assert np.abs(change).max() > 1e-3


def drop(height):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="ball")
    scene.add_contact("ball", "ground", mu=0.3, e_N=0.5)
    return scene, np.array([0, 0, 0.1 + height, 0, 0, 0, 1.0])


def test_no_impact_is_passed_over():
    scene, q0 = drop(0.3)
    run = nga.simulate(scene, q0, t_end=0.5, dt=DT)
    assert run.impacts.t[0] == pytest.approx(np.sqrt(2 * 0.3 / 9.81), abs=1e-6)
    assert run.q[:, 2].min() >= 0.1 - 1e-12


def test_a_state_that_is_not_plain_is_left_alone_and_not_tried_twice():
    scene, q0 = drop(0.0)
    system, parameters = System(scene), nga.GeneralizedAlpha().parameters
    state = initial_state(system, q0, np.zeros(6))
    assert plain_steps(Piece(parameters, system, state, DT), 5) is None  # no step before it, whose memory it would need
    first = nga.GeneralizedAlpha().step(system, state, DT).state
    before = system.plain.engine.evaluations
    results = plain_steps(Piece(parameters, system, first, DT), 5)
    assert [result.state.t for result in results] == pytest.approx([2 * DT, 3 * DT, 4 * DT, 5 * DT, 6 * DT])
    assert system.plain.engine.evaluations - before == 5  # at rest the start of a step solves it
    flies = initial_state(system, q0 + 0.05 * np.eye(7)[2], np.array([0, 0, -60.0, 0, 0, 0]))
    flies = nga.GeneralizedAlpha().step(system, flies, 1e-4).state
    for _ in range(2):
        before = system.plain.engine.evaluations
        ahead = plain_steps(Piece(parameters, system, flies, 1e-4), 50)
        if ahead is None:
            break
        assert len(ahead) < 9  # the ball arrives in the ninth step
        flies = ahead[-1].state
    assert plain_steps(Piece(parameters, system, flies, 1e-4), 50) is None
    before = system.plain.engine.evaluations
    assert plain_steps(Piece(parameters, system, flies, 1e-4), 50) is None
    assert system.plain.engine.evaluations == before


def test_error_in_a_function_of_the_user_keeps_the_run_so_far():
    def fails(t, q, v):
        if t > 0.05:
            raise RuntimeError("a sensor is missing")
        return np.zeros(len(v))

    scene, q0, v0 = robots.load("arm")
    scene.add_force(nga.Control(fails))
    with pytest.raises(nga.NgalphaError, match="a sensor is missing") as caught:
        nga.simulate(scene, q0, v0, t_end=0.2, dt=DT)
    assert caught.value.trajectory.t[-1] == pytest.approx(0.05, abs=2 * DT)


@pytest.mark.filterwarnings("ignore::UserWarning")  # pairs of the file that overlap are left out
def test_pairs_of_solids_that_stay_apart(in_python):
    """ANYmal stands, any two of its bodies may touch: the engine knows from the last looks that none of them do."""
    robot = example_robot_data.load("anymal")
    scene = nga.Scene(robot.model, robot.collision_model)
    scene.add_plane("ground")
    scene.add_contact("*", "ground", mu=0.8)
    scene.add_contact("*", "*", mu=0.5)
    scene.add_force(nga.JointPD(robot.q0, kp=300.0, kd=10.0))
    q0 = scene.place_on("ground", robot.q0, clearance=1e-3)
    run = nga.simulate(scene, q0, t_end=0.06, dt=DT)
    assert run.system.slots.n > 0 and len(run.impacts.t)
    same_bits(run, in_python(scene, q0, t_end=0.06, dt=DT))


def two_arms(apart):
    """A scene of two pendulums whose bobs meet at the bottom, or miss each other."""
    model = pin.Model()
    geometries = pin.GeometryModel()
    for side in (-1.0, 1.0):
        place = pin.SE3(np.eye(3), np.array([0.05 * side, apart * side, 0.0]))
        joint = model.addJoint(0, pin.JointModelRY(), place, f"arm{side:+.0f}")
        bob = pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), 1e-3 * np.eye(3)), bob)
        geometries.addGeometryObject(pin.GeometryObject(f"bob{side:+.0f}", joint, bob, coal.Box(0.09, 0.05, 0.05)))
    scene = nga.Scene(model, geometries)
    scene.add_contact("bob*", "bob*", e_N=0.5)
    return scene


@pytest.mark.parametrize("apart, hits", [(0.0, True), (0.04, False)])
def test_pairs_of_solids_that_meet(apart, hits, in_python):
    scene, q0 = two_arms(apart), np.array([0.8, -0.8])
    run = nga.simulate(scene, q0, t_end=1.0, dt=DT)
    same_bits(run, in_python(scene, q0, t_end=1.0, dt=DT))
    assert (len(run.impacts.t) > 0) == hits
    assert work_of(run.system, run.final_state, DT, 20, nga.GeneralizedAlpha()).counts["plain"] >= 10
