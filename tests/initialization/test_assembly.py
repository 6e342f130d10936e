"""Assembly: from rough values to ones that fit, with what moved; wishes that cannot be met are errors with a name."""

import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.robots import _legged, andrews
from ngalpha_pin.robots.four_bar import URDF


def fits(scene, found):
    """A run can start from it: positions, velocities and contacts."""
    nga.Simulator(scene, 1e-3).initial_state(found.q, found.v)


@pytest.mark.parametrize("angle", np.linspace(-3.0, 3.0, 6))
def test_four_bar_from_a_rough_start(angle):
    """The distance of the pins by hand: the law of cosines."""
    scene = nga.Scene.from_urdf(URDF)
    scene.add_constraint(nga.RevoluteJoint("coupler_tip", "rocker_tip", axis=(0, 1, 0)))
    rough = np.array([np.cos(angle), np.sin(angle), 1.0, 0.0, 0.0, 1.0])
    found = nga.assemble(scene, rough, np.array([2.0, 0.0, 0.0]), hold=["crank"])
    fits(scene, found)
    assert found.q[:2] == pytest.approx(rough[:2], abs=1e-15)
    assert found.v[0] == 2.0
    crank = 0.4 * np.array([np.cos(angle), np.sin(angle)])
    rocker = np.array([1.0, 0.0]) + 0.8 * found.q[4:]
    assert np.linalg.norm(rocker - crank) == pytest.approx(1.0, abs=1e-10)
    assert "crank" not in found.moved and "crank" not in found.v_changed
    assert set(found.moved) == {"coupler", "rocker"}
    text = str(found)
    assert f"assembled in {found.rounds} rounds; moved: coupler by" in text
    assert "velocity changed: coupler by" in text


def test_andrews_mechanism_from_a_rough_start():
    scene, q0, v0 = robots.load("andrews")
    rough = q0 + np.random.default_rng(3).uniform(-0.1, 0.1, 7)
    rough[0] = q0[0]
    found = nga.assemble(scene, rough, hold=["beta"])
    np.testing.assert_allclose(andrews.in_order(scene, found.q), list(andrews.ANGLES.values()), atol=1e-10)


def two_bodies():
    model = pin.Model()
    for name in ("left", "right"):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
        inertia = pin.Inertia(1.0, np.array([0.1, 0.0, 0.2]), np.diag([0.1, 0.2, 0.25]))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    return nga.Scene(model)


@pytest.mark.parametrize("turn", [(3.0, 0, 0), (0, np.pi, 0), (1.2, -1.2, 1.2), (-2.0, 0.5, 1.5)])
@pytest.mark.parametrize("kind", [nga.Weld, nga.RevoluteJoint, nga.PrismaticJoint, nga.PlanarJoint])
def test_frames_come_together_the_right_way_round(kind, turn):
    """Products of axes vanish for frames that are back to front as well."""
    scene = two_bodies()
    scene.add_constraint(kind("left", "right"))
    q0 = pin.neutral(scene.model)
    q0[7:] = np.concatenate(([0.3, -0.2, 0.5], pin.Quaternion(pin.exp3(np.array(turn, dtype=float))).coeffs()))
    with pytest.raises(nga.SceneError, match=f"q0 does not fulfil the constraint '{kind.__name__} left-right'"):
        fits(scene, nga.Assembly(q0, np.zeros(12), {}, {}, 0))
    found = nga.assemble(scene, q0)
    fits(scene, found)
    a, b = (pin.XYZQUATToSE3(found.q[i : i + 7]) for i in (0, 7))
    relative = (a.inverse() * b).rotation
    if kind in (nga.Weld, nga.PrismaticJoint):
        np.testing.assert_allclose(relative, np.eye(3), atol=1e-10)
    assert relative[2, 2] == pytest.approx(1.0, abs=1e-10)


def test_robot_with_its_feet_on_hinges():
    """Solo12 as a closed loop: four feet that stay where they are, body and legs find their place."""
    pytest.importorskip("example_robot_data")
    scene, posture = _legged.example_robot("solo12")
    model, data = scene.model, scene.model.createData()
    pin.framesForwardKinematics(model, data, posture)
    feet = [f"{leg}_FOOT" for leg in ("FL", "FR", "HL", "HR")]
    places = {foot: data.oMf[model.getFrameId(foot)].translation.copy() for foot in feet}
    for foot, place in places.items():
        shifted = pin.SE3(np.eye(3), place + [0.02, -0.01, 0.015])
        scene.add_constraint(nga.PointJoint("world", foot, placement_a=shifted))
    v0 = np.random.default_rng(0).normal(size=model.nv)
    found = nga.assemble(scene, posture, v0)
    fits(scene, found)
    pin.framesForwardKinematics(model, data, found.q)
    for foot, place in places.items():
        reached = data.oMf[model.getFrameId(foot)].translation
        assert reached == pytest.approx(place + [0.02, -0.01, 0.015], abs=1e-9)
    assert found.moved["root_joint"] < 0.1
    # no energy is put in by the projection: it is the nearest velocity
    M = pin.crba(model, data, found.q)
    M = np.triu(M) + np.triu(M, 1).T
    assert found.v @ M @ (v0 - found.v) == pytest.approx(0.0, abs=1e-8)


def test_contacts_are_opened():
    scene, q0, _ = robots.load("rotating_ball")
    q0[1] = 0.03
    found = nga.assemble(scene, q0)
    assert found.q[1] == pytest.approx(0.1, abs=1e-12)
    assert found.moved == {"z": pytest.approx(0.07)}
    fits(scene, found)


def pendulum():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "upper")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.array([0, 0, -0.5]), np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, pin.SE3(np.eye(3), np.array([0, 0, -1.0])), pin.FrameType.OP_FRAME))
    return nga.Scene(model)


def at(x, y, z):
    return pin.SE3(np.eye(3), np.array([x, y, z], dtype=float))


def test_wishes_that_cannot_be_met():
    scene = pendulum()
    scene.add_constraint(nga.Distance("world", "tip", 0.5, placement_a=at(0, 0, -3.0), name="too far"))
    with pytest.raises(nga.SceneError, match=r"cannot assemble: 'too far' stays off by 1\.5; .*out of reach"):
        nga.assemble(scene, np.array([0.3]))
    # two wishes, each of which can be met alone
    scene = pendulum()
    scene.add_constraint(nga.JointTrajectory("upper", lambda t: 0.2, name="first"))
    scene.add_constraint(nga.JointTrajectory("upper", lambda t: 0.4, name="second"))
    with pytest.raises(nga.SceneError, match="cannot assemble: '(first|second)' stays off by 0.1; it contradicts"):
        nga.assemble(scene, np.array([0.0]))
    with pytest.raises(nga.SceneError, match="q0 does not fulfil the constraint 'second'"):
        nga.simulate(scene, np.array([0.2]), t_end=0.1, dt=0.01)
    # they agree now and will not in a moment
    scene = pendulum()
    scene.add_constraint(nga.JointTrajectory("upper", lambda t: (0.2, 0.0, 0.0), name="stay"))
    scene.add_constraint(nga.JointTrajectory("upper", lambda t: (0.2 + t, 1.0, 0.0), name="go"))
    with pytest.raises(nga.SceneError, match="no velocity fulfils '(stay|go)' together with the other constraints"):
        nga.assemble(scene, np.array([0.2]))
    # nothing may move
    scene = pendulum()
    scene.add_constraint(nga.PointJoint("world", "tip", placement_a=at(0.6, 0, -0.8), name="hook"))
    with pytest.raises(nga.SceneError, match="'hook'"):
        nga.assemble(scene, np.array([0.0]), hold=["upper"])
    with pytest.raises(nga.UnknownName, match="no joint named 'uper'; did you mean 'upper'"):
        nga.assemble(scene, np.array([0.0]), hold=["uper"])


def test_conflict_that_comes_later_stops_the_run():
    """Both hold at first; when they part, the step fails, and the run keeps what it has."""
    scene = pendulum()
    scene.add_constraint(nga.JointTrajectory("upper", lambda t: (0.2, 0.0, 0.0), name="stay"))

    def late(t):
        s = max(0.0, t - 0.055)
        return 0.2 + s**3, 3 * s**2, 6 * s

    scene.add_constraint(nga.JointTrajectory("upper", late, name="go"))
    run = nga.simulate(scene, np.array([0.2]), t_end=0.2, dt=0.01, on_failure="stop")
    assert not run.success
    assert 0.04 <= run.t[-1] <= 0.07
    assert np.isfinite(run.q).all()
    assert "; the constraint 'go' is off by" in run.message or "; the constraint 'stay' is off by" in run.message


def test_duplicated_rows_share_the_force():
    scene, alone = pendulum(), pendulum()
    for i in range(2):
        scene.add_constraint(nga.PointJoint("world", "tip", placement_a=at(0.6, 0, -0.8), name=f"hook {i}"))
    alone.add_constraint(nga.PointJoint("world", "tip", placement_a=at(0.6, 0, -0.8), name="hook"))
    found = nga.assemble(scene, np.array([-0.2]))
    fits(scene, found)
    runs = [nga.simulate(s, found.q, t_end=0.05, dt=0.01) for s in (scene, alone)]
    assert runs[0].audit().rank == (1, 4)
    totals = [sum(np.split(run.la_g, parts, axis=1)) for run, parts in zip(runs, (2, 1), strict=True)]
    np.testing.assert_allclose(totals[0], totals[1], atol=1e-8)
    np.testing.assert_allclose(*np.split(runs[0].la_g, 2, axis=1), atol=1e-8)


def test_a_name_can_be_used_once():
    scene = pendulum()
    scene.add_constraint(nga.PointJoint("world", "tip"))
    with pytest.raises(
        nga.SceneError, match="has a constraint 'PointJoint world-tip' already; give one of them a name"
    ):
        scene.add_constraint(nga.PointJoint("world", "tip"))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: nga.PointJoint("world", "tp"), "no frame named 'tp'; did you mean 'tip'"),
        (lambda: nga.Weld("upper", "tip"), "on one and the same body"),
        (lambda: nga.RevoluteJoint("world", "tip", axis=(0, 0, 0)), "expected a direction, not zero"),
        (lambda: nga.Distance("world", "tip", -1.0), "length = -1.0: expected a positive number"),
        (lambda: nga.JointTrajectory("uper", np.sin), "no joint named 'uper'"),
        (lambda: nga.JointTrajectory("upper", 0.3), "angle = 0.3: expected a function of time"),  # type: ignore[arg-type]
        (lambda: nga.FrameTrajectory("world", lambda t: pin.SE3.Identity()), "fixed to the world"),
        (lambda: nga.PositionConstraint(lambda t, q: np.ones((2, 2))), "must be finite with one dimension"),
        (lambda: nga.PositionConstraint(0.3), "function = 0.3: expected a function"),  # type: ignore[arg-type]
        (lambda: nga.JointCoupling("upper", "upper", (0, 1)), "a joint cannot follow itself"),
        (lambda: nga.JointCoupling("upper", "uper", (0, 1)), "no joint named 'uper'"),
        (lambda: nga.JointCoupling("upper", "lower", (0, np.nan)), "coefficients.*(not finite|one to five)"),
    ],
)
def test_bad_constraint_is_named(make, message):
    with pytest.raises(nga.SceneError, match=message):
        pendulum().add_constraint(make())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: nga.JointTrajectory("upper", lambda t: np.nan), "JointTrajectory upper: got"),
        (lambda: nga.JointTrajectory("upper", lambda t: (0.0, 0.0)), "JointTrajectory upper: the function"),
        (lambda: nga.PositionConstraint(lambda t, q: np.nan, "own"), "own: got"),
        (lambda: nga.FrameTrajectory("tip", lambda t: np.nan), "FrameTrajectory tip: the function"),
    ],
)
def test_bad_function_is_named(make, message):
    scene = pendulum()
    with pytest.raises(nga.SceneError, match=message):
        scene.add_constraint(make())
        nga.simulate(scene, np.zeros(1), t_end=0.1, dt=0.01)


def test_joints_out_of_order_are_an_error():
    """Pinocchio's algorithms rely on branches in a row and do not look."""
    model = pin.Model()
    for i, name in enumerate(("a", "b")):
        joint = model.addJoint(0, pin.JointModelRY(), at(i, 0, 0), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJoint(1, pin.JointModelRY(), at(0, 0, 1), "on a")
    with pytest.raises(nga.SceneError, match="branch by branch: those behind 'a'"):
        nga.Scene(model)


def test_closed_contact_with_a_constraint_starts():
    """Assembly and the start of a run look at both together."""
    scene = balls(1, pin.JointModelFreeFlyer)
    scene.add_constraint(nga.Distance("world", "ball_0", 0.5))
    rough = pin.neutral(scene.model)
    rough[:3] = (0.3, 0.0, 0.05)
    found = nga.assemble(scene, rough)
    fits(scene, found)
    assert np.linalg.norm(found.q[:3]) == pytest.approx(0.5, abs=1e-10)
    assert found.q[2] >= 0.1 - 1e-12
