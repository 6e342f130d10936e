"""Environments of gymnasium: their contract, the same bits for the same seed, what ends an episode."""

import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.common.optional import MissingPackageError
from ngalpha_pin.viz.browser import find_browser

gymnasium = pytest.importorskip("gymnasium")

import ngalpha_pin.gym as nga_gym  # noqa: E402
from ngalpha_pin.gym.scene_env import SceneEnv  # noqa: E402

IDS = [f"ngalpha_pin/{name}-v0" for name in ("Quadruped", "Gripper", "BallInCup")]


def ball(height=0.101, **options):
    class Ball(SceneEnv):
        def reward(self, before, after, action):
            return after.q[0] - before.q[0]

        def ended(self, state):
            return bool(state.q[0] > 0.01)

    return Ball(*robots.load("rotating_ball", height=height), actuated=[0], effort=2.0, **options)


@pytest.mark.parametrize("name", IDS)
def test_checks_of_gymnasium_pass(name):
    from gymnasium.utils.env_checker import check_env

    env = gymnasium.make(name, hold=2).unwrapped
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        check_env(env, skip_render_check=True)
    # velocities have no bound
    assert [str(x.message) for x in said if "infinity" not in str(x.message)] == []


@pytest.mark.parametrize("name", IDS)
def test_seeds_give_the_same_bits(name):
    env, other, starts = gymnasium.make(name, hold=2), gymnasium.make(name, hold=2), []
    for seed in range(4):
        observed = []
        for one in (env, other):
            one.action_space.seed(seed)
            first, _ = one.reset(seed=seed)
            rest = [one.step(one.action_space.sample()) for _ in range(2)]
            observed.append(np.array([first, *(step[0] for step in rest)]))
        assert np.array_equal(*observed)
        starts.append(observed[0][0].tolist())
    assert len({tuple(start) for start in starts}) == 4


def test_importing_the_module_by_name_registers():
    env = gymnasium.make("ngalpha_pin.gym:ngalpha_pin/BallInCup-v0", hold=5)
    assert env.unwrapped.hold == 5 and env.spec.max_episode_steps == 400
    assert env.metadata["render_fps"] == 100


def test_what_start_draws_may_be_observed():
    class Reach(SceneEnv):
        def start(self, random):
            self.goal = random.uniform(1.0, 2.0)
            return self._q0, self._v0

        def observe(self, state):
            return np.array([self.goal - state.q[0]])

        def reward(self, before, after, action):
            return -abs(self.goal - after.q[0])

    env = Reach(*robots.load("rotating_ball", height=0.101), actuated=[0], effort=2.0)
    assert env.observation_space.shape == (1,)
    assert env.reset(seed=0)[0] == env.goal - env.state.q[0]


def test_an_action_is_held_for_its_steps():
    env = ball(hold=4, dt=1e-3)
    env.reset()
    simulator = nga.Simulator(env.scene, 1e-3)
    state = simulator.initial_state(env.state.q, env.state.v)
    for action in (0.5, -1.0):
        observed, reward, *_ = env.step(np.array([action], dtype=np.float32))
        before = state.q[0]
        for _ in range(4):
            state = simulator.step(state, np.array([2.0 * action, 0.0, 0.0]))
        assert np.array_equal(observed, np.concatenate((state.q, state.v)))
        assert reward == state.q[0] - before


def test_ends_are_told():
    env = ball(height=0.5)
    env.reset()
    steps = [env.step(np.ones(1)) for _ in range(6)]
    assert [step[2] for step in steps] == [bool(step[0][0] > 0.01) for step in steps]
    assert steps[-1][2]


class Fails(nga.GeneralizedAlpha):
    """A method that finds nothing from 0.01 s on."""

    def step(self, system, state, dt):
        return replace(super().step(system, state, dt), converged=state.t < 0.0099)


def test_a_step_without_solution_truncates_with_the_reason():
    env = ball(method=Fails(), dt=2e-3)
    env.reset()
    observed, _, ended, truncated, info = env.step(np.ones(1))
    assert truncated and not ended
    assert info["not_converged"].startswith("the step from t = 0.01 s of dt = 0.002 s did not converge")
    assert env.state.t == pytest.approx(0.01) and np.array_equal(observed[:4], env.state.q)


def test_a_gripper_that_squeezes_lifts_the_box():
    env = nga_gym.Gripper()
    env.reset(seed=0)
    for i in range(20):
        _, reward, ended, truncated, info = env.step(np.array([-0.2 if i < 12 else 0.8, 1.0]))
        assert not (ended or truncated), info
    assert reward > 0.1
    assert env.state.q[5] > 0.04


def test_a_quadruped_that_is_left_alone_stands():
    env = nga_gym.Quadruped()
    env.reset(seed=0)
    for _ in range(25):
        _, reward, ended, truncated, info = env.step(np.zeros(12))
        assert not (ended or truncated), info
    assert reward > 0.9
    assert nga_gym.Quadruped(speed=0.5).reward(env.state, env.state, np.zeros(12)) < reward


def test_the_string_of_the_cup_is_never_longer_and_a_ball_in_it_is_worth_something():
    env = nga_gym.BallInCup()
    env.reset(seed=1)
    env.action_space.seed(1)
    for _ in range(40):
        env.step(env.action_space.sample())
        assert np.linalg.norm(env.state.q[2:] - env.state.q[:2]) <= 0.3 + 1e-10
    state = env.simulator.initial_state(np.array([0.0, 0.0, 0.0, 0.04]))
    assert env.reward(state, state, np.zeros(2)) == 1.0


def test_an_episode_is_a_trajectory():
    env = ball(render_mode="rgb_array")
    env.reset()
    for action in (1.0, -0.5, 1.0):
        env.step(np.array([action]))
    run = env.trajectory
    assert len(run.t) == 31 and run.t[-1] == pytest.approx(0.06)
    assert np.array_equal(run.q[-1], env.state.q)
    assert run.audit().ok, run.audit()
    assert np.array_equal(run.tau_step[1:, 0], np.repeat([2.0, -1.0, 2.0], 10))
    plain = ball()
    plain.reset()
    with pytest.raises(nga.SceneError, match="recorded with a render_mode"):
        _ = plain.trajectory
    assert plain.render() is None


def test_pictures_of_an_episode():
    try:
        find_browser()
    except MissingPackageError as error:
        pytest.skip(str(error))
    env = ball(render_mode="rgb_array_list")
    env.reset()
    for _ in range(2):
        env.step(np.ones(1))
    found = env.render()
    assert len(found) == 3 and found[0].shape == (480, 640, 3) and found[0].dtype == np.uint8
    assert not np.array_equal(found[0], found[2])
    assert env.render() == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"hold": 0}, "hold"),
        ({"actuated": [7]}, "actuated"),
        ({"actuated": []}, "actuated"),
        ({"effort": -1.0}, "effort"),
        ({"render_mode": "human"}, "render_mode"),
        ({"dt": 0.0}, "dt"),
        ({"q0": np.zeros(2)}, "q0"),
    ],
)
def test_bad_input(options, message):
    scene, q0, v0 = robots.load("rotating_ball")
    with pytest.raises(nga.SceneError, match=message):
        SceneEnv(scene, **({"q0": q0, "v0": v0, "actuated": [0], "effort": 1.0} | options))
    env = ball()
    env.reset()
    with pytest.raises(nga.SceneError, match="action"):
        env.step(np.array([np.nan]))


def test_without_gymnasium_the_error_says_what_to_install(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("ngalpha_pin.gym")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'ngalpha-pin\[gym\]'"):
        __import__("ngalpha_pin.gym")
