"""A step through the end of a slip at second order: it ends there, and forces begin anew.

Where a slip stops or turns back, friction jumps; a step that meets that anywhere within it is of first order. The
forces at its ends show it: friction on the edge of its cone at the start is inside of it, or the other way, at the end.
The moment is located from before it, where the motion is smooth: the speed of the slip and its rate say how long it
still lasts, and smooth steps that end a little earlier say it again. A slip whose direction turns need not vanish: such
a step stays whole, as do those with more contacts than are divided at impacts. Rolling that comes to
rest is such an end.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from ngalpha_pin.common.tolerances import CONE, TINY
from ngalpha_pin.contact.kernel_rows import rows_at
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.initialization.initial import joint_speed
from ngalpha_pin.integrators.attempt import attempt
from ngalpha_pin.integrators.joining import straight
from ngalpha_pin.integrators.parts import SmoothPart, StraightPart
from ngalpha_pin.integrators.piece import Cut, Piece
from ngalpha_pin.step.contact_history import join_percussions, remembered
from ngalpha_pin.system.contact_search import contact_speed
from ngalpha_pin.system.state import SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

# smooth steps to get there, by which part of the time that is left the first one ends earlier, and from which part of a
# step on what is left is a straight line
MAX_SEARCH, EARLY, STRAIGHT = 12, 0.1, 1e-4
# Newton corrections of such a step: one that is smooth takes few
MAX_CORRECTIONS = 8
# a slip may end in a step where the speeds of its start say that it does within so many of them
SOON = 1.5
# steps of Newton's method on a polynomial, from near to its root
MAX_NEWTON = 8


class Slips(NamedTuple):
    """Slips that end in a step.

    Attributes:
        cones: numbers of the cones in the table, see `Cones`, shape (c,).
        joints: numbers of the coordinates with dry friction, shape (f,).
    """

    cones: np.ndarray
    joints: np.ndarray


class Speeds(NamedTuple):
    """Slips at one motion, cones first, shape (c + f,) each.

    Attributes:
        direction: unit vectors, shape (c + f, 3) [-].
        speed: [m/s or rad/s].
        rate: of the speed [m/s^2 or rad/s^2].
        none: speed that is none.
    """

    direction: np.ndarray
    speed: np.ndarray
    rate: np.ndarray
    none: np.ndarray

    @property
    def times(self) -> np.ndarray:
        """Time to the end of each at these rates, shape (c + f,) [s]."""
        return np.where(self.rate < 0.0, self.speed / -np.minimum(self.rate, -TINY), np.inf)

    @property
    def first(self) -> int:
        """Number of the one that ends first."""
        return int(np.argmin(self.times))

    @property
    def left(self) -> float:
        """Time to the first end at these rates [s]."""
        return float(self.times.min(initial=np.inf))


def ending_slips(system: System, start: State, end: State) -> Slips | None:
    """Slips that end in a step, as the forces at its two ends show them; None without any."""
    ends, joints = start.contacts[:0], start.contacts[:0]
    if start.la_F.any() and len(end.contacts):
        sub = system.contacts.subset(start.contacts)
        cones, la_N, la_F = sub.cones, end.la_N, end.la_F
        slipped = _on_edge(system, start, sub, start.la_N, start.la_F)
        if slipped.any():
            if not np.array_equal(start.contacts, end.contacts):
                la_N, la_F = _forces_of(system, end, sub)
            turned = cones.products(start.la_F, la_F) <= 0.0
            presses = (la_N > 0.0)[cones.contact]
            ends = cones.numbers[slipped & presses & (turned | ~_on_edge(system, end, sub, la_N, la_F))]
    if len(start.tau_f) and len(end.tau_f):
        friction = system.joint_friction
        sides = [
            (tau >= friction.upper * (1 - CONE)) * 1 - (tau <= friction.lower * (1 - CONE))
            for tau in (start.tau_f, end.tau_f)
        ]
        joints = np.flatnonzero((sides[0] != 0) & (sides[0] != sides[1]))
    return Slips(ends, joints) if len(ends) or len(joints) else None


def slipping(system: System, state: State) -> bool:
    """Friction of some contact is on the edge of its cone."""
    if not state.la_F.any():
        return False
    return bool(_on_edge(system, state, system.contacts.subset(state.contacts), state.la_N, state.la_F).any())


def slips_that_may_end(piece: Piece) -> Slips | None:
    """Slips of which speeds and rates at the start of a step say that they end about then; None without any."""
    system, state = piece.system, piece.state
    sub = system.contacts.subset(state.contacts)
    slips, here = _slipping(system, state, Slips(sub.cones.numbers, state.contacts[:0]))
    soon = here.times < SOON * piece.dt
    return Slips(slips.cones[soon], slips.joints) if soon.any() else None


def _on_edge(system: System, state: State, sub: Subset, la_N: np.ndarray, la_F: np.ndarray) -> np.ndarray:
    """On the edge of which cones friction is, or which slip where the edge depends on it, shape (c,)."""
    cones = sub.cones
    friction = cones.products(la_F, la_F)
    edge: np.ndarray = (friction > 0.0) & (friction >= (cones.mu * la_N[cones.contact] * (1 - CONE)) ** 2)
    if cones.curves:
        if system.slots.n:
            system.slots.restore(state.slots)
        rows = system.contact_rows_at(sub, state.q, state.v, state.t)
        slips = cones.sizes(rows.rate[sub.k :]) > contact_speed(system, rows)
        places = [i for i, _ in cones.curves]
        edge[places] = slips[places] & (la_N > 0.0)[places]
    return edge


def _forces_of(system: System, state: State, sub: Subset) -> tuple[np.ndarray, np.ndarray]:
    """Forces of some contacts in a state, zero where it does not know them, shapes (k,) and (m,)."""
    every = system.contacts.subset(np.union1d(sub.index, state.contacts))
    la = remembered(system, state, every.index, (state.la_N, state.la_F))[0]
    return la[np.searchsorted(every.index, sub.index)], la[every.k + np.searchsorted(every.rows_F, sub.rows_F)]


def _speeds(system: System, state: State, slips: Slips) -> Speeds:
    """The slips at a state."""
    if system.slots.n:
        system.slots.restore(state.slots)
    c, f = len(slips.cones), len(slips.joints)
    gamma, change = np.zeros((2, c + f, 3))
    none = np.full(c + f, joint_speed(system))
    if c:
        sub = system.contacts.subset(np.unique(slips.cones % system.contacts.n))
        system.dynamics(state.t, state.q, state.v, state.a, state.actuation)
        rows, cones = rows_at(system, sub, state.q, state.v, state.a, state.t), sub.cones
        own = np.isin(cones.numbers, slips.cones)[cones.of_row]  # a contact may have another cone
        cone, place = np.searchsorted(slips.cones, cones.numbers[cones.of_row[own]]), np.arange(sub.m) - cones.first
        at = cone, place[own]
        gamma[at], change[at] = rows.rate[sub.k :][own], rows.acceleration[sub.k :][own]
        none[:c] = contact_speed(system, rows)
    dofs = system.joint_friction.dofs[slips.joints]
    gamma[c:, 0], change[c:, 0] = state.v[dofs], state.a[dofs]
    speed = np.linalg.norm(gamma, axis=1)
    unit = gamma / np.maximum(speed, TINY)[:, None]
    return Speeds(unit, speed, (unit * change).sum(axis=1), none)


def _slipping(system: System, state: State, slips: Slips) -> tuple[Slips, Speeds]:
    """Those of some slips that are there at a state: one that sticks may be on the edge of its cone."""
    now = _speeds(system, state, slips)
    there, c = now.speed > now.none, len(slips.cones)
    kept = Slips(slips.cones[there[:c]], slips.joints[there[c:]])
    return kept, Speeds(*(x[there] for x in now))


class _Search:
    """Smooth steps that come ever nearer to the end of a slip.

    All of them begin where the step does, until one is not solved: near its end a slip with rotation turns so quickly
    that Newton's method finds the direction from a place nearby alone. From there on each begins where the last one has
    ended, and covers the same part of the time that is left.
    """

    def __init__(self, piece: Piece, trial: StepResult):
        self._piece, self._begins = smooth_steps(piece), 0.0  # what the steps begin with, and when
        self._behind: tuple[SmoothPart | StraightPart, ...] = ()  # parts up to there
        self._percussions: State | None = None  # of these parts
        self._features = trial.state if trial.converged else None
        self.n_iter = trial.n_iter
        self.low, self.at, self.parts = piece.state, 0.0, self._behind  # the last step that was smooth
        self.goes_on = False

    def attempt(self, h: float) -> StepResult | None:
        """The smooth step that ends at h, or None."""
        if self.goes_on:
            self._go_on()
        features = None if self._behind else self._features
        found = attempt(self._piece._replace(dt=h - self._begins), until_closing=True, features=features)
        self.n_iter += found.n_iter
        return found if found.converged else None

    def take(self, part: StepResult, h: float) -> None:
        """Take the step that ends at h."""
        self.low, self.at, self.parts = part.state, h, (*self._behind, *part.parts)

    def cut(self, end: State, h: float, more: tuple[StraightPart, ...] = ()) -> Cut:
        """What has been found, with the percussions of all parts."""
        if self._percussions is not None:
            end = join_percussions(self._piece.system, self._percussions, end)
        return Cut(end, h, self.n_iter, (*self.parts, *more), SolvedBy.SLIP)

    def _go_on(self) -> None:
        if self.at > self._begins:
            before, self._piece = self._percussions, self._piece._replace(state=self.low)
            self._percussions = self.low if before is None else join_percussions(self._piece.system, before, self.low)
            self._begins, self._behind = self.at, self.parts


def smooth_steps(piece: Piece) -> Piece:
    """The step as one in which nothing happens: Newton's method finds it soon, or no other solver is asked."""
    if not piece.parameters.auto:
        return piece
    return piece._replace(parameters=piece.parameters._replace(solver="newton", max_iter=MAX_CORRECTIONS))


def cut_at_end_of_slip(piece: Piece, trial: StepResult, slips: Slips) -> Cut | None:
    """The first end of a slip, or where the step has no solution in one piece, the last moment before it that has.

    Each smooth step ends before it, by a part of what the moment has moved; the last rest is a straight line. None
    where it is not located.

    Args:
        piece: the step.
        trial: the step in one piece.
        slips: those that end, see `ending_slips`.
    """
    system, state, dt = piece[1:]
    search, root = _Search(piece, trial), 0.0
    slips, here = _slipping(system, state, slips)
    times, speeds, rates = [0.0], [here.speed], here.rate
    margin, least = EARLY * min(here.left, dt), 0.3 * STRAIGHT * dt
    for _ in range(MAX_SEARCH):
        low, at = search.low, search.at
        if here.left <= STRAIGHT * dt and at + here.left < dt:
            end = _coasted(system, low, here.left)
            there, first = _speeds(system, end, slips), here.first
            if there.speed[first] <= there.none[first]:
                return search.cut(end, at + here.left, (StraightPart(low, here.left, end),))
            least *= EARLY
        known, root = root, extrapolated_root(np.array(times), np.array(speeds), rates)
        if not np.isfinite(root):
            break
        if search.goes_on:
            margin = EARLY * (root - at)
        elif len(times) > 1 and root != known:  # a step that went too far has told nothing new
            margin = max(min(margin, abs(root - known)), least)
        h = min(max(root - margin, 0.5 * (at + min(root, dt))), 0.5 * (at + dt) if root >= dt else root)
        part = search.attempt(h)
        if part is not None and len(part.closing):
            return None
        if part is None:
            if search.goes_on or at == 0.0:
                break
            search.goes_on = True
            continue
        there = _speeds(system, part.state, slips)
        if ((there.direction * here.direction).sum(axis=1) > 0.0).all() and (there.speed > there.none).all():
            here = there
            search.take(part, h)
            times.append(h)
            speeds.append(there.speed)
        else:
            margin *= 10.0
    return search.cut(search.low, search.at) if search.at > 0.0 and not trial.converged else None


def _coasted(system: System, state: State, h: float) -> State:
    """The state a moment later, with what its forces do until then."""
    P_N, P_F = state.P_N + h * state.la_N, state.P_F + h * state.la_F
    return replace(straight(system, state, h), P_N=P_N, P_F=P_F, P_f=state.P_f + h * state.tau_f)


def extrapolated_root(times: np.ndarray, speeds: np.ndarray, rates: np.ndarray) -> float:
    """Where the first of some functions of time vanishes after the last known time; infinity where none does.

    Beyond the root the motion is another one, so that it cannot be taken between two known times, as an event of a
    smooth motion or a gap that closes can.

    Args:
        times: increasing from zero, shape (n,) [s].
        speeds: values there, positive, shape (n, k).
        rates: derivatives at zero, shape (k,).
    """
    nodes = np.concatenate(([0.0], times))
    first = np.inf
    for values, rate in zip(speeds.T, rates, strict=True):
        # Newton's polynomial through the values, and through the derivative by a double node
        table, known = [values[0]], np.concatenate(([values[0]], values))
        differences = known
        for order in range(1, len(nodes)):
            width = nodes[order:] - nodes[:-order]
            rise = np.diff(differences)
            differences = np.where(width > 0.0, rise / np.where(width > 0.0, width, 1.0), rate)
            table.append(differences[0])
        polynomial = Polynomial([table[-1]])
        for node, c in zip(nodes[len(table) - 2 :: -1], table[-2::-1], strict=True):
            polynomial = polynomial * Polynomial([-node, 1.0]) + c
        slope, t = polynomial.deriv(), float(times[-1])
        for _ in range(MAX_NEWTON):
            fall = float(slope(t))
            if not fall < 0.0:
                t = np.inf
                break
            t -= float(polynomial(t)) / fall
        first = min(first, t if t > times[-1] else np.inf)
    return first
