"""The time loop: `simulate` for a whole run, `Simulator` for one step at a time."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from threading import Lock

import numpy as np
from tqdm import tqdm

from ngalpha_pin.common import checks
from ngalpha_pin.errors import Interrupted, NgalphaError, NotWritten, SceneError
from ngalpha_pin.event_driven.run import AdaptiveRun
from ngalpha_pin.event_driven.tolerances import Accuracy, checked_accuracy, checked_times
from ngalpha_pin.event_driven.user_events import UserEvent, UserFunction
from ngalpha_pin.initialization.initial import checked_values, initial_state
from ngalpha_pin.integrators.breakpoints import steps_ahead
from ngalpha_pin.integrators.method import Method, failure
from ngalpha_pin.integrators.restart import after_jump
from ngalpha_pin.results.chunks import UNDER_WAY, Store
from ngalpha_pin.results.reading import Reading
from ngalpha_pin.results.recorder import Recorder
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.scene.breakpoints import completed, declared, side
from ngalpha_pin.scene.given_pace import GivenPace
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.sensitivities.differentiated import Differentiated, Sensitivities, differentiated
from ngalpha_pin.simulation.inputs import (
    checked_dt,
    checked_events,
    checked_method,
    checked_scene,
    checked_state,
    checked_t_end,
    checked_torque,
    number_of_steps,
)
from ngalpha_pin.simulation.record import Record
from ngalpha_pin.simulation.scene_changes import SceneChanges
from ngalpha_pin.simulation.variants import force_names, pair_names
from ngalpha_pin.system.contact_search import leave_out_overlaps
from ngalpha_pin.system.names import names_of
from ngalpha_pin.system.sampling import due, held
from ngalpha_pin.system.state import State, StepResult
from ngalpha_pin.system.system import System

AHEAD = 256  # steps at most between two looks at Ctrl-C and at the bar of the progress


class Simulator(SceneChanges):
    """A scene that is stepped by hand, e.g. in a control loop. Steps give the same bits as `simulate`.

    It belongs to one thread at a time; a call while another thread is inside is an error. Threads can share a scene
    that is not changed any more, each with a Simulator of its own.

    Args:
        scene: what to simulate.
        dt: step [s].
        method: by default `GeneralizedAlpha()`.
        record: keep all steps for `trajectory()`.
    """

    def __init__(self, scene: Scene, dt: float, method: Method | None = None, record: bool = False):
        self.dt, self.method = checked_dt(dt), checked_method(method)
        self.system, self._breakpoints = System(checked_scene(scene)), declared(scene)
        self.scene = self._declared = scene
        self._in_use = Lock()
        self._known: State | None = None  # a state of its own needs no check
        self._record = Record(scene, repr(self.method), self.dt) if checks.flag("record", record) else None

    def initial_state(self, q0: np.ndarray, v0: np.ndarray | None = None) -> State:
        """Consistent state at t = 0; see `ngalpha_pin.initialization.initial.initial_state`."""
        with self._alone():
            self._known = state = replace(initial_state(self.system, q0, v0), names=names_of(self.system))
            self._declared.simulators.add(self)
            if self._record is not None:
                self._record.begin(self.system, state)
            return state

    def trajectory(self) -> Trajectory:
        """What was stepped so far, as `simulate` would return it.

        A step from an earlier state takes back what came after it; one from a state of elsewhere begins anew.

        Raises:
            SceneError: the simulator was not made with record=True, or nothing was stepped.
        """
        if self._record is None:
            raise SceneError("this Simulator keeps no record: make it with Simulator(..., record=True)")
        with self._alone():
            return self._record.trajectory()

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """The names of "joints", contact "pairs", "contacts" (their corners), "constraints" and "forces" now."""
        joints, contacts, constraints, _ = names_of(self.system)
        pairs, forces = pair_names(self.scene), force_names(self.scene)
        found = {"joints": joints, "pairs": pairs, "contacts": contacts, "constraints": constraints, "forces": forces}
        return {kind: tuple(dict.fromkeys(names)) for kind, names in found.items()}

    def step(self, state: State, tau: np.ndarray | None = None) -> State:
        """The state one step later.

        Args:
            state: start of the step; it is not changed.
            tau: generalized force on the tree that is held during the step, shape (nv,) of the model [N or N m].

        Raises:
            NotConverged: no rung of the solver ladder found a solution.
            SceneError: tau or the state does not fit the scene.
            NgalphaError: another thread is inside of this simulator.
        """
        return self.steps(state, 1, tau)[0].state

    def steps(self, state: State, n: int, tau: np.ndarray | None = None) -> list[StepResult]:
        """N steps with one force, the same as one after the other, but at once as far as nothing happens in them.

        Args:
            state: start of the first step; it is not changed.
            n: how many.
            tau: generalized force on the tree that is held during all of them, shape (nv,) of the model [N or N m].

        Raises:
            As `step`; the `results` of a `NotConverged` are those of the steps before it.
        """
        checks.integer("n", n, 1)
        with self._alone():
            if state is not self._known:
                checked_state(self.system, state)
                self._declared.simulators.add(self)
            given = state
            beside = checked_torque(tau, self.system.scene.model.nv)
            if len(beside) or len(state.tau):
                total, sampled = held(self.system, state.sampled, beside), state.sampled
                jumps = (total.any() or state.tau.any()) and not np.array_equal(total, state.tau)
                state = replace(state, tau=total)
                if jumps:
                    state = replace(after_jump(self.system, state), sampled=sampled, names=given.names)
            found: list[StepResult] = []
            state = state if state.names else replace(state, names=names_of(self.system))
            while len(found) < n:
                room = min(n - len(found), AHEAD)
                ahead = steps_ahead(self.method, self.system, state, self.dt, room, self._breakpoints, beside)
                for result in ahead:
                    if not result.converged:
                        error = failure(self.method, self.system, state, self.dt, result)
                        error.results = found
                        raise error
                    if not result.state.names:
                        result = replace(result, state=replace(result.state, names=state.names))
                    if self._record is not None:
                        self._record.add(self.system, given, state, result)
                    found.append(result)
                    given = state = self._known = result.state
            return found

    def sensors(self, state: State) -> Reading:
        """What the sensors show at a state: contact forces, joint reactions, motion of frames; see `Reading`.

        Args:
            state: of this simulator.

        Raises:
            SceneError: it is no `State`.
        """
        checks.instance("state", state, State, "a State, such as that of a step")
        with self._alone():
            return Reading(self.system, state, repr(self.method))

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Inside of this no other thread is: the arrays of the system are those of one step at a time."""
        if not self._in_use.acquire(blocking=False):
            raise NgalphaError(
                "this Simulator is in the middle of a step in another thread: its arrays are those of one step at a "
                "time; make one Simulator for each thread"
            )
        try:
            yield
        finally:
            self._in_use.release()


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
    sensitivities: Sensitivities | None = None,
    progress: bool = False,
    save_to: str | os.PathLike[str] | None = None,
    every: int = 1000,
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
        sensitivities: by what the run is differentiated, see `Sensitivities`; with `dt`. The derivatives are in
            `trajectory.derivatives`, the motion has the same bits as without.
        progress: show a progress bar.
        save_to: folder for chunks of a run with `dt`, so that it takes no more memory than one of them and nothing that
            was computed is lost; see `Chunks`.
        every: steps of one chunk.

    Returns:
        The trajectory, with `save_to` of the last chunk; `success` is False where it ended early.

    Raises:
        SceneError: an input cannot be used (before anything is computed), or a function of the user's own gives
            something that cannot be used at a later time.
        NotConverged: a step has no solution.
        NotWritten: a chunk cannot be written; the error has its trajectory.
        Interrupted: the user has pressed Ctrl-C; its `trajectory` is what was computed.
    """
    checks.choice("on_failure", on_failure, ("raise", "stop"))
    checks.flag("progress", progress)
    method, found = checked_method(method), checked_events(events)
    if (state is None) == (q0 is None) or (v0 is not None and q0 is None):
        raise SceneError("give either q0 (and v0) or a state to continue from")
    of_rtol = bool(found) or any(x is not None for x in (atol, t_eval, min_step)) or max_step is not np.inf
    dt = _step_of(dt, rtol, state, of_rtol, save_to is not None)
    if sensitivities is not None and (rtol is not None or state is not None or save_to is not None):
        raise SceneError("sensitivities are those of a run with dt from q0 and v0, without save_to")
    system, q0, v0 = _system_at(scene, q0, v0)
    start = 0.0 if state is None else checked_state(system, state).t
    t_end = checked_t_end(t_end, start, dt)
    if dt is not None:
        n = number_of_steps(start, t_end, dt)
        state = _start(system, q0, v0, state)
        derived = None if sensitivities is None else differentiated(system, method, sensitivities, state)
        store = None if save_to is None else Store(save_to, every, state)
        recorder = Recorder(system, state)
        ended = _fixed_steps(system, method, recorder, dt, n, progress, store, derived)
        return _ended(_of_fixed_steps(system, method, recorder, dt, ended, store, derived), ended, on_failure)
    assert rtol is not None
    accuracy = checked_accuracy(rtol, atol, max_step, min_step, t_end - start)
    times = checked_times(t_eval, start, t_end)
    known = completed(scene, start, t_end, q0 if state is None else state.q)
    if known is not scene:
        system = System(known)
    state = _start(system, q0, v0, state)
    return _ended(*_to_accuracy(system, method, state, t_end, accuracy, times, found), on_failure)


def _to_accuracy(
    system: System,
    method: Method,
    state: State,
    t_end: float,
    accuracy: Accuracy,
    times: np.ndarray | None,
    found: list[UserEvent],
) -> tuple[Trajectory, NgalphaError | KeyboardInterrupt | None]:
    """A run of chosen accuracy, and what ended it early, or None."""
    breaks = np.union1d(declared(system.scene), due(system, state, t_end + side(t_end)))
    pace = GivenPace(system.scene, state.q, state.v, state.t, t_end)
    run = AdaptiveRun(system, method, accuracy, Recorder(system, state), times, found, breaks, pace)
    run.run(t_end)
    return run.trajectory(system.scene)


def _step_of(dt: float | None, rtol: float | None, state: State | None, of_rtol: bool, saves: bool) -> float | None:
    """The step of a run of fixed steps, or None of one with rtol.

    Args:
        dt: as given.
        rtol: as given.
        state: that is continued.
        of_rtol: something is given that only a run with rtol has.
        saves: chunks are saved.
    """
    if rtol is not None:
        if dt is not None or saves:
            raise SceneError("give either dt or rtol; save_to belongs to a run with dt")
        return None
    if of_rtol:
        raise SceneError("atol, max_step, min_step, t_eval and events belong to a run with rtol")
    if dt is None and isinstance(state, State):
        dt = state.whole or state.dt
    if dt is None:
        raise SceneError("give a step dt [s], or an accuracy rtol that chooses the steps")
    return checked_dt(dt)


def _system_at(
    scene: Scene, q0: np.ndarray | None, v0: np.ndarray | None
) -> tuple[System, np.ndarray | None, np.ndarray | None]:
    """The scene, compiled, without pairs that overlap at its start and that no one has named; and the checked start."""
    system = System(checked_scene(scene))
    if q0 is None:
        return system, None, None
    q0, v0 = checked_values(system, q0, v0)
    if any(pair.found for pair in scene.contacts) and leave_out_overlaps(scene, system, q0):
        system = System(scene)
    return system, q0, v0


def _start(system: System, q0: np.ndarray | None, v0: np.ndarray | None, state: State | None) -> State:
    """The state that a run begins with, from checked values or from a state that is continued."""
    if state is not None:
        # the force of a step of a `Simulator` is held by that step alone
        return replace(state, tau=held(system, state.sampled))
    assert q0 is not None
    return initial_state(system, q0, v0)


def _ended(trajectory: Trajectory, ended: NgalphaError | KeyboardInterrupt | None, on_failure: str) -> Trajectory:
    """The run, or what ended it early with the run so far."""
    if isinstance(ended, KeyboardInterrupt):
        interrupted = Interrupted(f"interrupted at t = {trajectory.t[-1]:g} s")
        interrupted.trajectory = trajectory
        raise interrupted from ended
    if ended is not None and on_failure == "raise":
        ended.trajectory = trajectory
        raise ended
    return trajectory


def _of_fixed_steps(
    system: System,
    method: Method,
    recorder: Recorder,
    dt: float,
    ended: NgalphaError | KeyboardInterrupt | None,
    store: Store | None,
    derived: Differentiated | None,
) -> Trajectory:
    """The trajectory of fixed steps, with its derivatives, and its last chunk written."""
    message = "reached t_end" if ended is None else str(ended) or "interrupted"
    trajectory = recorder.trajectory(system.scene, repr(method), dt, ended is None, message)
    trajectory.derivatives = None if derived is None else derived.derivatives()
    if store is not None and not isinstance(ended, NotWritten):
        store.write(trajectory, ended)
    return trajectory


def _fixed_steps(
    system: System,
    method: Method,
    recorder: Recorder,
    dt: float,
    n: int,
    progress: bool,
    store: Store | None,
    derived: Differentiated | None,
) -> NgalphaError | KeyboardInterrupt | None:
    """N steps, with the chunks that are full in the store; what ended them early, or None."""
    breakpoints = declared(system.scene)
    try:
        with tqdm(total=n, disable=not progress, unit="step", leave=False) as bar:
            while n > 0:
                if store is not None and len(recorder) == store.every:
                    store.write(recorder.trajectory(system.scene, repr(method), dt, False, UNDER_WAY))
                    recorder.forget()
                room = n if store is None else min(n, store.every - len(recorder))
                results = steps_ahead(method, system, recorder.state, dt, min(room, AHEAD), breakpoints)
                if not results[-1].converged:  # then it is the only one
                    return failure(method, system, recorder.state, dt, results[-1])
                if derived is None:
                    recorder.extend(results)
                else:
                    for result in results:
                        derived.add(result)
                        recorder.add(result)
                n -= len(results)
                bar.update(len(results))
    except (NgalphaError, KeyboardInterrupt) as ended:  # of a function of the user's own, or of the user
        return ended
    return None
