"""Several environments of one kind that step on threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ngalpha_pin.common import checks

from .ball_in_cup import BallInCup
from .gripper import Gripper
from .quadruped import Quadruped
from .scene_env import SceneEnv


class SceneVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Environments that step on threads, each with the bits that it has alone.

    One that has ended is reset by the next step, whose action it does not see (`AutoresetMode.NEXT_STEP`).

    Args:
        make: makes one of them.
        num_envs: how many.
        max_episode_steps: an episode is truncated after so many actions; None is never.
        threads: how many; None is one for each core.
    """

    def __init__(
        self,
        make: Callable[[], SceneEnv],
        num_envs: int,
        max_episode_steps: int | None = None,
        threads: int | None = None,
    ):
        self.num_envs = checks.integer("num_envs", num_envs, 1)
        self.envs = [make() for _ in range(self.num_envs)]
        self.metadata = {**self.envs[0].metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.render_mode = self.envs[0].render_mode
        self.single_observation_space = self.envs[0].observation_space
        self.single_action_space = self.envs[0].action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._most = max_episode_steps
        n = checks.cores() if threads is None else checks.integer("threads", threads, 1)
        self._threads = ThreadPoolExecutor(min(n, self.num_envs), "ngalpha-pin env")
        self._over, self._taken = np.zeros(self.num_envs, dtype=bool), np.zeros(self.num_envs, dtype=int)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode in each; a number seeds them with itself and those that follow it."""
        if seed is None or isinstance(seed, (int, np.integer)):
            seeds: list[int | None] = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise checks.fail("seed", seed, f"a number, or {self.num_envs} of them")
        found = [env.reset(seed=own, options=options) for env, own in zip(self.envs, seeds, strict=True)]
        self._over[:], self._taken[:] = False, 0
        infos: dict[str, Any] = {}
        for i, (_, info) in enumerate(found):
            infos = self._add_info(infos, info, i)
        return np.array([observation for observation, _ in found]), infos

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """An action in each, side by side."""
        found = list(self._threads.map(self._one, range(self.num_envs), np.asarray(actions)))
        observations, rewards, ended, truncated, every = (list(part) for part in zip(*found, strict=True))
        infos: dict[str, Any] = {}
        for i, info in enumerate(every):
            infos = self._add_info(infos, info, i)
        self._over = np.logical_or(ended, truncated)
        return np.array(observations), np.array(rewards), np.array(ended), np.array(truncated), infos

    def _one(self, i: int, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        if self._over[i]:
            self._taken[i] = 0
            observation, info = self.envs[i].reset()
            return observation, 0.0, False, False, info
        self._taken[i] += 1
        observation, reward, ended, truncated, info = self.envs[i].step(action)
        return observation, reward, ended, truncated or self._taken[i] == self._most, info

    def render(self) -> tuple[Any, ...]:
        """A picture, or some, of each."""
        return tuple(env.render() for env in self.envs)

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads."""
        self._threads.shutdown()


def _vector(kind: Callable[..., SceneEnv]) -> Callable[..., SceneVectorEnv]:
    def make(num_envs: int, max_episode_steps: int | None = None, threads: int | None = None, **options: Any) -> Any:
        return SceneVectorEnv(lambda: kind(**options), num_envs, max_episode_steps, threads)

    return make


QuadrupedVector, GripperVector, BallInCupVector = map(_vector, (Quadruped, Gripper, BallInCup))
