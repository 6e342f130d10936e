"""What cannot be used is refused before the first step, with words that say what is wrong."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots


@pytest.fixture
def ball():
    return robots.load("rotating_ball")


@pytest.fixture
def top():
    return robots.load("tippe_top")


def changed(x, i, value):
    x = x.copy()
    x[i] = value
    return x


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite(ball, value):
    scene, q0, v0 = ball
    with pytest.raises(nga.SceneError, match=r"q0\[1\] = .* is not finite"):
        nga.simulate(scene, changed(q0, 1, value), v0, t_end=1.0, dt=1e-3)
    with pytest.raises(nga.SceneError, match=r"v0\[2\] = .* is not finite"):
        nga.simulate(scene, q0, changed(v0, 2, value), t_end=1.0, dt=1e-3)


@pytest.mark.parametrize("shape", [(3,), (5,), (4, 1), (1, 4), ()])
def test_wrong_shape_of_q0(ball, shape):
    scene, _, v0 = ball
    with pytest.raises(nga.SceneError, match=r"q0 has shape .*: expected a vector of shape \(4,\)"):
        nga.simulate(scene, np.ones(shape), v0, t_end=1.0, dt=1e-3)


def test_wrong_shape_of_v0(ball):
    scene, q0, _ = ball
    with pytest.raises(nga.SceneError, match=r"v0 has shape \(4,\): expected a vector of shape \(3,\)"):
        nga.simulate(scene, q0, np.zeros(4), t_end=1.0, dt=1e-3)


def test_q0_that_is_no_array_of_numbers(ball):
    scene, _, v0 = ball
    with pytest.raises(nga.SceneError, match="q0 = .*: expected finite numbers"):
        nga.simulate(scene, ["a", "b", "c", "d"], v0, t_end=1.0, dt=1e-3)


def test_quaternion_that_is_not_a_unit_one(top):
    scene, q0, v0 = top
    with pytest.raises(nga.SceneError, match=r"quaternion .*'root_joint' .*pin\.normalize"):
        nga.simulate(scene, np.concatenate((q0[:3], 1.1 * q0[3:])), v0, t_end=1.0, dt=1e-3)
    with pytest.raises(nga.SceneError, match="quaternion .*'root_joint'"):
        nga.simulate(scene, np.zeros(7), v0, t_end=1.0, dt=1e-3)


def test_angle_that_is_not_on_the_unit_circle(ball):
    scene, q0, v0 = ball
    with pytest.raises(nga.SceneError, match=r"\(cos, sin\) of joint 'phi'"):
        nga.simulate(scene, changed(q0, 2, 0.5), v0, t_end=1.0, dt=1e-3)


@pytest.mark.parametrize(
    ("joint", "q"),
    [
        (pin.JointModelSpherical(), [0.0, 0.0, 0.0, 2.0]),
        (pin.JointModelPlanar(), [0.0, 0.0, 2.0, 0.0]),
        (pin.JointModelRUBX(), [2.0, 0.0]),
    ],
)
def test_every_joint_with_a_unit_condition_is_checked(joint, q):
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    with pytest.raises(nga.SceneError, match="of joint 'joint' .*normalise it"):
        nga.simulate(nga.Scene(model), np.array(q), t_end=1.0, dt=1e-3)


def test_joint_inside_a_composite_is_checked_too():
    model, composite = pin.Model(), pin.JointModelComposite(2)
    composite.addJoint(pin.JointModelTranslation())
    composite.addJoint(pin.JointModelSpherical())
    model.addJoint(0, composite, pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    with pytest.raises(nga.SceneError, match="norm"):
        nga.simulate(nga.Scene(model), np.array([0, 0, 0, 0, 0, 0, 2.0]), t_end=1.0, dt=1e-3)


def test_joint_inside_a_composite_is_not_taken_for_another():
    model, composite = pin.Model(), pin.JointModelComposite(2)
    composite.addJoint(pin.JointModelSpherical())
    composite.addJoint(pin.JointModelTranslation())
    model.addJoint(0, composite, pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    assert nga.simulate(nga.Scene(model), np.array([0, 0.6, 0.8, 0, 3.0, 0, 0]), t_end=0.01, dt=1e-3).success


def test_penetration_at_the_start(ball, top):
    scene, q0, v0 = ball
    with pytest.raises(nga.Penetration, match=r"q0 penetrates: ball_0/ground by 0\.03 m"):
        nga.simulate(scene, changed(q0, 1, 0.07), v0, t_end=1.0, dt=1e-3)
    scene, q0, v0 = top
    with pytest.raises(nga.Penetration, match=r"top_0/ground by .*, top_1/ground by"):
        nga.simulate(scene, changed(q0, 2, -0.1), v0, t_end=1.0, dt=1e-3)
    # a gap of exactly zero is contact
    scene, q0, v0 = ball
    assert nga.simulate(scene, changed(q0, 1, 0.1), v0, t_end=0.01, dt=1e-3).success


def test_body_without_mass():
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ghost")
    with pytest.raises(nga.SceneError, match="mass"):
        nga.simulate(nga.Scene(model), pin.neutral(model), t_end=1.0, dt=1e-3)


@pytest.mark.parametrize("dt", [0.0, -1e-3, np.nan, np.inf, None])
def test_step_that_is_not_positive(ball, dt):
    scene, q0, v0 = ball
    with pytest.raises(nga.SceneError, match="dt = .* expected a positive number of seconds|give a step dt"):
        nga.simulate(scene, q0, v0, t_end=1.0, dt=dt)
    with pytest.raises(nga.SceneError, match="dt = .* expected a positive number of seconds"):
        nga.Simulator(scene, dt)


@pytest.mark.parametrize("t_end", [0.0, -1.0, np.nan, np.inf])
def test_end_that_is_not_after_the_start(ball, t_end):
    scene, q0, v0 = ball
    with pytest.raises(nga.SceneError, match="t_end = .*(must be later|a finite number)"):
        nga.simulate(scene, q0, v0, t_end=t_end, dt=1e-3)


def test_end_before_the_state_that_is_continued(ball):
    scene, q0, v0 = ball
    state = nga.simulate(scene, q0, v0, t_end=0.1, dt=1e-2).final_state
    with pytest.raises(nga.SceneError, match=r"later than the start at t = 0\.1 s"):
        nga.simulate(scene, state=state, t_end=0.1)
    with pytest.raises(nga.SceneError, match="either q0"):
        nga.simulate(scene, q0, v0, state=state, t_end=0.2)
    with pytest.raises(nga.SceneError, match="either q0"):
        nga.simulate(scene, t_end=0.2, dt=1e-3)
    with pytest.raises(nga.SceneError, match="another scene"):
        nga.simulate(robots.load("tippe_top")[0], state=state, t_end=0.2)


def test_unknown_names(ball):
    scene, _, _ = ball
    with pytest.raises(nga.UnknownName, match=r"no geometry named 'ball_O'; did you mean 'ball_0'"):
        scene.add_contact("ball_O", "ground")
    with pytest.raises(nga.UnknownName, match=r"no geometry matches '\*foot\*'; known: ball_0, ground"):
        scene.add_contact("*foot*", "ground")
    with pytest.raises(nga.UnknownName, match="no frame named 'bal'; did you mean 'ball'"):
        scene.add_geometry("dot", coal.Sphere(0.01), parent="bal")
    with pytest.raises(nga.UnknownName, match="no joint named 'hip'"):
        scene.add_force(nga.JointSpring("hip", 1.0))


def test_geometry_declared_twice(ball):
    scene, _, _ = ball
    with pytest.raises(nga.SceneError, match="a geometry named 'ground' already"):
        scene.add_plane("ground")


def test_contact_declared_twice(ball):
    scene, _, _ = ball
    for a, b in (("ball_0", "ground"), ("ground", "ball_0"), ("*", "ground")):
        with pytest.raises(nga.SceneError, match="declared already"):
            scene.add_contact(a, b)
    assert len(scene.contacts) == 1


def test_refused_contact_leaves_the_scene_as_it_was(ball):
    scene, _, _ = ball
    scene.add_geometry("second", coal.Sphere(0.05), parent="ball")
    with pytest.raises(nga.SceneError, match="declared already"):
        scene.add_contact("*", "ground")
    assert [p.geometry_a for p in scene.contacts] == ["ball_0"]


@pytest.mark.parametrize(
    ("law", "name"),
    [
        ({"mu": -0.1}, "mu"),
        ({"mu": np.nan}, "mu"),
        ({"mu": np.inf}, "mu"),
        ({"e_N": 1.1}, "e_N"),
        ({"e_N": -0.1}, "e_N"),
        ({"e_F": -1.1}, "e_F"),
        ({"contact_radius": -1.0}, "contact_radius"),
    ],
)
def test_coefficients_out_of_range(ball, law, name):
    scene, _, _ = ball
    scene.add_geometry("second", coal.Sphere(0.05), parent="ball")
    with pytest.raises(nga.SceneError, match=f"{name} = .*: expected a finite number"):
        scene.add_contact("second", "ground", **law)


def test_pair_on_one_joint(ball):
    scene, _, _ = ball
    scene.add_geometry("second", coal.Sphere(0.05), parent="ball")
    with pytest.raises(nga.SceneError, match="on one and the same joint"):
        scene.add_contact("second", "ball_0")


def test_half_spaces_do_not_touch(ball):
    scene, q0, v0 = ball
    scene.add_geometry("first", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), parent="ball")
    scene.add_geometry("second", coal.Plane(np.array([0.0, 0.0, -1.0]), 0.0))
    scene.add_contact("first", "second")
    with pytest.raises(nga.SceneError, match="'first' and 'second' are half-spaces or planes"):
        nga.simulate(scene, q0, v0, t_end=1.0, dt=1e-3)


def test_hollow_shape_against_one_that_has_no_corners(ball):
    scene, q0, v0 = ball
    scene.add_geometry("first", coal.Ellipsoid(0.1, 0.2, 0.3), parent="ball")
    scene.add_geometry("second", nga.Hollow(coal.Sphere(5.0)))
    scene.add_contact("first", "second")
    with pytest.raises(nga.SceneError, match="Hollow Sphere 'second' .*'first' is not available"):
        nga.simulate(scene, q0, v0, t_end=1.0, dt=1e-3)


def test_hollow_of_a_shape_without_an_inside(ball):
    scene, q0, v0 = ball
    with pytest.raises(nga.SceneError, match="not Box"):
        nga.Hollow(coal.Box(1, 1, 1))
    scene.add_geometry("ring", nga.Hollow(coal.Sphere(0.1)))
    scene.add_contact("ball_0", "ring")
    with pytest.raises(nga.SceneError, match="'ball_0' does not fit into the hollow 'ring'"):
        nga.simulate(scene, q0, v0, t_end=1.0, dt=1e-3)


@pytest.mark.parametrize(
    ("point", "normal"), [((0, 0, 0), (0, 0, 0)), ((0, 0), (0, 0, 1)), ((0, 0, 0), (0, 1)), ((0, 0, np.nan), (0, 0, 1))]
)
def test_plane_without_a_normal(ball, point, normal):
    with pytest.raises(nga.SceneError, match="plane 'wall': (point|normal)"):
        ball[0].add_plane("wall", point, normal)


def test_scene_of_something_else():
    with pytest.raises(nga.SceneError, match=r"model = .*, a str: expected a pin\.Model"):
        nga.Scene("robot.urdf")
    with pytest.raises(nga.SceneError, match="no URDF file at"):
        nga.Scene.from_urdf("robot.urdf")
    with pytest.raises(nga.SceneError, match="no MJCF file at"):
        nga.Scene.from_mjcf("robot.xml")


def test_file_that_is_no_robot(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text("<robot>")
    with pytest.raises(nga.SceneError, match=r"robot\.urdf cannot be read"):
        nga.Scene.from_urdf(path)


def test_file_that_is_no_trajectory(tmp_path):
    with pytest.raises(nga.SceneError, match="cannot be read as a trajectory"):
        nga.Trajectory.load(tmp_path / "missing.npz")
    path = tmp_path / "other.npz"
    for content in ({"x": np.zeros(3)}, {"header": np.array("{}")}):
        np.savez(path, **content)
        with pytest.raises(nga.SceneError, match="cannot be read as a trajectory"):
            nga.Trajectory.load(path)
    path.write_text("not a zip file")
    with pytest.raises(nga.SceneError, match="cannot be read as a trajectory"):
        nga.Trajectory.load(path)


@pytest.mark.parametrize(
    "force",
    [
        lambda: nga.JointPD(np.zeros(3), 1.0, 1.0),
        lambda: nga.JointPD(np.zeros(4), np.ones(4), 1.0),
        lambda: nga.JointPD(np.zeros(4), -1.0, 1.0),
        lambda: nga.JointPD(np.zeros(4), 1.0, np.nan),
        lambda: nga.JointPD(np.full(4, np.nan), 1.0, 1.0),
        lambda: nga.Control(lambda t, q, v: np.zeros(4)),
    ],
)
def test_force_that_does_not_fit(ball, force):
    with pytest.raises(nga.SceneError):
        ball[0].add_force(force())
    assert not ball[0].forces


@pytest.mark.parametrize(("stiffness", "damping"), [(-1.0, 0.0), (np.nan, 0.0), (1.0, -1.0)])
def test_spring_that_pushes_away(stiffness, damping):
    with pytest.raises(nga.SceneError, match="expected a finite number, not negative"):
        nga.JointSpring("x", stiffness, damping=damping)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"rho_inf": 1.1}, "rho_inf = 1.1"),
        ({"rho_inf": -0.1}, "rho_inf"),
        ({"rho_inf": np.nan}, "rho_inf"),
        ({"solver": "magic"}, "choose one of auto, newton, fixed_point"),
        ({"laws": "mine"}, "choose one of second-order, paper"),
        ({"tol": 0.0}, "tol"),
        ({"max_iter": 0}, "max_iter"),
    ],
)
def test_method_out_of_range(parameters, words):
    with pytest.raises(nga.SceneError, match=words):
        nga.GeneralizedAlpha(**parameters)


@pytest.mark.parametrize("tau", [np.zeros(4), np.full(3, np.nan), 1.0])
def test_torque_that_does_not_fit(ball, tau):
    scene, q0, v0 = ball
    simulator = nga.Simulator(scene, 1e-3)
    with pytest.raises(nga.SceneError, match=r"tau.*(shape \(3,\)|is not finite)"):
        simulator.step(simulator.initial_state(q0, v0), tau=tau)


def test_word_for_failures(ball):
    scene, q0, v0 = ball
    with pytest.raises(nga.SceneError, match="choose one of raise, stop"):
        nga.simulate(scene, q0, v0, t_end=1.0, dt=1e-3, on_failure="ignore")


HASTY = nga.GeneralizedAlpha(solver="newton", max_iter=1)
"""One Newton correction: not enough for the first impact of the ball in the corner."""


def test_step_without_a_solution_raises_with_what_there_is():
    scene, q0, v0 = robots.load("ball_in_corner")
    with pytest.raises(nga.NotConverged, match=r"did not converge with ball_0/.*try a smaller dt") as caught:
        nga.simulate(scene, q0, v0, t_end=2.0, dt=1e-3, method=HASTY)
    error = caught.value
    assert isinstance(error, nga.NgalphaError)
    assert error.contacts
    assert set(error.contacts) <= {"ball_0/right", "ball_0/left"}
    assert error.trajectory.t[-1] == error.t
    assert not error.trajectory.success
    assert error.trajectory.message == str(error)
    assert np.isfinite(error.trajectory.q).all()
    assert not error.trajectory.audit().ok


def test_step_without_a_solution_stops_where_asked():
    scene, q0, v0 = robots.load("ball_in_corner")
    run = nga.simulate(scene, q0, v0, t_end=2.0, dt=1e-3, method=HASTY, on_failure="stop")
    assert not run.success
    assert "did not converge" in run.message
    assert 0.2 < run.t[-1] < 2.0
    assert len(run.t) == len(run.q) == len(run.P_N) == len(run.solver_path)
    assert run.audit().penetration < 1e-9
    # and goes on with a method that can
    rest = nga.simulate(scene, state=run.final_state, t_end=run.t[-1] + 0.01)
    assert rest.success


def test_simulator_raises_without_a_trajectory():
    scene, q0, v0 = robots.load("ball_in_corner")
    simulator = nga.Simulator(scene, 1e-3, HASTY)
    state = simulator.initial_state(q0, v0)
    with pytest.raises(nga.NotConverged) as caught:
        for _ in range(2000):
            state = simulator.step(state)
    assert caught.value.trajectory is None
    assert caught.value.t == state.t
