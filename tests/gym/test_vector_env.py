"""Environments on threads: each has the bits that it has alone, and is reset by the step after its end."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots

gymnasium = pytest.importorskip("gymnasium")

from ngalpha_pin.gym import BallInCup, Gripper, Quadruped, SceneEnv  # noqa: E402
from ngalpha_pin.gym.vector_env import SceneVectorEnv  # noqa: E402


@pytest.mark.parametrize("kind", [Quadruped, Gripper, BallInCup])
def test_each_is_what_it_is_alone(kind):
    envs = gymnasium.make_vec(
        f"ngalpha_pin/{kind.__name__}-v0", num_envs=2, vectorization_mode="vector_entry_point", hold=3
    )
    assert isinstance(envs, SceneVectorEnv)
    envs.action_space.seed(0)
    observed, _ = envs.reset(seed=5)
    assert envs.observation_space.contains(observed)
    actions = [envs.action_space.sample() for _ in range(2)]
    found = [observed] + [envs.step(action)[0] for action in actions]
    for i in range(2):
        env = kind(hold=3)
        alone = [env.reset(seed=5 + i)[0]] + [env.step(action[i])[0] for action in actions]
        assert np.array_equal([all_of[i] for all_of in found], alone)
    envs.close()


def test_the_ends_of_episodes():
    class Ball(SceneEnv):
        def reward(self, before, after, action):
            return 1.0

        def ended(self, state):
            return bool(state.q[0] > 0.003)

    def make():
        return Ball(*robots.load("rotating_ball"), actuated=[0], effort=2.0)

    envs = SceneVectorEnv(make, 2, max_episode_steps=4, threads=2)
    envs.reset(seed=[1, 2])
    pushes = np.array([[1.0], [0.0]])
    steps = [envs.step(pushes) for _ in range(6)]
    ended, truncated, rewards = (np.array([step[i] for step in steps]) for i in (2, 3, 1))
    alone = make()
    alone.reset()
    first = next(i for i in range(9) if alone.step(np.ones(1))[2])
    assert ended[first, 0] and not ended[:first].any() and not ended[:, 1].any()
    assert rewards[first + 1, 0] == 0.0  # the step that resets it
    assert truncated[:, 1].tolist() == [False, False, False, True, False, False]
    assert rewards[:, 1].tolist() == [1, 1, 1, 1, 0, 1]
    envs.close()


def test_wrong_seeds_and_numbers_are_refused():
    envs = SceneVectorEnv(BallInCup, 2)
    with pytest.raises(nga.SceneError, match="seed"):
        envs.reset(seed=[1])
    with pytest.raises(nga.SceneError, match="num_envs"):
        SceneVectorEnv(BallInCup, 0)
    envs.close()
