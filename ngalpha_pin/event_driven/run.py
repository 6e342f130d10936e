"""Runs of chosen accuracy: from event to event with an integrator of high order, event capturing where that stops.

A smooth phase (see `smooth_phase`) is integrated by scipy's DOP853, or by Radau where friction makes it stiff. The
dense output locates what ends it: the closing of a gap, lift-off, slip, stick, an event of the user. Impacts are those
of `impact_law`. A bounce that stays below the tolerance is none (see `settling`), so that bounces that accumulate come
to their end. Where events follow each other faster than `min_step`, or a phase cannot be integrated, and where the
features with which shapes touch change (see `pair_watch`), steps of the method itself carry on, of a size that two half
steps control.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.errors import NgalphaError, NotConverged
from ngalpha_pin.event_driven.event_log import EventLog
from ngalpha_pin.event_driven.phase_loop import PhaseLoop
from ngalpha_pin.event_driven.smooth_phase import SmoothPhase
from ngalpha_pin.event_driven.step_doubling import captured_step
from ngalpha_pin.event_driven.tolerances import Accuracy
from ngalpha_pin.event_driven.transitions import Transitions
from ngalpha_pin.event_driven.user_events import UserEvent
from ngalpha_pin.initialization.initial import NEAR, free_state
from ngalpha_pin.integrators.method import Method
from ngalpha_pin.integrators.method import failure as not_converged
from ngalpha_pin.results.recorder import Recorder
from ngalpha_pin.results.records import Chosen
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.scene.breakpoints import side
from ngalpha_pin.scene.given_pace import GivenPace
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.contact_search import load_slots
from ngalpha_pin.system.state import SolvedBy, StepResult
from ngalpha_pin.system.system import System

# the errors of captured steps are kept below this part of the tolerance
CAPTURED_SHARE = 0.2
# a contact force that counts is not smaller than `smooth_phase.NO_FORCE` times this part of the weight of the scene
LIGHT = 1e-3
# events without progress before the method's own steps take over
MAX_STALLS = 3
# contacts without a force at the start of a phase that stay closed in it, at most
MAX_CLINGS = 8
# captured steps before a smooth phase is tried again, at most
MAX_PATIENCE = 64


class AdaptiveRun:
    """The time loop of a run of chosen accuracy: smooth phases, and captured steps where there is none.

    Args:
        system: compiled scene.
        method: of the steps that capture events.
        accuracy: what is asked for.
        recorder: takes the steps.
        t_eval: times to record, increasing; None records every step.
        events: of the user.
        breakpoints: times at which what is given jumps, increasing [s].
        pace: of what is given.
    """

    def __init__(
        self, system: System, method: Method, accuracy: Accuracy, recorder: Recorder,
        t_eval: np.ndarray | None, events: list[UserEvent], breakpoints: np.ndarray, pace: GivenPace,
    ):  # fmt: skip
        self._system, self._method, self._accuracy, self._recorder = system, method, accuracy, recorder
        self._log = EventLog(system, recorder, t_eval, events)
        self._breakpoints, self._pace = breakpoints, pace
        self._transitions = Transitions(system, accuracy, self._log, breakpoints)
        self._loop = PhaseLoop(accuracy, pace, self._transitions, self._log)
        self._state, self._rejected = recorder.state, 0
        self._failure: NgalphaError | KeyboardInterrupt | None = None
        self._unmet: list[tuple[float, tuple[str, ...]]] = []  # steps at `min_step` that miss the tolerance
        weight = sum(inertia.mass for inertia in system.model.inertias) * np.linalg.norm(system.model.gravity.linear)
        self._force = LIGHT * float(weight)  # size of contact forces
        self._captured_step = 1e3 * accuracy.min_step

    def run(self, t_end: float) -> None:
        """Go on to t_end, to a terminal event of the user, or to where it cannot go on."""
        try:
            self._run(t_end)
        except (NgalphaError, KeyboardInterrupt) as error:  # of a function of the user's own, or of the user
            self._failure = error
        except MemoryError:
            raise
        except Exception as error:  # of the arithmetic between the steps
            failed = StepResult(self._state, False, 0, SolvedBy.SMOOTH, np.inf, error=error)
            self._failure = not_converged(self._method, self._system, self._state, self._captured_step, failed)

    def _run(self, t_end: float) -> None:
        stalls, patience, wait = 0, 1, 0
        self._state = self._transitions.start(self._state) or self._state
        while self._state.t < t_end and not self._log.stopped and self._failure is None:
            start, done, ran_away = self._state.t, False, False
            if wait == 0 and stalls < MAX_STALLS:
                done, ran_away = self._smooth(t_end)
                stalls = stalls + 1 if self._state.t - start < self._accuracy.min_step else 0
            if done:
                patience = 1
            elif self._state.t < t_end and self._failure is None:
                if stalls or ran_away:
                    state = self._state
                    free = free_state(self._system, state.t, state.q, state.v, state.slots, state.actuation)
                    self._state = replace(free, sampled=state.sampled)
                wait = wait - 1 if wait else patience
                patience = min(2 * patience, MAX_PATIENCE)
                stalls = 0
                self._capture(t_end)

    def _next_break(self, t_end: float) -> float:
        """The next breakpoint, if there is one before the end of the run [s]."""
        later = self._breakpoints[self._breakpoints > self._state.t]
        return min(t_end, float(later[0])) if len(later) else t_end

    def _smooth(self, t_end: float) -> tuple[bool, bool]:
        """One smooth phase and the event that ends it; whether it could be integrated, and whether forces ran away."""
        if self._state.dt > 0.0:  # after a captured step
            begun = self._transitions.start(self._transitions.begin(self._state))
            if begun is None:
                return False, False
            self._state = begun
        if self._system.slots.n:
            load_slots(self._system, self._state, self._accuracy.min_step, NEAR * self._system.contacts.length)
            self._state = self._transitions.begin(self._state)
        force = float(self._state.la_N.max(initial=0.0))
        slowest = self._transitions.no_slip(self._state.v)
        start, stop, clings = self._state.t, self._next_break(t_end), np.zeros(0, dtype=int)
        before = start + side(start) if start in self._breakpoints else start
        breaks = stop in self._breakpoints
        span = before, stop - side(stop) if breaks else np.inf
        for _ in range(1 + MAX_CLINGS):
            phase = SmoothPhase(self._system, self._state, slowest, max(force, self._force), span, clings)
            end = self._loop.follow(self._state, phase, stop, breaks)
            if end.clings < 0:
                break
            clings = np.union1d(clings, end.clings)
        self._state = end.state
        if end.singular or end.strayed:
            self._failure = self._not_unique(phase) if end.singular else self._strayed()
            return False, False
        if end.done and self._state.t - start >= self._accuracy.min_step:
            self._force = max(self._force, force)
        return end.done, end.ran_away

    def _not_unique(self, phase: SmoothPhase) -> NotConverged:
        """The error of a slip whose forces have grown without bound."""
        names = tuple(phase.sub.names[i] for i in np.flatnonzero(phase.slips))
        return NotConverged(
            f"at t = {self._state.t:.6g} s the contact forces grow without bound while {', '.join(names[:6])} slips: "
            "with so much friction the motion from there on is not unique (Painleve's paradox), and no accuracy can be "
            "met; steps of fixed dt choose one way",
            self._state.t,
            names,
        )

    def _strayed(self) -> NotConverged:
        """The error of a motion that does not stay on its constraints."""
        names = self._system.constraints.names
        return NotConverged(
            f"the motion leaves its constraints after t = {self._state.t:.6g} s by far more than the tolerance: there "
            f"{', '.join(dict.fromkeys(names))} are nearly dependent, as in a position in which a mechanism can change "
            "its shape, and no accuracy can be met; try a smaller rtol or max_step, or steps of fixed dt",
            self._state.t,
        )

    def _capture(self, t_end: float) -> None:
        """One step of the method, with the size that two half steps allow."""
        state, accuracy = self._state, self._accuracy
        stop = self._next_break(t_end)
        target = self._log.next_wanted(stop)
        breaks = target in self._breakpoints
        longest = min(accuracy.max_step, self._pace.longest(state.t))
        h = min(self._captured_step, longest, target - state.t - breaks * side(target))
        rtol, atol = CAPTURED_SHARE * accuracy.rtol, CAPTURED_SHARE * accuracy.atol
        step = captured_step(self._method, self._system, state, h, accuracy.min_step, rtol, atol)
        self._rejected += step.rejected
        if step.failure is not None:
            self._failure = not_converged(self._method, self._system, state, self._captured_step, step.failure)
            return
        self._captured_step = step.next_size
        if not step.accurate:
            names = self._system.contacts.names
            self._unmet.append((state.t, tuple(names[i] for i in step.parts[-1].state.contacts)))
        for part in step.parts:
            self._log.add_step(part)
        self._state = replace(step.parts[-1].state, sampled=state.sampled)
        if abs(target - self._state.t) <= 2 * side(target):
            self._state = replace(self._state, t=target)
            if breaks:
                self._state = self._transitions.cross(self._state) or self._state
        self._log.look_for_jumps(self._state)
        self._log.record(self._state, SolvedBy.CAPTURED, sum(part.n_iter for part in step.parts))

    def trajectory(self, scene: Scene) -> tuple[Trajectory, NgalphaError | KeyboardInterrupt | None]:
        """The run so far, and why it did not go on, or None."""
        accuracy, failure = self._accuracy, self._failure
        message = "stopped by an event" if self._log.stopped else "reached t_end"
        if failure is not None:
            message = str(failure) or "interrupted"
        if self._unmet:
            t, names = self._unmet[0]
            at = f" with {', '.join(names[:6])} in contact" if names else ""
            message += f"; {len(self._unmet)} steps miss the tolerance, the first at t = {t:.6g} s{at}"
        t_events, q_events, v_events = self._log.of_users(self._system.nq, self._system.nv)
        chosen = Chosen(
            accuracy.rtol, accuracy.atol, self._rejected + self._loop.rejected, self._loop.n_evaluations,
            tuple(self._log.located), tuple(self._unmet), t_events, q_events, v_events, self._log.sampled,
        )  # fmt: skip
        mean = (self._recorder.state.t - self._recorder.start.t) / max(1, len(self._recorder))
        return self._recorder.trajectory(scene, repr(self._method), mean, failure is None, message, chosen), failure
