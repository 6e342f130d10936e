"""An environment of gymnasium on a scene: actions become forces, states observations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from ngalpha_pin.common import checks
from ngalpha_pin.errors import NotConverged, SceneError
from ngalpha_pin.integrators.method import Method
from ngalpha_pin.results.recorder import Recorder
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.simulation.simulate import Simulator
from ngalpha_pin.system.state import State
from ngalpha_pin.viz import pictures

SIZE = 640, 480  # of pictures [pixels]


class SceneEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """A scene to act on; subclass it and say what is observed, rewarded and given up.

    An action is cut off to [-1, 1] and held for `hold` steps of length dt. A step without a solution truncates the
    episode at the last state, with the reason in `info["not_converged"]`. An episode is a function of its seed and its
    actions, to the bit. `SceneEnv.__init__` calls `start` and `observe` once, for the shape of an observation; set what
    they need before it.

    Args:
        scene: what is simulated; it is not changed.
        q0: configuration at the start, shape (nq,); see `start`.
        v0: velocity at the start, shape (nv,); None is rest.
        actuated: velocity coordinates that actions push, shape (k,).
        effort: force of an action of 1 [N or N m], a number or shape (k,).
        dt: length of a step [s].
        hold: steps of one action.
        method: of the steps.
        render_mode: "rgb_array" for a picture of now, "rgb_array_list" for those since the last call; both need
            Chromium. Episodes are recorded where it is not None, see `trajectory`.

    Attributes:
        state: the state now.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "rgb_array_list"]}  # noqa: RUF012

    def __init__(
        self,
        scene: Scene,
        q0: np.ndarray,
        v0: np.ndarray | None = None,
        *,
        actuated: Any,
        effort: Any,
        dt: float = 2e-3,
        hold: int = 10,
        method: Method | None = None,
        render_mode: str | None = None,
    ):
        self.simulator, self.hold = Simulator(scene, dt, method), checks.integer("hold", hold, 1)
        self.scene, self.dt = scene, self.simulator.dt
        if render_mode is not None:
            checks.choice("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": round(1.0 / (self.dt * self.hold))}
        self._q0, nv = checks.vector("q0", q0, scene.model.nq), scene.model.nv
        self._v0 = np.zeros(nv) if v0 is None else checks.vector("v0", v0, nv)
        self.actuated = np.asarray(actuated, dtype=int)
        if self.actuated.ndim != 1 or not len(self.actuated) or not set(self.actuated.tolist()) <= set(range(nv)):
            raise checks.fail("actuated", actuated, f"numbers of velocity coordinates, 0 to {nv - 1}")
        self.effort = np.broadcast_to(checks.number_or_array("effort", effort, 0.0), self.actuated.shape)
        self.state: State = self.simulator.initial_state(*self.start(np.random.default_rng(0)))
        self._recorder: Recorder | None = None
        self._shown: list[float] = []
        self.action_space: spaces.Box = spaces.Box(-1.0, 1.0, self.actuated.shape, np.float32)
        observed = np.asarray(self.observe(self.state))
        self.observation_space = spaces.Box(-np.inf, np.inf, observed.shape, np.float64)

    # what a subclass says

    def start(self, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Q and v at the start of an episode; by default those of the environment."""
        return self._q0, self._v0

    def observe(self, state: State) -> np.ndarray:
        """What is observed of a state; by default q and v, shape (nq + nv,)."""
        return np.concatenate((state.q, state.v))

    def forces(self, action: np.ndarray, state: State) -> np.ndarray:
        """The generalized force of an action in [-1, 1], shape (nv,) [N or N m]; by default in parts of the effort."""
        tau = np.zeros(self.scene.model.nv)
        tau[self.actuated] = self.effort * action
        return tau

    def reward(self, before: State, after: State, action: np.ndarray) -> float:
        """What an action was good for."""
        raise NotImplementedError("SceneEnv: subclass it and define reward(before, after, action)")

    def ended(self, state: State) -> bool:
        """The episode is over, for good or ill; by default never."""
        return False

    # what gymnasium calls

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; see `gymnasium.Env.reset`."""
        super().reset(seed=seed)
        self.state = self.simulator.initial_state(*self.start(self.np_random))
        if self.render_mode is not None:
            held = replace(self.state, tau=np.zeros(self.scene.model.nv))
            self._recorder = Recorder(self.simulator.system, held)
        self._shown = [self.state.t]
        return self.observe(self.state), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Hold an action for `hold` steps; see `gymnasium.Env.step`."""
        action = np.clip(
            checks.vector("action", np.asarray(action, dtype=float), self.action_space.shape[0]), -1.0, 1.0
        )
        before, info, truncated = self.state, {}, False
        try:
            results = self.simulator.steps(before, self.hold, self.forces(action, before))
        except NotConverged as error:
            results, truncated, info = list(error.results), True, {"not_converged": str(error)}
        if results:
            self.state = results[-1].state
        if self._recorder is not None:
            for result in results:
                self._recorder.add(replace(result, tau=result.state.tau) if result.tau is None else result)
            self._shown.append(self.state.t)
        reward = float(self.reward(before, self.state, action))
        return self.observe(self.state), reward, bool(self.ended(self.state)), truncated, info

    @property
    def trajectory(self) -> Trajectory:
        """The episode so far, to judge (`audit`), to save or to show; there with a render_mode.

        Raises:
            SceneError: the episode is not recorded.
        """
        if self._recorder is None:
            raise SceneError("episodes are recorded with a render_mode, from the first reset on")
        return self._recorder.trajectory(self.scene, repr(self.simulator.method), self.dt, True, "an episode")

    def render(self) -> Any:
        """The picture of now, shape (height, width, 3), or those since the last call; see `ngalpha_pin.viz`."""
        if self.render_mode is None:
            return None
        if self.render_mode == "rgb_array":
            return pictures(self.trajectory, self._shown[-1:], SIZE)[0]
        times, self._shown = self._shown, []
        return pictures(self.trajectory, times, SIZE) if times else []
