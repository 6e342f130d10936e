"""A step through impacts at second order: smooth up to each impact, the impact at its own moment, smooth after it.

A step that meets an impact anywhere within it and puts it at its end is of first order, for the contacts that close and
for all others that feel it. Here the moment is located on repeated smooth steps that end before it. Impacts that
accumulate would divide a step without end: after `MAX_IMPACTS` the rest of the step captures what is left of them.
Shapes whose touching features change keep those of the start of the part until its impact; the next part looks again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ngalpha_pin.common.tolerances import CLOSED
from ngalpha_pin.contact.kernel_rows import gaps_and_rates
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.initialization.initial import held_state
from ngalpha_pin.integrators.attempt import attempt
from ngalpha_pin.integrators.impact_law import impact
from ngalpha_pin.integrators.parts import Moment, SmoothPart, StraightPart
from ngalpha_pin.step.contact_history import join_percussions
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.state import Impact, SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

MAX_IMPACTS = 8
# gap at which an impact counts as located, in parts of the size of the scene, and steps to get there; where they stay
# in one place what they leave is the tolerance of the smooth steps, whose iterations differ
LOCATED, MAX_SEARCH, LEFT = 1e-13, 8, 0.1 * CLOSED
# parts of a step that are shorter than this are a straight line
SHORT = 1e-6
# gap of a contact that has not yet left, in parts of what its speed makes of it in the interval
LEAVES = 1e-6


class Located(NamedTuple):
    """A moment within a step.

    Attributes:
        before: the state just before it.
        h: its distance from the start of the step [s].
        n_iter: iterations so far.
        parts: of the step up to there.
    """

    before: State
    h: float
    n_iter: int
    parts: tuple[SmoothPart | StraightPart, ...]


def through_impact(
    parameters: Parameters,
    system: System,
    state: State,
    dt: float,
    trial: StepResult,
    rest_of_step: Callable[[State, float], StepResult],
) -> StepResult | None:
    """The step through its first impact, and on to its end; None where it is not located.

    Args:
        parameters: of the method for the smooth parts.
        system: compiled scene.
        state: start of the step.
        dt: step [s].
        trial: the step without the contacts that close in it.
        rest_of_step: goes on from the state just after the impact.
    """
    located = _before_impact(parameters, system, state, dt, trial)
    if located is None:
        return None
    before = located.before
    hit = impact(system, before.t, before.q, before.v)
    if hit is None:
        return None
    after = held_state(system, hit.t, hit.q, hit.v_after, state.actuation)
    after = replace(after, near=before.near, clearance=before.clearance, dt=0.0)
    return go_on(system, state, dt, located, after, rest_of_step, SolvedBy.IMPACT, hit)


def go_on(
    system: System,
    state: State,
    dt: float,
    located: Located,
    after: State,
    rest_of_step: Callable[[State, float], StepResult],
    solved_by: SolvedBy,
    hit: Impact | None = None,
) -> StepResult | None:
    """A step that is divided at a moment, from there to its end; None where the rest of it does not converge.

    Args:
        system: compiled scene.
        state: start of the step.
        dt: step [s].
        located: the moment.
        after: the state just after it.
        rest_of_step: goes on from there.
        solved_by: what happens there, for the result.
        hit: an impact there.
    """
    before, h, n_iter, parts = located
    moment = Moment(solved_by, before, after, hit)
    if dt - h <= SHORT * dt:
        end = straight(system, after, dt - h)
        rest = StepResult(end, True, 0, solved_by, 0.0, parts=(StraightPart(after, dt - h, end),))
    else:
        rest = rest_of_step(after, dt - h)
        if not rest.converged:
            return None
    end = replace(rest.state, t=state.t + dt)
    if hit is not None:
        end = join_percussions(system, impulses(hit, system.joint_friction.f), end)
    if h > SHORT * dt:
        end = join_percussions(system, before, end)
    impacts = rest.impacts if hit is None else (hit, *rest.impacts)
    # forces at the end are those of its last part
    solved_by = SolvedBy.CAPTURED if rest.solved_by is SolvedBy.CAPTURED else solved_by
    every = (*parts, moment, *rest.parts)
    return StepResult(end, True, n_iter + rest.n_iter, solved_by, rest.residual, impacts, parts=every)


def _before_impact(
    parameters: Parameters, system: System, state: State, dt: float, trial: StepResult
) -> Located | None:
    """The first moment at which a gap closes.

    Each smooth step ends at the first root of the cubics through the gaps and their rates at the ends of the interval
    in which a contact closes.
    """
    n_iter, low, high = trial.n_iter, (0.0, state), (dt, trial.state)
    watch, at_low, at_high = _watched(system, low[1], high[1], trial.state)
    h = 0.0
    for _ in range(MAX_SEARCH):
        if not (at_high[0] < 0.0).any():
            return None
        last, h = h, _first_root(low[0], high[0], at_low, at_high)
        if h <= SHORT * dt:
            before = straight(system, state, h)
            return Located(before, h, n_iter, (StraightPart(state, h, before),))
        part = attempt(parameters, system, state, h, until_closing=True, features=trial.state)
        n_iter += part.n_iter
        if not part.converged:
            return None
        if len(part.state.slots) > len(trial.state.slots):  # shapes touch with features that had not been foreseen
            trial = part
            watch, at_low, at_high = _watched(system, low[1], high[1], trial.state)
        now = _of(system, watch, part.state)
        smallest = (now[0] / system.contacts.yardstick[watch.index]).min()
        if abs(smallest) <= (LEFT if abs(h - last) <= SHORT * dt else LOCATED):
            return Located(part.state, h, n_iter, part.parts)
        if smallest < 0.0:
            high, at_high = (h, part.state), now
        else:
            low, at_low = (h, part.state), now
    return None


def _watched(
    system: System, low: State, high: State, trial: State
) -> tuple[Subset, tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """The contacts that may close in the step, with their gaps and rates at both ends of the interval.

    A corner beside the face that it would touch may be behind the plane of that face all the time.
    """
    table = system.contacts
    watch = table.subset(np.setdiff1d(trial.near, trial.contacts))
    at_low = _of(system, watch, low)
    if system.slots.n:
        ahead = at_low[0] >= -CLOSED * table.yardstick[watch.index]
        if not ahead.all():
            watch = table.subset(watch.index[ahead])
            at_low = _of(system, watch, low)
    return watch, at_low, _of(system, watch, high)


def _of(system: System, sub: Subset, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Gaps and their rates at a state."""
    return gaps_and_rates(system, sub, state.q, state.v, state.t)


def _first_root(
    low: float, high: float, at_low: tuple[np.ndarray, np.ndarray], at_high: tuple[np.ndarray, np.ndarray]
) -> float:
    """Earliest time between low and high at which the gap of a contact that is closed at high vanishes [s].

    One that touches at low and leaves closes where it comes back.
    """
    k, h = at_high[0] < 0.0, high - low
    gap, rate = at_low[0][k], h * at_low[1][k]
    leaves = (rate > 0.0) & (gap <= LEAVES * rate)
    if (gap[~leaves] <= 0.0).any():  # it touches at low already
        return low
    spline = CubicHermiteSpline([0.0, 1.0], [np.where(leaves, 0.0, gap), at_high[0][k]], [rate, h * at_high[1][k]])
    first = []
    for cubic, leaving in zip(spline.c[:, 0].T, leaves, strict=True):
        roots = np.roots(cubic[:3] if leaving else cubic)  # of gap / time where it begins at zero
        first += [x for x in roots.real[roots.imag == 0.0] if 0.0 <= x <= 1.0]
    return low + h * float(min(first, default=0.5))


def straight(system: System, state: State, h: float) -> State:
    """The state a moment later, where h^2 does not count."""
    return replace(state, t=state.t + h, q=system.integrate(state.q, h * state.v), v=state.v + h * state.a)


def without_impact(system: System, state: State) -> Impact:
    """A moment within a step at which its parts meet without an impact: what touches there may carry a percussion."""
    nothing, b = np.zeros(0), system.constraints.kb + system.constraints.mb
    none = np.zeros(0, dtype=int)
    return Impact(state.t, state.q, state.v, state.v, none, nothing, nothing, np.zeros(b), state.slots)


def impulses(hit: Impact, friction: int) -> State:
    """A state with the percussions of an impact and nothing else."""
    return State(
        hit.t, hit.q, hit.v_after, np.zeros_like(hit.v_after), hit.contacts,
        np.zeros_like(hit.P_N), np.zeros_like(hit.P_F), hit.P_N, hit.P_F, hit.P_N, hit.P_F,
        P_f=np.zeros(friction), La_b=hit.P_b, slots=hit.slots,
    )  # fmt: skip
