"""What happens between two smooth phases: impacts, bounces that are none, and forces that begin anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.common.tolerances import NO_DIRECTION, ROUNDING
from ngalpha_pin.event_driven.event_log import EventLog
from ngalpha_pin.event_driven.percussions import in_cones
from ngalpha_pin.event_driven.settling import Settled, settled
from ngalpha_pin.event_driven.tolerances import Accuracy
from ngalpha_pin.initialization.initial import closed_contacts, consistent_state, held_state, without_lost
from ngalpha_pin.integrators.breakpoints import velocity_jumps
from ngalpha_pin.integrators.impact_law import impact
from ngalpha_pin.scene.breakpoints import side
from ngalpha_pin.system.adhesion import holds, lets_go
from ngalpha_pin.system.contact_search import contact_speed
from ngalpha_pin.system.sampling import with_samples
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

# a bounce is none below this part of the tolerance: it changes the motion after it by some four times its height, and
# a cube that comes to rest on its corners, one after the other, has ten such ends
BOUNCE = 0.01
# impacts at one moment, one after the other, where the first ones leave contacts that approach
MAX_IMPACTS = 8


class Transitions:
    """From the end of a phase to the start of the next one.

    Args:
        system: compiled scene.
        accuracy: what is asked for.
        log: takes the impacts.
        breakpoints: times at which what is given jumps, increasing [s].
    """

    def __init__(self, system: System, accuracy: Accuracy, log: EventLog, breakpoints: np.ndarray):
        self._system, self._accuracy, self._log, self._breakpoints = system, accuracy, log, breakpoints

    def _after(self, t: float) -> float:
        """The time at which what is given is that of just after t [s]."""
        return t + side(t) if t in self._breakpoints else t

    def cross(self, state: State) -> State | None:
        """The state just after a breakpoint; None where an impact is not solved.

        Raises:
            SceneError: a given motion jumps.
        """
        if self._system.samplers:
            state = with_samples(self._system, state, self._after(state.t))
        # a gap can close at this moment as well
        jumps = self.approaching(state) or velocity_jumps(self._system, self._after(state.t), state.q, state.v)
        return self.close(state) if jumps else self.begin(state)

    def no_slip(self, v: np.ndarray) -> float:
        """Slip that counts as none [m/s]."""
        accuracy, fastest = self._accuracy, float(np.abs(v).max(initial=0.0))
        return max(NO_DIRECTION * (accuracy.atol + accuracy.rtol * fastest), ROUNDING * fastest)

    def approaching(self, state: State) -> bool:
        """Whether a contact that is closed has a velocity into it, as at the start of a run."""
        return len(self._struck(state)) > 0

    def _struck(self, state: State) -> np.ndarray:
        """The closed contacts with a velocity into them."""
        self._system.place(state.q)
        sub = closed_contacts(self._system, state.q)
        if sub.k == 0:
            return sub.index
        rows = self._system.contact_rows_at(sub, state.q, state.v, state.t)
        return sub.index[rows.rate[: sub.k] < -contact_speed(self._system, rows)]

    def start(self, state: State) -> State | None:
        """The state just after a moment at which closed contacts may approach; None where an impact is not solved."""
        return self.close(state) if self.approaching(state) else state

    def close(self, state: State) -> State | None:
        """The state just after a contact has closed; None where its impact is not solved."""
        for _ in range(MAX_IMPACTS):
            hit = impact(self._system, self._after(state.t), state.q, state.v)
            if hit is None:
                return None
            hit, struck = hit._replace(t=state.t), self._struck(state)
            state, rest = self._settle(state, hit.v_after, struck)
            kind = "impact"
            if rest is not None and _closes(rest, struck):
                kind = "closed"
                P_N, P_F = hit.P_N.copy(), hit.P_F.copy()
                sub = self._system.contacts.subset(hit.contacts)
                own = self._system.contacts.subset(rest.contacts)
                P_N[np.searchsorted(sub.index, own.index)] += rest.P_N
                P_F[np.searchsorted(sub.rows_F, own.rows_F)] += rest.P_F
                P_N = np.maximum(P_N, 0.0)
                hit = hit._replace(v_after=state.v, P_N=P_N, P_F=in_cones(sub, P_N, P_F))
            self._log.add_impact(hit, kind)
            if not self.approaching(state):
                return state
        return None

    def over(self, state: State, closes: bool, changes: bool, breaks: bool) -> State | None:
        """The state after what happens at the end of a step; None where an impact is not solved.

        Args:
            state: before it.
            closes: a gap closes.
            changes: a force or a slip does.
            breaks: what is given jumps.
        """
        if breaks:
            return self.cross(state)
        if closes:
            return self.close(state)
        return self.begin(state) if changes else state

    def begin(self, state: State) -> State:
        """The state with accelerations and forces of the contacts that are closed and do not open from now on."""
        return self._settle(state, state.v)[0]

    def _settle(self, state: State, v: np.ndarray, struck: np.ndarray | None = None) -> tuple[State, Settled | None]:
        """The start of a phase from a state with another velocity, and what `settled` says of it.

        Contacts that close begin to hold, as far as they have adhesion; those that press no more let go.

        Args:
            state: before it.
            v: velocity at its start, shape (nv,).
            struck: contacts that an impact has closed; None without one.
        """
        t, q, sampled = state.t, state.q, state.sampled
        system, accuracy = self._system, self._accuracy
        actuation = holds(state.actuation, np.setdiff1d(state.holding, lets_go(system, state)))
        height = BOUNCE * (accuracy.atol + accuracy.rtol * system.contacts.length)
        rest = None
        if system.contacts.n:
            rest = settled(system, self._after(t), q, v, height, 2.0 * self.no_slip(v), actuation)
        if rest is not None and not _closes(rest, struck):
            nothing = np.zeros(system.joint_friction.f)
            sub = system.contacts.subset(rest.contacts)
            self._log.percussions.add_forces(sub, np.concatenate((rest.P_N, rest.P_F)), nothing)
        start = consistent_state if struck is None else held_state
        state = start(system, self._after(t), q, v if rest is None else rest.v, actuation)
        state = without_lost(system, state)
        return replace(state, t=t, sampled=sampled), rest


def _closes(rest: Settled | None, struck: np.ndarray | None) -> bool:
    """Whether an impact is none: all contacts that it strikes would have bounced too low.

    Where another one is struck, the impact is one, and what has settled after it are forces of the step.
    """
    if rest is None or struck is None:
        return False
    return len(rest.bounced) > 0 and bool(np.isin(struck, rest.bounced).all())
