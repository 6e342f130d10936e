"""Runs of chosen accuracy: from event to event with an integrator of high order, event capturing where that stops.

A smooth phase (see `smooth_phase`) is integrated by scipy's DOP853, or by Radau where friction makes it stiff. The
dense output locates what ends it: the closing of a gap, lift-off, slip, stick, an event of the user. Impacts are those
of `impact_law`. A bounce that stays below the tolerance is none (see `settling`), so that bounces that accumulate come
to their end. Where events follow each other faster than `min_step`, or a phase cannot be integrated, and in scenes with
beams or with shapes whose touching features change, steps of the method itself carry on, of a size that two half steps
control.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import DOP853, Radau

from ngalpha_pin.errors import NgalphaError
from ngalpha_pin.event_driven.ode_solver import SHARE, Exchange, phase_solver
from ngalpha_pin.event_driven.percussions import Percussions, in_cones
from ngalpha_pin.event_driven.root_finding import ROUNDING, UserEvent, first_change, first_closing, first_root
from ngalpha_pin.event_driven.settling import Settled, settled
from ngalpha_pin.event_driven.smooth_phase import SmoothPhase
from ngalpha_pin.event_driven.step_doubling import captured_step
from ngalpha_pin.event_driven.tolerances import Accuracy
from ngalpha_pin.initialization.initial import consistent_state, free_state
from ngalpha_pin.integrators.impact_law import impact
from ngalpha_pin.integrators.method import failure as not_converged
from ngalpha_pin.results.events import Event
from ngalpha_pin.results.records import Chosen
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.system.state import Impact, SolvedBy, StepResult
from ngalpha_pin.system.system import System
from ngalpha_pin.tolerances import CLOSED

if TYPE_CHECKING:
    from ngalpha_pin.contact.table import Subset
    from ngalpha_pin.integrators.method import Method
    from ngalpha_pin.results.recorder import Recorder
    from ngalpha_pin.scene.scene import Scene

# the errors of captured steps are kept below this part of the tolerance
CAPTURED_SHARE = 0.2
# a bounce is none below this part of the tolerance
BOUNCE = 0.1
# a contact force that counts is not smaller than `smooth_phase.NO_FORCE` times this part of the weight of the scene
LIGHT = 1e-3
# events without progress before the method's own steps take over
MAX_STALLS = 3
# captured steps before a smooth phase is tried again, at most
MAX_PATIENCE = 64


class AdaptiveRun:
    """The time loop of a run of chosen accuracy.

    Args:
        system: compiled scene.
        method: of the steps that capture events.
        accuracy: what is asked for.
        recorder: takes the steps.
        t_eval: times to record, increasing; None records every step.
        events: of the user.

    Attributes:
        state: where the run is.
        stopped: a terminal event of the user has ended it.
        rejected: number of steps that were tried and not accepted.
        n_evaluations: calls of the equations of motion in smooth phases.
        located: changes of contact with their times.
        failure: the step of the method that did not converge, or None.
        unmet: time and contacts of the steps at `min_step` that miss the tolerance.
    """

    def __init__(
        self, system: System, method: Method, accuracy: Accuracy, recorder: Recorder,
        t_eval: np.ndarray | None, events: list[UserEvent],
    ):  # fmt: skip
        self.system, self.method, self.accuracy, self._recorder = system, method, accuracy, recorder
        self._t_eval = None if t_eval is None else [t for t in t_eval if t > recorder.state.t]
        self._events = events
        self.state = recorder.state
        self.stopped, self.rejected, self.n_evaluations = False, 0, 0
        self.located: list[Event] = []
        self.failure: StepResult | None = None
        self._error: NgalphaError | KeyboardInterrupt | None = None
        self.unmet: list[tuple[float, tuple[str, ...]]] = []
        self._percussions = Percussions(system)
        self._impacts: list[Impact] = []
        weight = sum(inertia.mass for inertia in system.model.inertias) * np.linalg.norm(system.model.gravity.linear)
        self._force = LIGHT * float(weight)  # size of contact forces
        self._captured_step = 1e3 * accuracy.min_step
        self._stalls, self._patience, self._wait, self._ran_away = 0, 1, 0, False
        self._modes: dict[int, bool] = {}  # closed contacts, and whether they slip
        self._user_values = [event.value(self.state.t, self.state.q, self.state.v) for event in events]

    def run(self, t_end: float) -> None:
        """Go on to t_end, to a terminal event of the user, or to where it cannot go on."""
        try:
            self._run(t_end)
        except (NgalphaError, KeyboardInterrupt) as error:  # of a function of the user's own, or of the user
            self._error = error
        except MemoryError:
            raise
        except Exception as error:  # of the arithmetic between the steps
            self.failure = StepResult(self.state, False, 0, SolvedBy.SMOOTH, np.inf, error=error)

    def _run(self, t_end: float) -> None:
        # beams have coordinates of their own; features that change would end a phase at every change
        can_integrate = self.system.nq == self.system.model.nq and self.system.slots.n == 0
        while self.state.t < t_end and not self.stopped and self.failure is None:
            start, done, force, self._ran_away = self.state.t, False, 0.0, False
            if can_integrate and self._wait == 0 and self._stalls < MAX_STALLS:
                done, force = self._smooth(t_end)
                self._stalls = self._stalls + 1 if self.state.t - start < self.accuracy.min_step else 0
                if done and not self._stalls:
                    self._force = max(self._force, force)
            if done:
                self._patience = 1
            elif self.state.t < t_end:
                if self._stalls or self._ran_away:
                    self.state = free_state(self.system, self.state.t, self.state.q, self.state.v, self.state.slots)
                self._wait = self._wait - 1 if self._wait else self._patience
                self._patience = min(2 * self._patience, MAX_PATIENCE)
                self._stalls = 0
                self._capture(t_end)

    def _smooth(self, t_end: float) -> tuple[bool, float]:
        """One smooth phase and the event that ends it; whether it could be integrated, and its contact force [N]."""
        state = self.state
        if state.dt > 0.0:  # after a captured step
            self._begin(state.t, state.q, state.v)
            state = self.state
        force = float(state.la_N.max(initial=0.0))
        phase = SmoothPhase(self.system, state, self._no_slip(state.v), max(force, self._force))
        # a step that is far too long is recognised by its error and rejected
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return self._follow(phase, t_end), force

    def _follow(self, phase: SmoothPhase, t_end: float) -> bool:
        """Step through a phase until it ends."""
        state, n = self.state, self.system.nq + self.system.nv
        forces = phase.forces(state.t, state.q, state.v)
        if not phase.agrees(state, forces):
            return False
        solver = phase_solver(phase, state.t, phase.start(state), t_end, self.accuracy)
        exchange = Exchange(phase, t_end, self.accuracy)
        watch = self.system.contacts.subset(np.setdiff1d(np.arange(self.system.contacts.n), phase.sub.index))
        touching = CLOSED * self.system.contacts.yardstick[watch.index]
        signs, gaps = phase.signs(forces, state.v), self._gaps(watch, state.q, state.v)
        integral = np.zeros(len(solver.y) - n)
        self._note_modes(phase)
        self._look_for_jumps()
        while not self.stopped:
            calls = phase.n_evaluations
            solver.step()
            if isinstance(solver, DOP853):
                self.rejected += max(0, (phase.n_evaluations - calls) // 12 - 1)
            if solver.status == "failed":  # forces that grow without bound
                self.n_evaluations += phase.n_evaluations
                self._ran_away = True
                return False
            t_0, t_1, sol = solver.t_old, solver.t, _Dense(solver, phase)
            q, v = phase.split(solver.y)
            forces = phase.last if isinstance(solver, DOP853) else phase.forces(t_1, q, v)
            new_signs, new_gaps = phase.signs(forces, v), self._gaps(watch, q, v)
            t_gap, gap = first_closing(
                (t_0, t_1), (gaps[0], new_gaps[0]), (gaps[1], new_gaps[1]),
                partial(self._gaps_within, watch, sol), touching,
            )  # fmt: skip
            t_sign = first_change(sol.signs, (t_0, t_1), (signs, new_signs))
            t_change = min(t_gap, t_sign)
            end = min(self._user_events(sol, min(t_change, t_1)), t_change, t_1)
            integral = self._record_between(phase, watch, sol, end, integral)
            y = sol.y(end)
            self._percussions.add_forces(phase.sub, *np.split(y[n:] - integral, [phase.sub.k + phase.sub.m]))
            integral = y[n:]
            closes = watch.index[[gap]] if t_gap == end else watch.index[:0]
            q, v = self._projected(phase, watch, end, y, closes)
            self.state = phase.state(end, q, v)
            if end == t_change and not self.stopped and not self._change(t_gap <= t_sign):
                return False
            self._record()
            if end == t_change or self.stopped or solver.status == "finished":
                self.n_evaluations += phase.n_evaluations
                return True
            signs, gaps = new_signs, new_gaps
            y = np.concatenate((q, v, y[n:]))
            if not np.array_equal(y, solver.y):  # it had drifted off the closed contacts and the constraints
                solver.y, solver.f = y, phase.rate(end, y)
            solver = exchange.after(solver)
        return True

    def _gaps(self, watch: Subset, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gaps and their rates."""
        if watch.k == 0:
            return np.zeros(0), np.zeros(0)
        rows = self.system.contact_rows_at(watch, q, v)
        return rows.g_N, rows.rate[: watch.k]

    def _gaps_within(self, watch: Subset, sol: _Dense, t: float) -> np.ndarray:
        return self._gaps_alone(watch, sol(t)[0])

    def _gaps_alone(self, watch: Subset, q: np.ndarray) -> np.ndarray:
        self.system.place(q)
        return self.system.gaps(watch, q)

    def _projected(
        self, phase: SmoothPhase, watch: Subset, t: float, y: np.ndarray, closes: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The motion on its contacts and constraints, without penetration."""
        q, v = phase.project(t, *phase.split(y), closes)
        if watch.k:
            deep = watch.index[self._gaps_alone(watch, q) < 0.0]
            if len(np.setdiff1d(deep, closes)):
                q, v = phase.project(t, q, v, np.union1d(deep, closes))
        return q, v

    def _change(self, closing: bool) -> bool:
        """What happens at the end of a phase; False where an impact is not solved."""
        t, q, v = self.state.t, self.state.q, self.state.v
        if closing:
            hit = impact(self.system, t, q, v)
            if hit is None:
                return False
            rest = self._begin(t, q, hit.v_after)
            what = "impact"
            if rest is not None and rest.bounced:
                what = "closed"
                P_N = hit.P_N.copy()
                P_N[np.searchsorted(hit.contacts, rest.contacts)] += rest.P_N
                P_N = np.maximum(P_N, 0.0)
                hit = hit._replace(P_N=P_N, P_F=in_cones(self.system.contacts.subset(hit.contacts), P_N, hit.P_F))
            else:
                self._impacts.append(hit)
            self._percussions.add_impact(hit)
            names = [self.system.contacts.names[i] for i in hit.contacts[hit.P_N > 0.0]]
            self.located += [Event(t, what, name) for name in names]
        else:
            self._begin(t, q, v)
        return True

    def _begin(self, t: float, q: np.ndarray, v: np.ndarray) -> Settled | None:
        """Begin a phase from a motion with a consistent state; what `settled` says of it."""
        height = BOUNCE * (self.accuracy.atol + self.accuracy.rtol * self.system.contacts.length)
        rest = None
        if self.system.contacts.n:
            rest = settled(self.system, t, q, v, height, 2.0 * self._no_slip(v))
        self.state = consistent_state(self.system, t, q, v if rest is None else rest.v)
        if rest is not None and not rest.bounced:
            nothing = np.zeros(self.system.joint_friction.f)
            sub = self.system.contacts.subset(rest.contacts)
            self._percussions.add_forces(sub, np.concatenate((rest.P_N, rest.P_F)), nothing)
        return rest

    def _no_slip(self, v: np.ndarray) -> float:
        """Slip that counts as none [m/s]."""
        return 1e-2 * SHARE * (self.accuracy.atol + self.accuracy.rtol * float(np.abs(v).max(initial=0.0)))

    def _note_modes(self, phase: SmoothPhase) -> None:
        """Events between the phase before and this one."""
        t, names = self.state.t, self.system.contacts.names
        modes = {int(i): bool(slips) for i, slips in zip(phase.sub.index, phase.slips, strict=True)}
        for i in self._modes.keys() - modes.keys():
            self.located.append(Event(t, "lift-off", names[i]))
        for i in self._modes.keys() & modes.keys():
            if self._modes[i] != modes[i]:
                self.located.append(Event(t, "slip" if modes[i] else "stick", names[i]))
        self._modes = modes

    def _record_between(
        self, phase: SmoothPhase, watch: Subset, sol: _Dense, end: float, integral: np.ndarray
    ) -> np.ndarray:
        """Record the wanted times before the end of a step."""
        n = self.system.nq + self.system.nv
        while self._t_eval and self._t_eval[0] < end:
            t = self._t_eval[0]
            y = sol.y(t)
            self._percussions.add_forces(phase.sub, *np.split(y[n:] - integral, [phase.sub.k + phase.sub.m]))
            integral = y[n:]
            self.state = phase.state(t, *self._projected(phase, watch, t, y, watch.index[:0]))
            self._record()
        return integral

    def _record(self, solved_by: SolvedBy = SolvedBy.SMOOTH, n_iter: int = 0) -> None:
        """Hand the state over, if this time is wanted."""
        if self._t_eval is not None:
            if not self._t_eval or self.state.t < self._t_eval[0]:
                return
            self._t_eval.pop(0)
        state = self._percussions.take(self.state)
        self._recorder.add(StepResult(state, True, n_iter, solved_by, 0.0, tuple(self._impacts)))
        self._impacts = []

    def _look_for_jumps(self) -> None:
        """Events of the user that an impact has passed over."""
        t, q, v = self.state.t, self.state.q, self.state.v
        for i, event in enumerate(self._events):
            value = event.value(t, q, v)
            if event.crossed(self._user_values[i], value) and event.add(t, q, v):
                self.stopped = True
            self._user_values[i] = value

    def _user_events(self, sol: _Dense, end: float) -> float:
        """Locate events of the user up to a time; the time of the first terminal one, or infinity."""
        found: list[tuple[float, UserEvent]] = []
        for i, event in enumerate(self._events):
            value = event.value(end, *sol(end))
            if event.crossed(self._user_values[i], value):

                def at(s: float, event: UserEvent = event) -> float:
                    return event.value(s, *sol(s))

                found.append((first_root(at, sol.t_0, end), event))
            self._user_values[i] = value
        for t, event in sorted(found, key=lambda pair: pair[0]):
            if event.add(t, *sol(t)):
                self.stopped = True
                return t
        return np.inf

    def _capture(self, t_end: float) -> None:
        """One step of the method, with the size that two half steps allow."""
        state, accuracy = self.state, self.accuracy
        target = min(t_end, self._t_eval[0]) if self._t_eval else t_end
        h = min(self._captured_step, accuracy.max_step, target - state.t)
        rtol, atol = CAPTURED_SHARE * accuracy.rtol, CAPTURED_SHARE * accuracy.atol
        step = captured_step(self.method, self.system, state, h, accuracy.min_step, rtol, atol)
        self.rejected += step.rejected
        if step.failure is not None:
            self.failure = step.failure
            return
        self._captured_step = step.next_size
        names = self.system.contacts.names
        if not step.accurate:
            self.unmet.append((state.t, tuple(names[i] for i in step.parts[-1].state.contacts)))
        for part in step.parts:
            self._percussions.add_step(part.state)
            self._impacts += part.impacts
            for hit in part.impacts:
                self.located += [Event(hit.t, "impact", names[i]) for i in hit.contacts[hit.P_N > 0.0]]
        self.state = step.parts[-1].state
        if abs(target - self.state.t) <= ROUNDING * abs(target):
            self.state = replace(self.state, t=target)
        self._look_for_jumps()
        self._record(SolvedBy.CAPTURED, sum(part.n_iter for part in step.parts))

    def trajectory(self, scene: Scene) -> tuple[Trajectory, NgalphaError | KeyboardInterrupt | None]:
        """The run so far, and why it did not go on, or None."""
        accuracy, failure = self.accuracy, self._error
        if self.failure is not None:
            failure = not_converged(self.method, self.system, self.state, self._captured_step, self.failure)
        message = "stopped by an event" if self.stopped else "reached t_end"
        if failure is not None:
            message = str(failure) or "interrupted"
        if self.unmet:
            t, names = self.unmet[0]
            at = f" with {', '.join(names[:6])} in contact" if names else ""
            message += f"; {len(self.unmet)} steps miss the tolerance, the first at t = {t:.6g} s{at}"
        chosen = Chosen(
            accuracy.rtol, accuracy.atol, self.rejected, self.n_evaluations, tuple(self.located), tuple(self.unmet),
            tuple(np.array(event.t) for event in self._events),
            tuple(np.array(event.q).reshape(-1, self.system.nq) for event in self._events),
            tuple(np.array(event.v).reshape(-1, self.system.nv) for event in self._events),
            self._t_eval is not None,
        )  # fmt: skip
        states = self._recorder.states
        mean = (states[-1].t - states[0].t) / max(1, len(states) - 1)
        return self._recorder.trajectory(scene, repr(self.method), mean, failure is None, message, chosen), failure


class _Dense:
    """The motion within a step, interpolated only where something is looked for."""

    def __init__(self, solver: DOP853 | Radau, phase: SmoothPhase):
        self._solver, self._phase = solver, phase
        self.t_0, self._t_1, self._y_1 = solver.t_old, solver.t, solver.y
        self._output: Callable[[float], np.ndarray] | None = None

    def y(self, t: float) -> np.ndarray:
        """Q, v and integrals at a time."""
        if t == self._t_1:
            return self._y_1
        if self._output is None:
            self._output = self._solver.dense_output()
        return self._output(t)

    def __call__(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Q and v at a time."""
        return self._phase.split(self.y(t))

    def signs(self, t: float) -> np.ndarray:
        """The signs that end the phase, at a time."""
        q, v = self(t)
        return self._phase.signs(self._phase.forces(t, q, v), v)
