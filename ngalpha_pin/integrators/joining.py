"""A step that was divided, put together: the state behind a cut, the rest of the step, and what both have done."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.initialization.initial import consistent_state, held_state, without_lost
from ngalpha_pin.integrators.parts import Moment, StraightPart
from ngalpha_pin.integrators.piece import Cut, Piece
from ngalpha_pin.step.contact_history import join_percussions
from ngalpha_pin.system.adhesion import holds, lets_go
from ngalpha_pin.system.state import Impact, SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

# parts of a step that are shorter than this are a straight line
SHORT = 1e-6


def straight(system: System, state: State, h: float) -> State:
    """The state a moment later, where h^2 does not count."""
    return replace(state, t=state.t + h, q=system.integrate(state.q, h * state.v), v=state.v + h * state.a)


def anew(system: System, state: State, holding: np.ndarray) -> State:
    """The state with accelerations and forces that agree with those of some contacts that can hold."""
    gone = lets_go(system, state) if len(state.holding) else state.holding
    actuation = holds(state.actuation, np.setdiff1d(holding, gone))
    after = without_lost(system, consistent_state(system, state.t, state.q, state.v, actuation))
    return replace(after, near=state.near, clearance=state.clearance, sampled=state.sampled, dt=0.0)


def behind(system: System, cut: Cut) -> State:
    """The state just after a cut."""
    before, hit = cut.before, cut.hit
    if hit is not None:
        after = held_state(system, hit.t, hit.q, hit.v_after, before.actuation)
        return replace(after, near=before.near, clearance=before.clearance, dt=0.0)
    if system.slots.n:
        system.slots.restore(before.slots)
    return anew(system, before, before.holding)


def straight_rest(piece: Piece, cut: Cut, after: State) -> StepResult | None:
    """The rest of a step behind a cut, where it is so short that it is a straight line; otherwise None."""
    h = piece.dt - cut.h
    if h > SHORT * piece.dt:
        return None
    end = straight(piece.system, after, h)
    return StepResult(end, True, 0, cut.kind, 0.0, parts=(StraightPart(after, h, end),))


def joined(piece: Piece, cut: Cut, after: State, rest: StepResult) -> StepResult:
    """The whole step.

    Args:
        piece: the step.
        cut: where it was divided.
        after: the state just after the cut.
        rest: from there to the end of the step.
    """
    system, before, hit = piece.system, cut.before, cut.hit
    end = replace(rest.state, t=piece.state.t + piece.dt)
    if hit is not None:
        end = join_percussions(system, impulses(hit, system.joint_friction.f), end)
    if cut.h > SHORT * piece.dt:
        end = join_percussions(system, before, end)
    impacts = rest.impacts if hit is None else (hit, *rest.impacts)
    # forces at the end are those of its last part; where it only looks again nothing has happened
    of_rest = rest.solved_by is SolvedBy.CAPTURED or cut.kind is SolvedBy.START
    solved_by = rest.solved_by if of_rest else cut.kind
    parts = (*cut.parts, Moment(cut.kind, before, after, hit), *rest.parts)
    return StepResult(end, True, cut.n_iter + rest.n_iter, solved_by, rest.residual, impacts, parts=parts)


def halves(system: System, whole: StepResult, first: StepResult, second: StepResult) -> StepResult:
    """Two steps of half the length instead of the whole one, which has not converged."""
    n_iter = whole.n_iter + first.n_iter + second.n_iter
    end = join_percussions(system, first.state, second.state)
    impacts = (*first.impacts, without_impact(system, first.state), *second.impacts)
    parts = (*first.parts, *second.parts)
    return StepResult(end, second.converged, n_iter, SolvedBy.HALVED, second.residual, impacts, parts=parts)


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
