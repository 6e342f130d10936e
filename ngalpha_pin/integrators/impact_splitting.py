"""A step through impacts at second order: smooth up to each impact, the impact at its own moment, smooth after it.

A step that meets an impact anywhere within it and puts it at its end is of first order, for the contacts that close and
for all others that feel it. Here the moment is located on repeated smooth steps that end before it. Impacts that
accumulate would divide a step without end: after `MAX_IMPACTS` the rest of the step captures what is left of them.
Shapes whose touching features change keep those of the start of the part until its impact; the next part looks again.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ngalpha_pin.common.tolerances import CLOSED
from ngalpha_pin.contact.kernel_rows import gaps_and_rates
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.integrators.attempt import attempt
from ngalpha_pin.integrators.impact_law import impact
from ngalpha_pin.integrators.joining import SHORT, straight
from ngalpha_pin.integrators.parts import StraightPart
from ngalpha_pin.integrators.piece import Cut, Piece
from ngalpha_pin.system.contact_search import add_missing
from ngalpha_pin.system.fast_turns import nearly_touch
from ngalpha_pin.system.state import SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

MAX_IMPACTS = 8  # bounces of one step whose order is kept; what comes back more often accumulates
# gap at which an impact counts as located, in parts of the size of the scene, and steps to get there; where they stay
# in one place what they leave is the tolerance of the smooth steps, whose iterations differ
LOCATED, MAX_SEARCH, LEFT = 1e-13, 8, 0.1 * CLOSED
# gap of a contact that has not yet left, in parts of what its speed makes of it in the interval
LEAVES = 1e-6


def cut_at_impact(piece: Piece, trial: StepResult) -> Cut | None:
    """The first impact of a step, or where shapes are about to meet; None where neither is located.

    Shapes that come from afar, or turn, touch with other features than the step has foreseen at its start. It is
    divided where they are near each other, and looks again.

    Args:
        piece: the step.
        trial: the step without the contacts that close in it.
    """
    cut = _before_impact(piece, trial)
    if cut is None:
        return _before_touch(piece, trial)
    before = cut.before
    hit = impact(piece.system, before.t, before.q, before.v)
    return None if hit is None else cut._replace(hit=hit)


def _before_impact(piece: Piece, trial: StepResult) -> Cut | None:
    """The first moment at which a gap closes.

    Each smooth step ends at the first root of the cubics through the gaps and their rates at the ends of the interval
    in which a contact closes. The end of a step moves with its length at a rate that is off by the error of the method:
    where that is slow to converge, because steps are long, the secant through the last two ends takes over.
    """
    _, system, state, dt = piece
    n_iter, low, high = trial.n_iter, (0.0, state), (dt, trial.state)
    watch, at_low, at_high = _watched(system, low[1], high[1], trial.state)
    h = 0.0
    ends: list[tuple[float, float]] = []  # times and smallest gaps of the last two tries
    for _ in range(MAX_SEARCH):
        if not (at_high[0] < 0.0).any():
            return None
        last, h = h, _secant(ends, low[0], high[0]) or _first_closing(low[0], high[0], at_low, at_high)
        if h <= SHORT * dt:
            before = straight(system, state, h)
            return Cut(before, h, n_iter, (StraightPart(state, h, before),), SolvedBy.IMPACT)
        part = attempt(piece._replace(dt=h), until_closing=True, features=trial.state)
        n_iter += part.n_iter
        if not part.converged:
            return None
        if len(part.state.slots) > len(trial.state.slots):  # shapes touch with features that had not been foreseen
            trial = part
            watch, at_low, at_high = _watched(system, low[1], high[1], trial.state)
        now = _of(system, watch, part.state)
        smallest = (now[0] / system.contacts.yardstick[watch.index]).min()
        ends = [*ends[-1:], (h, float(smallest))]
        if abs(smallest) <= (LEFT if abs(h - last) <= SHORT * dt else LOCATED):
            foreseen = _with_missing(system, part.state)
            if foreseen is part.state:
                return Cut(part.state, h, n_iter, part.parts, SolvedBy.IMPACT)
            trial, high = replace(trial, state=foreseen), (h, part.state)
            watch, at_low, at_high = _watched(system, low[1], high[1], foreseen)
            if not (at_high[0] < 0.0).any():  # what was missing only touches
                return Cut(foreseen, h, n_iter, part.parts, SolvedBy.IMPACT)
        elif smallest < 0.0:
            high, at_high = (h, part.state), now
        else:
            low, at_low = (h, part.state), now
    return None


def _before_touch(piece: Piece, trial: StepResult) -> Cut | None:
    """A moment at which shapes are about to touch, if they are not from the start of the step on."""
    system = piece.system
    part = nearly_touch(system, piece.state, trial.state, trial.closing) if system.slots.n else None
    if part is None or part <= SHORT:
        return None
    smooth = attempt(piece._replace(dt=part * piece.dt), until_closing=True)
    if not smooth.converged:
        return None
    return Cut(smooth.state, part * piece.dt, trial.n_iter + smooth.n_iter, smooth.parts, SolvedBy.START)


def _secant(ends: list[tuple[float, float]], low: float, high: float) -> float | None:
    """Where the line through the last two ends, times and smallest gaps, vanishes between two times, or None [s]."""
    if len(ends) < 2 or ends[0][1] == ends[1][1]:
        return None
    (t_0, g_0), (t_1, g_1) = ends
    root = t_1 - g_1 * (t_1 - t_0) / (g_1 - g_0)
    return root if low < root < high else None


def _with_missing(system: System, state: State) -> State:
    """The state with the features that penetrate at it and had not been foreseen, or the same where there are none.

    A rim may come down between its points that the step has known.
    """
    if system.slots.n == 0:
        return state
    system.slots.restore(state.slots)
    loaded = system.contacts.subset(system.contacts.n_fixed + np.flatnonzero(system.slots.loaded))
    added = add_missing(system, system.gaps_and_normals(loaded, state.q)[1])
    if len(added) == 0:
        return state
    return replace(state, near=np.union1d(state.near, added), slots=system.slots.contents())


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


def _first_closing(
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
