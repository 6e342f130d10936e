"""The time loop: `simulate` for a whole run, `Simulator` for one step at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from tqdm import tqdm

from ngalpha_pin.errors import NgalphaError, SceneError
from ngalpha_pin.event_driven.root_finding import UserEvent, UserFunction
from ngalpha_pin.event_driven.run import AdaptiveRun
from ngalpha_pin.event_driven.tolerances import checked_accuracy, checked_times
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.integrators.method import Method
from ngalpha_pin.integrators.restart import after_jump
from ngalpha_pin.results.recorder import Recorder
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.contact_search import leave_out_overlaps
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System


class Simulator:
    """A scene that is stepped by hand, e.g. in a control loop. Steps give the same bits as `simulate`.

    Args:
        scene: what to simulate.
        dt: step [s].
        method: by default `GeneralizedAlpha()`.
    """

    def __init__(self, scene: Scene, dt: float, method: Method | None = None):
        self.dt = _checked_dt(dt)
        self.method = GeneralizedAlpha() if method is None else method
        self.system = System(scene)

    def initial_state(self, q0: np.ndarray, v0: np.ndarray | None = None) -> State:
        """Consistent state at t = 0; see `ngalpha_pin.initial.initial_state`."""
        return initial_state(self.system, q0, v0)

    def step(self, state: State, tau: np.ndarray | None = None) -> State:
        """The state one step later.

        Args:
            state: start of the step; it is not changed.
            tau: generalized force on the tree that is held during the step, shape (nv,) of the model [N or N m].

        Raises:
            NotConverged: no rung of the solver ladder found a solution.
        """
        if tau is not None:
            tau = np.array(tau, dtype=float)
            nv = self.system.scene.model.nv
            if tau.shape != (nv,) or not np.isfinite(tau).all():
                raise SceneError(f"tau must be finite with shape ({nv},)")
        held = np.zeros(0) if tau is None else tau
        jumps = (held.any() or state.tau.any()) and not np.array_equal(held, state.tau)
        state = replace(state, tau=held)
        if jumps:
            state = after_jump(self.system, state)
        result = self.method.step(self.system, state, self.dt)
        if not result.converged:
            raise self.method.not_converged(self.system, state, self.dt, result)
        return result.state


def simulate(
    scene: Scene,
    q0: np.ndarray | None = None,
    v0: np.ndarray | None = None,
    *,
    t_end: float,
    dt: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float = np.inf,
    min_step: float | None = None,
    t_eval: Sequence[float] | np.ndarray | None = None,
    events: UserFunction | Sequence[UserFunction] = (),
    method: Method | None = None,
    state: State | None = None,
    on_failure: str = "raise",
    progress: bool = False,
) -> Trajectory:
    """Integrate a scene from its initial values to t_end, with fixed steps `dt` or to the accuracy `rtol`.

    With `rtol`, smooth motion is integrated at order 8 between impacts, lift-offs and changes between slip and stick,
    which are located; the method takes over where they follow each other too fast.

    Args:
        scene: what to simulate.
        q0: initial configuration, shape (nq,).
        v0: initial velocity, shape (nv,); None is rest.
        t_end: end of the run [s]; with `dt` the last step ends at the nearest multiple of it.
        dt: step [s]; may be left out when a state is continued.
        rtol: allowed error relative to the size of each coordinate [-], instead of dt.
        atol: allowed absolute error [SI units of q and v]; by default the number of `rtol`.
        max_step: longest step with `rtol` [s].
        min_step: events closer than this are not located one by one [s]; by default 1e-9 of the run.
        t_eval: times to record with `rtol`, increasing [s]; None records every step.
        events: functions of (t, q, v) whose zeros are located, with `rtol`; their attributes `terminal` and
            `direction` mean what they do in `scipy.integrate.solve_ivp`. See `Trajectory.chosen`.
        method: by default `GeneralizedAlpha()`.
        state: continue from this state instead of q0 and v0, e.g. `trajectory.final_state`.
        on_failure: of a step: "raise" raises the error with the trajectory up to there; "stop" returns that trajectory.
        progress: show a progress bar.

    Returns:
        The trajectory; `success` is False where it ended early.

    Raises:
        SceneError: an input cannot be used (before anything is computed), or a function of the user's own gives
            something that cannot be used at a later time.
        NotConverged: a step has no solution.
    """
    if on_failure not in ("raise", "stop"):
        raise SceneError(f"on_failure = {on_failure!r} must be 'raise' or 'stop'")
    method = GeneralizedAlpha() if method is None else method
    if rtol is None:
        if atol is not None or t_eval is not None or min_step is not None or max_step != np.inf or len(_listed(events)):
            raise SceneError("atol, max_step, min_step, t_eval and events belong to a run with rtol")
        dt = _checked_dt(dt if dt is not None or state is None else state.whole or state.dt)
    elif dt is not None:
        raise SceneError("give either dt or rtol")
    if (state is None) == (q0 is None):
        raise SceneError("give either q0 (and v0) or a state to continue from")
    system = System(scene)
    if state is None:
        assert q0 is not None
        if any(pair.found for pair in scene.contacts) and leave_out_overlaps(scene, system, q0):
            system = System(scene)
        state = initial_state(system, q0, v0)
    elif state.q.shape != (system.nq,):
        raise SceneError("the state belongs to another scene: its q has the wrong length")
    else:
        state = replace(state, tau=np.zeros(0))  # a force is held by steps of a `Simulator` alone
    if not (np.isfinite(t_end) and t_end > state.t + 1e-9 * (dt or 0.0)):
        raise SceneError(f"t_end = {t_end} must be later than the start at t = {state.t:g} s")
    recorder = Recorder(system, state)
    failure: NgalphaError | None
    if rtol is None:
        assert dt is not None
        failure = _fixed_steps(system, method, recorder, dt, max(1, round((t_end - state.t) / dt)), progress)
        message = "reached t_end" if failure is None else str(failure)
        trajectory = recorder.trajectory(scene, repr(method), dt, failure is None, message)
    else:
        accuracy = checked_accuracy(rtol, atol, max_step, min_step, t_end - state.t)
        found = [UserEvent(function) for function in _listed(events)]
        run = AdaptiveRun(system, method, accuracy, recorder, checked_times(t_eval, state.t, t_end), found)
        run.run(t_end)
        trajectory, failure = run.trajectory(scene)
    if failure is not None and on_failure == "raise":
        failure.trajectory = trajectory
        raise failure
    return trajectory


def _listed(events: UserFunction | Sequence[UserFunction]) -> Sequence[UserFunction]:
    return (events,) if callable(events) else events


def _fixed_steps(
    system: System, method: Method, recorder: Recorder, dt: float, n: int, progress: bool
) -> NgalphaError | None:
    """N steps; the error of the one that failed, or None."""
    for _ in tqdm(range(n), disable=not progress, unit="step", leave=False):
        try:
            result = method.step(system, recorder.state, dt)
        except SceneError as error:  # of a function of the user's own
            return error
        if not result.converged:
            return method.not_converged(system, recorder.state, dt, result)
        recorder.add(result)
    return None


def _checked_dt(dt: float | None) -> float:
    if dt is None or not (np.isfinite(dt) and dt > 0):
        raise SceneError(f"dt = {dt} must be a positive number of seconds")
    return float(dt)
