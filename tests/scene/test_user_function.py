"""Functions of the user's own that give something useless: named at once, and a run under way keeps what it has."""

import numpy as np
import pinocchio as pin
import pytest
from joint_scenes import slider

import ngalpha_pin as nga


def scene_with(thing):
    scene = slider()
    (scene.add_force if hasattr(thing, "bind") else scene.add_constraint)(thing)
    return scene


def until(t_bad, good, bad):
    """A function of t, and of anything else, that goes wrong."""

    def function(t, *others):
        if t > t_bad:
            if isinstance(bad, Exception):
                raise bad
            return bad
        return good(t, *others)

    return function


def pose(t):
    return pin.SE3(np.eye(3), np.array([0.1 * t * t, 0.0, 0.0]))


THINGS = {
    "Control function": (lambda f: nga.Control(f), lambda t, q, v: np.ones(1)),
    "Wrench slide, force": (lambda f: nga.Wrench("slide", f), lambda t: (1.0, 0.0, 0.0)),
    "Gravity": (lambda f: nga.Gravity(f), lambda t: (1.0, 0.0, 0.0)),
    "JointTrajectory slide": (lambda f: nga.JointTrajectory("slide", f), lambda t: 0.1 * t * t),
    "FrameTrajectory slide": (lambda f: nga.FrameTrajectory("slide", f), pose),
    "PositionConstraint function": (lambda f: nga.PositionConstraint(f), lambda t, q: q[0] - 0.1 * t * t),
    "VelocityConstraint function": (lambda f: nga.VelocityConstraint(f), lambda t, q, v: v[0] - 0.2 * t),
}


@pytest.mark.parametrize("bad", [np.nan, np.ones((2, 5)), "three", None, KeyError("spline")], ids=repr)
@pytest.mark.parametrize("name", THINGS)
def test_run_under_way_keeps_what_it_has(name, bad):
    make, good = THINGS[name]
    scene = scene_with(make(until(0.055, good, bad)))
    with pytest.raises(nga.SceneError, match=f"(?s){name}.* at t = 0.0") as caught:
        nga.simulate(scene, np.zeros(1), t_end=0.1, dt=1e-2)
    kept = caught.value.trajectory
    stopped = nga.simulate(scene, np.zeros(1), t_end=0.1, dt=1e-2, on_failure="stop")
    for run in (kept, stopped):
        # the differences of own constraints look ahead along the motion
        assert run.t[-1] == pytest.approx(0.04 if "Constraint" in name else 0.05)
        assert not run.success
        assert name in run.message
    assert (kept.q == stopped.q).all()
    if isinstance(bad, KeyError):
        assert caught.value.__cause__ is bad
    # and it goes on from there once the function is mended
    mended = scene_with(make(until(np.inf, good, bad)))  # by the same name
    going_on = nga.simulate(mended, state=stopped.final_state, t_end=0.1)
    whole = nga.simulate(scene_with(make(good)), np.zeros(1), t_end=0.1, dt=1e-2)
    assert going_on.q[-1] == pytest.approx(whole.q[-1], abs=1e-15)


@pytest.mark.parametrize("bad", [np.ones((2, 5)), "three", KeyError("spline")], ids=repr)
@pytest.mark.parametrize("name", THINGS)
def test_named_before_anything_is_computed(name, bad):
    make, good = THINGS[name]
    with pytest.raises(nga.SceneError, match=name):
        scene = scene_with(make(until(-1.0, good, bad)))
        nga.simulate(scene, np.zeros(1), t_end=0.1, dt=1e-2)


def test_success_has_no_trajectory_in_its_errors():
    assert nga.SceneError("any").trajectory is None


def test_own_constraint_may_be_singular_where_the_run_is_not():
    """At the neutral configuration q = 0 the function is 0 / 0."""

    def angle(t, q):
        return q[0] / abs(q[0]) - 1.0 + q[0] - 0.5

    scene = slider()
    scene.add_constraint(nga.PositionConstraint(angle))
    run = nga.simulate(scene, np.array([0.5]), t_end=0.05, dt=1e-2)
    assert run.q[-1, 0] == pytest.approx(0.5)
    with pytest.raises(nga.SceneError, match="PositionConstraint angle"), np.errstate(invalid="ignore"):
        nga.simulate(scene, np.array([0.0]), t_end=0.05, dt=1e-2)


def test_control_may_be_singular_where_the_run_is_not():
    scene = slider()
    scene.add_force(nga.Control(lambda t, q, v: -q / np.linalg.norm(q) ** 3, derivatives=True))
    for accuracy in ({"dt": 1e-2}, {"rtol": 1e-6}):
        assert nga.simulate(scene, np.array([2.0]), t_end=0.02, **accuracy).success
    with pytest.raises(nga.SceneError, match="Control"), np.errstate(invalid="ignore"):
        nga.simulate(scene, np.zeros(1), t_end=0.02, dt=1e-2)


def test_shape_of_an_own_constraint_may_not_change():
    scene = slider()
    scene.add_constraint(nga.PositionConstraint(lambda t, q: q[0] * np.ones(1 if t < 0.02 else 2), name="growing"))
    with pytest.raises(nga.SceneError, match=r"growing: .*finite with shape \(1,\)"):
        nga.simulate(scene, np.zeros(1), t_end=0.1, dt=1e-2)


def test_own_constraint_that_no_motion_changes():
    scene = slider()
    scene.add_constraint(nga.PositionConstraint(lambda t, q: 0.0, name="nothing"))
    with pytest.raises(nga.SceneError, match="no motion at q0 changes the constraint 'nothing'"):
        nga.simulate(scene, np.zeros(1), t_end=0.1, dt=1e-2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: nga.JointTrajectory("slide", 0.3), "angle = .*: expected a function of time"),  # type: ignore[arg-type]
        (lambda: nga.JointTrajectory("slid", np.sin), "did you mean 'slide'"),
        (lambda: nga.FrameTrajectory("slid", pose), "did you mean 'slide'"),
        (lambda: nga.FrameTrajectory("slide", pose(0)), "pose = .*: expected a function of time"),
        (lambda: nga.KnifeEdge("slid", (0, 1, 0)), "did you mean 'slide'"),
        (lambda: nga.PositionConstraint(3), "function = 3: expected a function"),  # type: ignore[arg-type]
        (lambda: nga.VelocityConstraint(np.sin, step=0.0), "step = 0.0: expected a positive number"),
        (lambda: nga.Spring("world", "slid", 1.0), "did you mean 'slide'"),
        (lambda: nga.JointSpring("slid", 1.0), "did you mean 'slide'"),
        (lambda: nga.Control(3.0), "law = .*: expected a function"),  # type: ignore[arg-type]
    ],
)
def test_bad_declaration_is_named(make, message):
    with pytest.raises(nga.SceneError, match=message):
        scene_with(make())


def test_conflicting_motions_are_refused_and_duplicated_ones_are_not():
    scene = slider()
    scene.add_constraint(nga.JointTrajectory("slide", lambda t: 0.1 * t * t))
    with pytest.raises(nga.SceneError, match="has a constraint 'JointTrajectory slide' already"):
        scene.add_constraint(nga.JointTrajectory("slide", lambda t: 0.1 * t * t))
    scene.add_constraint(nga.JointTrajectory("slide", lambda t: 0.1 * t * t, name="the same"))
    run = nga.simulate(scene, np.zeros(1), t_end=0.05, dt=1e-2)
    assert run.audit().rank == (1, 2)
    assert run.q[-1, 0] == pytest.approx(0.1 * 0.05**2)
    assert run.la_g[-1].sum() == pytest.approx(0.2)
    scene.add_constraint(nga.JointTrajectory("slide", lambda t: 1.0 + t, name="another"))
    with pytest.raises(nga.SceneError, match="another"):
        nga.simulate(scene, np.zeros(1), t_end=0.05, dt=1e-2)
    with pytest.raises(nga.SceneError, match="contradicts the other"):
        nga.assemble(scene, np.zeros(1))


def test_motions_that_part_later_do_not_converge():
    scene = slider()
    scene.add_constraint(nga.JointTrajectory("slide", lambda t: (0.0, 0.0, 0.0)))
    scene.add_constraint(nga.JointTrajectory("slide", lambda t: (max(0.0, t - 0.03),) + 2 * (0.0,), name="parting"))
    with pytest.raises(nga.NotConverged) as caught:
        nga.simulate(scene, np.zeros(1), t_end=0.1, dt=1e-2)
    assert caught.value.trajectory.t[-1] == pytest.approx(0.03)
