"""One step in one piece, solved by the compiled engine with given contacts; what it cannot is left to the cascade."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.contact.table import Subset
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.integrators.plain_steps import numbers_of, patience, plain_of, results
from ngalpha_pin.step.contact_history import memory
from ngalpha_pin.step.fixed_point import RUNS_AWAY
from ngalpha_pin.system.contact_search import ContactSearch
from ngalpha_pin.system.regime import COMPILED, Regime
from ngalpha_pin.system.state import StepResult
from ngalpha_pin.system.system import System


class Solved(NamedTuple):
    """A step that Newton's method has solved.

    Attributes:
        result: with a state whose `near` and `clearance` are those of its start.
        closing: numbers of the other contacts that close in it, increasing.
        motion: by how much it has moved gaps at most [m].
    """

    result: StepResult
    closing: np.ndarray
    motion: float


def native_attempt(piece: Piece, contacts: np.ndarray, search: ContactSearch) -> Solved | None:
    """The step as `attempt` solves it from its usual first iterate; None where it has to do that itself.

    Args:
        piece: the step, as `begin` has left it.
        contacts: numbers of the unknowns, those of the state among them.
        search: of the step.
    """
    parameters, system, state, dt = piece
    plain, table = plain_of(system), system.contacts
    sub = table.subset(contacts)
    if plain is None or parameters.solver == "fixed_point" or not _knows(system, sub):
        return None
    near = table.subset(search.near)
    if len(near.own):
        return None
    is_open = ~np.isin(near.index, contacts)
    regime = Regime(sub.k, joints=system.joint_friction.f)
    bar = state.auxiliary
    found = plain.engine.attempt(
        plain.number(system, sub),
        plain.number(system, near) if is_open.any() and not len(near.slots) else -1,
        is_open.tolist(),
        numbers_of(piece),
        patience(parameters, regime),
        RUNS_AWAY if parameters.auto and regime.crowded else np.inf,
        sub.bounces,
        plain.forces.loads(system, state.actuation),
        plain.follows(system),
        state.t,
        *(state.q, state.v, state.a, bar.a_bar),
        *memory(system, state, contacts),
        *(state.tau_f, bar.tau_f_bar, state.la_b),
    )
    if found is None:
        return None
    record, closing, gaps, motion = found
    if table.n and not search.clearance > motion:  # more than foreseen
        return None
    result = results(system, sub, state, dt, record)[0]
    if len(near.slots):
        system.place(result.state.q)
        closing = search.closing(contacts, result.state.q)
    else:
        closing = search.found(near.index[closing], gaps, result.state.q)
    return Solved(result, closing, motion)


def _knows(system: System, sub: Subset) -> bool:
    """The engine knows such contacts: points on surfaces that rest, and limits."""
    other = len(sub.slots) or len(sub.own) or system.contacts.adheres
    return sub.plain and not other and sub.k <= COMPILED
