"""Steps through one smooth phase to the event that ends it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853, Radau

from ngalpha_pin.event_driven.dense_step import DenseStep
from ngalpha_pin.event_driven.event_log import EventLog
from ngalpha_pin.event_driven.gap_watch import GapWatch
from ngalpha_pin.event_driven.ode_solver import Exchange, phase_solver
from ngalpha_pin.event_driven.pair_watch import PairWatch
from ngalpha_pin.event_driven.sign_dips import first_end
from ngalpha_pin.event_driven.smooth_phase import Forces, SmoothPhase
from ngalpha_pin.event_driven.tolerances import Accuracy
from ngalpha_pin.event_driven.transitions import Transitions
from ngalpha_pin.scene.given_pace import GivenPace
from ngalpha_pin.system.state import State

# distance from the constraints that shows that an error estimate means nothing: in tolerances, and beyond what is slow
STRAYED, SLOW = 100.0, 1e-8


class PhaseEnd(NamedTuple):
    """Where a phase has got.

    Attributes:
        state: the start of the next one; where it could not be integrated, as far as it got.
        done: it has come to an event or to the end of the time.
        ran_away: its forces grow without bound.
        singular: slip goes on where its forces are not unique any more.
        strayed: the motion had left its constraints by far more than the tolerance, which says nothing then.
        clings: number of a contact that stays closed from the start on, though it carries no force there, or -1.
    """

    state: State
    done: bool
    ran_away: bool = False
    singular: bool = False
    strayed: bool = False
    clings: int = -1


class Stand(NamedTuple):
    """One end of a step: motion, forces, the signs that end the phase, gaps and their rates."""

    q: np.ndarray
    v: np.ndarray
    forces: Forces
    signs: np.ndarray


class PhaseLoop:
    """Integrates phases.

    Args:
        accuracy: what is asked for.
        pace: of what is given, which bounds the steps.
        transitions: from one phase to the next.
        log: of the run.

    Attributes:
        rejected: number of steps that were tried and not accepted.
        n_evaluations: calls of the equations of motion.
    """

    def __init__(self, accuracy: Accuracy, pace: GivenPace, transitions: Transitions, log: EventLog):
        self._accuracy, self._pace, self._transitions, self._log = accuracy, pace, transitions, log
        self.rejected, self.n_evaluations = 0, 0

    def follow(self, state: State, phase: SmoothPhase, t_end: float, breaks: bool) -> PhaseEnd:
        """Step through a phase until it ends.

        Args:
            state: its start, with consistent forces.
            phase: the equations of motion from there on.
            t_end: the end of the time [s].
            breaks: what is given jumps there.
        """
        try:
            # a step that is far too long is recognised by its error and rejected
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                return self._follow(state, phase, t_end, breaks)
        finally:
            self.n_evaluations += phase.n_evaluations

    def _follow(self, state: State, phase: SmoothPhase, t_end: float, breaks: bool) -> PhaseEnd:
        here = self._stand(phase, state.q, state.v, phase.forces(state.t, state.q, state.v))
        if not phase.agrees(state, here.forces):
            return PhaseEnd(state, False)
        solver = phase_solver(phase, state.t, phase.start(state), t_end, self._accuracy, stiff=phase.begins_stiff)
        exchange = Exchange(phase, t_end, self._accuracy)
        watch = GapWatch(phase.system, phase.sub.index)
        start, gaps, pairs = state.t, watch.at(state.q, state.v), PairWatch(phase.system, phase.sub.index)
        self._log.begin_phase(state, phase)
        while not self._log.stopped:
            there = self._step(solver, phase)
            if there is None:
                return PhaseEnd(state, False, True)
            gaps_there = watch.at(there.q, there.v)
            step = DenseStep(
                solver, phase, np.array((here.v, there.v)), np.array((here.forces.a, there.forces.a))
            )  # fmt: skip
            if not pairs.stays(step):
                return PhaseEnd(state, False)
            t_gap, gap = watch.first_closing(step, gaps, gaps_there)
            ends = (step.t_0, here.signs), (step.t_1, there.signs)
            t_sign = first_end(step.signs, [ends[0], *step.inner_signs(), ends[1]])
            if t_gap == start:
                return PhaseEnd(state, False, clings=gap)
            change = min(t_gap, t_sign)
            end = min(self._log.look_within(step, min(change, step.t_1)), change, step.t_1)
            self._record_between(phase, watch, step, end)
            y = step.y(end)
            self._log.add_forces(phase, y)
            q, v = projected(phase, watch, end, y, np.array([gap] if t_gap == end else [], dtype=int))
            if self._strayed(phase.split(y)[1], v):
                return PhaseEnd(state, False, strayed=True)
            state = phase.state(end, q, v)
            singular = end == t_sign and phase.is_singular(state)
            if not self._log.stopped:
                begun = self._transitions.over(state, end == t_gap, end == t_sign, breaks and end == t_end)
                if begun is None:
                    return PhaseEnd(state, False)
                state = begun
            if singular and phase.slips_on(state):
                return PhaseEnd(state, False, singular=True)
            self._log.record(state)
            if end == change or self._log.stopped or solver.status == "finished":
                return PhaseEnd(state, True)
            y = np.concatenate((q, v, y[len(q) + len(v) :]))
            if not np.array_equal(y, solver.y):  # it had drifted off the closed contacts and the constraints
                solver.y, solver.f = y, phase.rate(end, y)
            phase.turn(there.forces)
            here, gaps = self._stand(phase, there.q, there.v, there.forces), gaps_there
            solver = exchange.after(solver)
        return PhaseEnd(state, True)

    def _strayed(self, before: np.ndarray, after: np.ndarray) -> bool:
        """Whether velocities have to be moved by far more than their tolerance to fulfil the constraints."""
        size, accuracy = float(np.abs(after).max(initial=0.0)), self._accuracy
        allowed = STRAYED * (accuracy.atol + accuracy.rtol * size) + SLOW * max(size, 1.0)
        return bool(np.abs(after - before).max(initial=0.0) > allowed)

    def _step(self, solver: DOP853 | Radau, phase: SmoothPhase) -> Stand | None:
        """One step of the integrator; None where it cannot go on: forces that grow without bound."""
        calls = phase.n_evaluations
        solver.max_step = min(self._accuracy.max_step, self._pace.longest(solver.t))
        solver.step()
        if isinstance(solver, DOP853):
            self.rejected += max(0, (phase.n_evaluations - calls) // 12 - 1)
        if solver.status == "failed":
            return None
        q, v = phase.split(solver.y)
        return self._stand(phase, q, v, phase.last if isinstance(solver, DOP853) else phase.forces(solver.t, q, v))

    @staticmethod
    def _stand(phase: SmoothPhase, q: np.ndarray, v: np.ndarray, forces: Forces) -> Stand:
        return Stand(q, v, forces, phase.signs(forces, v))

    def _record_between(self, phase: SmoothPhase, watch: GapWatch, step: DenseStep, end: float) -> None:
        """Record the wanted times before the end of a step."""
        while (t := self._log.next_wanted(end)) < end:
            y = step.y(t)
            self._log.add_forces(phase, y)
            self._log.record(phase.state(t, *projected(phase, watch, t, y, watch.sub.index[:0])))


def projected(
    phase: SmoothPhase, watch: GapWatch, t: float, y: np.ndarray, closes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The motion of a phase on its contacts and constraints, without penetration.

    Args:
        phase: gives the contacts and constraints.
        watch: the other contacts.
        t: time [s].
        y: see `SmoothPhase.start`.
        closes: numbers of the contacts that close there.
    """
    q, v = phase.project(t, *phase.split(y), closes)
    if watch.sub.k:
        deep = watch.sub.index[watch.alone(q) < 0.0]
        if len(np.setdiff1d(deep, closes)):
            q, v = phase.project(t, q, v, np.union1d(deep, closes))
    return q, v
