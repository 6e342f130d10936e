"""What a run is asked for is checked before it, and whatever ends it leaves what was computed."""

import threading
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots


@pytest.fixture(scope="module")
def ball():
    return robots.load("rotating_ball")


@pytest.fixture(scope="module")
def state(ball):
    return nga.simulate(*ball, t_end=0.5, dt=2e-3).final_state


WRONG = {
    "scene": ({"scene": "ball"}, "scene = 'ball', a str: expected a Scene"),
    "method": ({"method": "newton"}, "method = 'newton', a str: expected a method"),
    "class": ({"method": nga.MoreauJean}, "expected a method such as"),
    "dt": ({"dt": "1e-3"}, "dt = '1e-3', a str: expected a positive number of seconds"),
    "long dt": ({"dt": 0.2}, "dt = 0.2 is longer than the run"),
    "tiny dt": ({"dt": 1e-300}, "lost in the rounding"),
    "t_end": ({"t_end": None}, "t_end = None: expected a finite number"),
    "progress": ({"progress": 1}, "progress = 1: expected True or False"),
    "on_failure": ({"on_failure": None}, "on_failure None is unknown; choose one of raise, stop"),
    "v0 alone": ({"q0": None}, "give either q0"),
    "every": ({"save_to": "folder", "every": 0}, "every = 0: expected an integer of at least 1"),
    "save_to": ({"save_to": 3}, "save_to = 3: expected a path"),
    "save_to with rtol": ({"dt": None, "rtol": 1e-3, "save_to": "folder"}, "save_to belongs to a run with dt"),
    "rtol": ({"dt": None, "rtol": "small"}, "rtol = 'small', a str: expected a finite number"),
    "max_step": ({"dt": None, "rtol": 1e-3, "max_step": np.nan}, "max_step = nan: expected a positive number"),
    "t_eval": ({"dt": None, "rtol": 1e-3, "t_eval": "all"}, "t_eval = 'all'.*: expected finite numbers"),
    "events": ({"dt": None, "rtol": 1e-3, "events": 3}, "events = 3: expected a function"),
    "event": ({"dt": None, "rtol": 1e-3, "events": [3]}, "event = 3: expected a function"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_inputs_are_named(case, ball, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    changed, words = WRONG[case]
    scene, q0, v0 = ball
    arguments = {"scene": scene, "q0": q0, "v0": v0, "t_end": 0.1, "dt": 1e-3, **changed}
    with pytest.raises(nga.SceneError, match=words):
        nga.simulate(**arguments)


def test_events_that_give_no_number_are_named(ball):
    def height(t, q, v):
        return np.nan if t > 0.2 else 1.0

    with pytest.raises(nga.SceneError, match=r"event height at t = .* = nan: expected a finite number") as caught:
        nga.simulate(*ball, t_end=1.0, rtol=1e-6, events=height)
    assert caught.value.trajectory.t[-1] < 0.5


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"contacts": np.array([7])}, "contacts, not so many"),
        ({"la_N": np.zeros(3)}, r"state\.la_N has shape"),
        ({"a": np.full(3, np.nan)}, r"state\.a\[0\] = nan"),
        ({"q": np.zeros(2)}, "another scene"),
        ({"t": np.nan}, r"state\.t = nan"),
    ],
)
def test_states_that_do_not_fit(ball, state, changes, words):
    with pytest.raises(nga.SceneError, match=words):
        nga.simulate(ball[0], state=replace(state, **changes), t_end=1.0, dt=1e-3)
    with pytest.raises(nga.SceneError, match=words):
        nga.Simulator(ball[0], 1e-3).step(replace(state, **changes))


class Meeting:
    """A method whose step waits until it is told to go on."""

    def __init__(self):
        self.inside, self.go_on = threading.Event(), threading.Event()

    def step(self, system, state, dt):
        self.inside.set()
        assert self.go_on.wait(20.0)
        return nga.GeneralizedAlpha().step(system, state, dt)

    def not_converged(self, system, state, dt, result):
        raise AssertionError


def test_simulator_in_two_threads_says_so(ball):
    scene, q0, v0 = ball
    meeting = Meeting()
    simulator = nga.Simulator(scene, 1e-3, meeting)
    state, ends = simulator.initial_state(q0, v0), []
    first = threading.Thread(target=lambda: ends.append(simulator.step(state)))
    first.start()
    assert meeting.inside.wait(20.0)
    for call in (lambda: simulator.step(state), lambda: simulator.initial_state(q0, v0)):
        with pytest.raises(nga.NgalphaError, match="in another thread.*one Simulator for each thread"):
            call()
    meeting.go_on.set()
    first.join()
    # and the step that was disturbed is right, as are those after it
    assert np.array_equal(ends[0].q, nga.Simulator(scene, 1e-3).step(state).q)
    assert simulator.step(ends[0]).t == pytest.approx(2e-3)


class Failing:
    """A method that fails in its third step."""

    def __init__(self, error):
        self.error, self.count = error, 0

    def step(self, system, state, dt):
        self.count += 1
        if self.count == 3:
            raise self.error
        return nga.GeneralizedAlpha().step(system, state, dt)

    def not_converged(self, system, state, dt, result):
        raise AssertionError


def test_whatever_fails_in_a_step_has_its_time_and_the_run_so_far(ball):
    with pytest.raises(nga.NotConverged, match=r"from t = 0\.002 s .*cannot be computed: LinAlgError") as caught:
        nga.simulate(*ball, t_end=0.1, dt=1e-3, method=Failing(np.linalg.LinAlgError("singular")))
    assert len(caught.value.trajectory.t) == 3
    assert isinstance(caught.value.__cause__, np.linalg.LinAlgError)
    run = nga.simulate(*ball, t_end=0.1, dt=1e-3, method=Failing(IndexError("7")), on_failure="stop")
    assert not run.success
    assert "IndexError" in run.message


@pytest.mark.parametrize("accuracy", [{"dt": 1e-3}, {"rtol": 1e-6}])
def test_interrupted_run_keeps_what_there_is(accuracy):
    scene, q0, v0 = robots.load("arm")

    def interrupts(t, q, v):
        if t > 0.3 and (v != v0).any():  # not where the law is looked through for jumps, before the run
            raise KeyboardInterrupt
        return np.zeros(7)

    scene.add_force(nga.Control(interrupts))
    with pytest.raises(KeyboardInterrupt) as caught:
        nga.simulate(scene, q0, v0, t_end=1.0, on_failure="stop", **accuracy)
    assert isinstance(caught.value, nga.Interrupted)
    run = caught.value.trajectory
    assert 0.0 < run.t[-1] <= 0.3 + 1e-9
    assert len(run.t) == len(run.q) == len(run.n_iter) == len(run.solver_path)
    assert not run.success


def turning(*constraints):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    for constraint in constraints:
        scene.add_constraint(constraint)
    return scene


@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-6}])
def test_drives_that_contradict_each_other_later_are_no_success(accuracy):
    """Both begin with the same angle, velocity and acceleration."""
    drives = (
        nga.JointTrajectory("joint", lambda t: (t, 1.0, 0.0), name="one"),
        nga.JointTrajectory("joint", lambda t: (t + 5 * t**3, 1 + 15 * t**2, 30 * t), name="two"),
    )
    with pytest.raises(nga.NotConverged, match="'one'|'two'"):
        nga.simulate(turning(*drives), np.zeros(1), np.ones(1), t_end=1.0, **accuracy)
    one = nga.simulate(turning(drives[1]), np.zeros(1), np.ones(1), t_end=1.0, **accuracy)
    assert one.q[-1, 0] == pytest.approx(6.0, rel=1e-9)


def test_spring_whose_ends_coincide_has_no_direction():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    for rest in (0.1, 0.0):
        scene = nga.Scene(model)
        scene.add_force(nga.Spring("free", "world", 100.0, rest))
        if rest:
            with pytest.raises(nga.SceneError, match="Spring free-world: its ends coincide at q0"):
                nga.simulate(scene, pin.neutral(model), t_end=0.1, dt=1e-3)
        else:  # a spring without a rest length has no force there, and vibrates with omega = 10 rad/s
            run = nga.simulate(scene, pin.neutral(model), t_end=0.1, dt=1e-3)
            assert run.q[-1, 2] == pytest.approx(-0.0981 * (1 - np.cos(1.0)), abs=1e-5)


def test_body_does_not_roll_on_itself():
    scene, _, _ = robots.load("rotating_ball")
    with pytest.raises(nga.SceneError, match="on one and the same body"):
        scene.add_constraint(nga.RollingSphere("ball_0", "ball_0"))


class Hopeless(Failing):
    """A method whose steps fail from the first one on."""

    def step(self, system, state, dt):
        raise self.error


def test_reason_that_a_user_can_act_on_is_said():
    """Turning by 2 rad in a step, and bodies of 0.1 m that are 1000 km away from the origin."""
    scene, q0, v0 = robots.load("tippe_top")
    far = q0.copy()
    far[0] = 1e6
    hopeless = nga.GeneralizedAlpha(solver="newton", max_iter=1)
    with pytest.raises(nga.NotConverged, match=r"turns by 2 rad in a step, dt = 2\.5e-03 s would resolve it"):
        nga.simulate(scene, q0, 0 * v0 + [0, 0, 0, 0, 0, 200.0], t_end=0.1, dt=0.01, method=Hopeless(ValueError()))
    with pytest.raises(nga.NotConverged, match=r"1e\+06 m away from the origin .*rounded to 2e-10 m"):
        nga.simulate(scene, far, v0, t_end=1.0, dt=0.01, method=hopeless)
