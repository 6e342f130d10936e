"""One step in one piece: solved with the contacts that carry force, until no other one closes in it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ngalpha_pin.integrators.native_attempt import native_attempt
from ngalpha_pin.integrators.parts import SmoothPart
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.integrators.restart import begin, ended
from ngalpha_pin.step.cascade import Solution, solve
from ngalpha_pin.step.contact_history import memory
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.fixed_point import percussions_alone
from ngalpha_pin.step.kinds import step_equations
from ngalpha_pin.step.linearised_round import prox_round
from ngalpha_pin.system.contact_search import ContactSearch
from ngalpha_pin.system.state import Auxiliary, State, StepResult


def attempt(
    piece: Piece, until_closing: bool = False, follow_rims: bool = True, features: State | None = None
) -> StepResult:
    """The step without halving: solve with the contacts that carry force, test the gaps of the others, repeat.

    Args:
        piece: the step.
        until_closing: leave out the contacts that meet an impact within the step or at its start, and name them.
        follow_rims: the lowest point of a rim moves around it in the step; otherwise it is fixed in the body.
        features: end of a longer step from the same start whose features of shapes are taken.
    """
    # among many, contacts that close without further impulses are unknowns from the beginning, and those whose
    # percussions have done all of the work of the step before
    many = piece.parameters.auto and piece.captures
    given, piece = piece.state, begin(piece, keep_open=many)
    parameters, system, state, dt = piece
    search = ContactSearch(system, state, dt, follow_rims, features)
    contacts, n_iter, fresh = state.contacts, 0, state.near[:0]
    if len(search.successors):
        contacts = np.union1d(contacts, search.successors)
    if features is not None and not many:  # what carries in the longer step
        contacts = np.union1d(contacts, features.contacts)
    known: tuple[StepEquations, Solution] | None = None
    foresees = many and not until_closing
    while True:
        # from the usual first iterate, see `_solve`
        usual = not many and (len(contacts) <= max(len(state.contacts), 1) or not parameters.auto)
        native = native_attempt(piece, contacts, search) if usual else None
        if native is not None:
            closing, motion, n = native.closing, native.motion, native.result.n_iter
        else:
            tried = _tried(piece, contacts, search, known, many, foresees)
            closing, motion, foresees = tried.closing, tried.motion, False
            if tried.solution is None:
                contacts = np.union1d(contacts, closing)
                continue
            known, n = (tried.equations, tried.solution), tried.solution.n_iter
        n_iter += n
        if until_closing and len(closing):
            fresh = search.hitting(closing)
            closing = np.setdiff1d(closing, fresh)
        if not len(closing):
            break
        # what is captured needs no choice
        contacts = np.union1d(contacts, closing) if many else _chosen(piece, contacts, closing)
    search.end(motion)
    if native is not None:
        end = replace(native.result.state, near=search.near, clearance=search.clearance, slots=system.slots.contents())
        return replace(native.result, state=ended(piece, end), n_iter=n_iter, closing=fresh)
    assert tried.solution is not None
    result = _result(given, tried.equations, tried.solution, search, n_iter, fresh)
    return replace(result, state=ended(piece, result.state))


class _Tried(NamedTuple):
    """The step as the cascade solves it with some contacts as unknowns.

    Attributes:
        equations: of the step.
        closing: numbers of the other contacts that close in it.
        motion: by how much it has moved gaps at most [m].
        solution: None where contacts that close at the first iterate already have to join it.
    """

    equations: StepEquations
    closing: np.ndarray
    motion: float
    solution: Solution | None


def _tried(
    piece: Piece,
    contacts: np.ndarray,
    search: ContactSearch,
    known: tuple[StepEquations, Solution] | None,
    many: bool,
    foresees: bool,
) -> _Tried:
    """Solve the step with some contacts as unknowns.

    Args:
        piece: the step, as `begin` has left it.
        contacts: numbers of the unknowns.
        search: of the step.
        known: the equations with some of the contacts and their solution, or None.
        many: impacts are captured.
        foresees: look which contacts close at the first iterate.
    """
    equations = _equations(piece, contacts)
    evaluation = equations.evaluate(equations.start())
    if foresees:
        closing = search.closing(contacts, evaluation.q)
        if len(closing):
            return _Tried(equations, closing, np.inf, None)
    solution = _solve(equations, evaluation, len(contacts) > len(piece.state.contacts), many, known)
    if not (piece.system.contacts.n and solution.converged):
        return _Tried(equations, contacts[:0], np.inf, solution)
    motion = equations.spent(solution.evaluation)
    search.reaches(motion)
    return _Tried(equations, search.closing(contacts, solution.evaluation.q), motion, solution)


def _equations(piece: Piece, contacts: np.ndarray) -> StepEquations:
    """The equations of the step with some contacts as unknowns."""
    parameters, system, state, dt = piece
    sub = system.contacts.subset(contacts)
    return step_equations(system, parameters, state, dt, sub, memory(system, state, contacts))


def _solve(
    equations: StepEquations,
    evaluation: Evaluation,
    more: bool,
    many: bool,
    known: tuple[StepEquations, Solution] | None,
) -> Solution:
    """Solve the step.

    Args:
        equations: of the step.
        evaluation: of the usual first iterate.
        more: contacts have closed that were open at the start.
        many: impacts are captured.
        known: the equations with some of the contacts and their solution, or None.
    """
    captures = many and more
    if captures and known is not None:  # the scales of the step are those of the usual start
        evaluation = equations.evaluate(*equations.start_from(known[0], known[1].evaluation))
    elif captures and percussions_alone(equations):
        evaluation = equations.evaluate(equations.start_from_percussions())
    elif more and not captures and equations.sub.k > 1 and equations.parameters.auto:
        # several contacts close at once: all of them closed would be a poor guess of the index sets
        evaluation = equations.evaluate(prox_round(equations, evaluation)[0])
    return solve(equations, evaluation, captures)


def _chosen(piece: Piece, contacts: np.ndarray, closing: np.ndarray) -> np.ndarray:
    """The contacts so far, and of those that could close those that carry a percussion when all of them are there.

    Many corners of a foot penetrate where one touches; as unknowns they would be nearly dependent directions.
    """
    candidates = np.union1d(contacts, closing)
    if len(closing) == 1 or not piece.parameters.auto:
        return candidates
    equations = _equations(piece, candidates)
    carries = prox_round(equations, equations.evaluate(equations.start()))[1].A
    chosen = np.union1d(contacts, candidates[carries])
    return chosen if len(chosen) > len(contacts) else candidates


def _result(
    given: State, equations: StepEquations, solution: Solution, search: ContactSearch, n_iter: int, fresh: np.ndarray
) -> StepResult:
    """What the step returns, with the part that it is made of."""
    state, found = _end(equations, solution.evaluation, search), solution.evaluation
    part = SmoothPart(given, equations.dt, state, equations.sub.index, found.x, found.options)
    return StepResult(state, solution.converged, n_iter, solution.solved_by, found.error, closing=fresh, parts=(part,))


def _end(equations: StepEquations, evaluation: Evaluation, search: ContactSearch) -> State:
    """The state at the end of the step; contacts that have let go of all force are forgotten."""
    sub, nv, k, m = equations.sub, equations.nv, equations.sub.k, equations.sub.m
    a, multipliers, layout = evaluation.x[:nv], evaluation.x[3 * nv :], equations.layout
    a_bar, la_bar, tau_f_bar = equations.bars(evaluation)
    others: dict[str, Any] = {"near": search.near, "clearance": search.clearance}
    others |= {"slots": equations.system.slots.contents(), "tau": equations.state.tau, "dt": equations.dt}
    others["holding"] = equations.state.holding
    if layout.f:
        others |= {"tau_f": multipliers[layout.friction_a], "P_f": evaluation.friction.P}
    if layout.kb + layout.mb:
        first = multipliers[layout.friction_a.stop :]
        La_b, la_b = np.split(first[layout.kb :], 2)
        others |= {"la_b": la_b, "La_b": La_b}
    motion = (equations.state.t + equations.dt, evaluation.q, evaluation.v, a)
    if k == 0:
        return State(*motion, memory=Auxiliary(a_bar, la_bar, la_bar, tau_f_bar), **others)
    keep = equations.keeps(evaluation)
    La, la, P = multipliers[k : 2 * k + m], multipliers[2 * k + m : layout.n_c], evaluation.z[k : 2 * k + m]
    N, F = sub.places if keep.all() else (np.flatnonzero(keep), k + np.flatnonzero(keep[sub.of_F]))
    memory = Auxiliary(a_bar, la_bar[N], la_bar[F], tau_f_bar)
    return State(*motion, sub.index[N], la[N], la[F], P[N], P[F], La[N], La[F], memory=memory, **others)
