"""What happens in a run: states for the recorder, changes of contact, impacts, and the events of the user."""

from __future__ import annotations

import numpy as np

from ngalpha_pin.event_driven.dense_step import DenseStep
from ngalpha_pin.event_driven.percussions import Percussions
from ngalpha_pin.event_driven.root_finding import first_root
from ngalpha_pin.event_driven.smooth_phase import SmoothPhase
from ngalpha_pin.event_driven.user_events import UserEvent
from ngalpha_pin.results.events import KINDS, Event
from ngalpha_pin.results.recorder import Recorder
from ngalpha_pin.system.state import Impact, SolvedBy, State, StepResult
from ngalpha_pin.system.system import System


class EventLog:
    """The log of a run.

    Args:
        system: compiled scene.
        recorder: takes the states.
        t_eval: times to record, increasing; None records every step.
        events: of the user.

    Attributes:
        located: changes of contact with their times.
        stopped: a terminal event of the user has ended the run.
        percussions: since the last recorded time.
    """

    def __init__(self, system: System, recorder: Recorder, t_eval: np.ndarray | None, events: list[UserEvent]):
        start = recorder.state
        self._names, self._n = system.contacts.names, system.nq + system.nv
        self._recorder, self._users = recorder, events
        self._wanted = None if t_eval is None else [t for t in t_eval if t > start.t]
        self.sampled = t_eval is not None
        self.located: list[Event] = []
        self.stopped = False
        self.percussions = Percussions(system)
        self._impacts: list[Impact] = []
        self._slips: dict[int, np.ndarray] = {}  # cones that are closed, and the direction of slip: zero without one
        self._integrals = np.zeros(0)  # of the forces of a phase, as far as they are among the percussions
        self._values = [event.value(start.t, start.q, start.v) for event in events]

    def next_wanted(self, end: float) -> float:
        """The next time to record, if it is before another one."""
        return min(end, self._wanted[0]) if self._wanted else end

    def begin_phase(self, state: State, phase: SmoothPhase) -> None:
        """Note lift-off, stick, slip and its reversal, rest and roll between the phase before and this one."""
        self._integrals = phase.start(state)[self._n :]
        cones, n = phase.sub.cones, len(self._names)
        ways = phase.slips[cones.of_row] * phase.direction
        slips = {int(i): ways[cones.of_row == j] for j, i in enumerate(cones.numbers)}
        for i in self._slips.keys() - slips.keys():
            if i < n:
                self.located.append(Event(state.t, "lift-off", self._names[i]))
        for i in self._slips.keys() & slips.keys():
            before, after = self._slips[i], slips[i]
            if before.any() != after.any() or before @ after < 0.0:
                kind = KINDS[i >= n][0 if after.any() else 1]
                self.located.append(Event(state.t, kind, self._names[i % n]))
        self._slips = slips
        self.look_for_jumps(state)

    def add_forces(self, phase: SmoothPhase, y: np.ndarray) -> None:
        """The forces of a phase up to a moment at which it is at y."""
        forces = y[self._n :] - self._integrals
        self.percussions.add_forces(phase.sub, *np.split(forces, [phase.sub.k + phase.sub.m]))
        self._integrals = y[self._n :]

    def add_impact(self, hit: Impact, kind: str) -> None:
        """An impact, or a closing without a bounce, between two phases."""
        if kind == "impact":
            self._impacts.append(hit)
        self.percussions.add_impact(hit)
        self.located += [Event(hit.t, kind, self._names[i]) for i in hit.contacts[hit.P_N > 0.0]]

    def add_step(self, part: StepResult) -> None:
        """A step of the method."""
        self.percussions.add_step(part.state)
        self._impacts += part.impacts
        for hit in part.impacts:
            self.located += [Event(hit.t, "impact", self._names[i]) for i in hit.contacts[hit.P_N > 0.0]]

    def record(self, state: State, solved_by: SolvedBy = SolvedBy.SMOOTH, n_iter: int = 0) -> None:
        """Hand a state over, if its time is wanted."""
        if self._wanted is not None:
            if not self._wanted or state.t < self._wanted[0]:
                return
            self._wanted.pop(0)
        state = self.percussions.take(state)
        self._recorder.add(StepResult(state, True, n_iter, solved_by, 0.0, tuple(self._impacts)))
        self._impacts = []

    def look_for_jumps(self, state: State) -> None:
        """Events of the user that an impact or a step of the method has passed over."""
        t, q, v = state.t, state.q, state.v
        for i, event in enumerate(self._users):
            value = event.value(t, q, v)
            if event.crossed(self._values[i], value) and event.add(t, q, v):
                self.stopped = True
            self._values[i] = value

    def look_within(self, step: DenseStep, end: float) -> float:
        """Locate events of the user in a step up to a time; the time of the first terminal one, or infinity."""
        found: list[tuple[float, UserEvent]] = []
        for i, event in enumerate(self._users):
            value = event.value(end, *step(end))
            if event.crossed(self._values[i], value):

                def at(s: float, event: UserEvent = event) -> float:
                    return event.value(s, *step(s))

                found.append((first_root(at, step.t_0, end), event))
            self._values[i] = value
        for t, event in sorted(found, key=lambda pair: pair[0]):
            if event.add(t, *step(t)):
                self.stopped = True
                return t
        return np.inf

    def of_users(self, nq: int, nv: int) -> tuple[tuple[np.ndarray, ...], ...]:
        """Times, configurations and velocities of the events of the user, one array per event."""
        return (
            tuple(np.array(event.t) for event in self._users),
            tuple(np.array(event.q).reshape(-1, nq) for event in self._users),
            tuple(np.array(event.v).reshape(-1, nv) for event in self._users),
        )
