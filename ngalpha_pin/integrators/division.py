"""A step that is divided where something happens in it, and halved where it does not converge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.initialization.initial import resting_contacts
from ngalpha_pin.integrators.attempt import attempt
from ngalpha_pin.integrators.impact_splitting import cut_at_impact
from ngalpha_pin.integrators.joining import anew, behind, halves, joined, straight_rest
from ngalpha_pin.integrators.kinks import cut_at_kink, kinks
from ngalpha_pin.integrators.piece import Cut, Piece
from ngalpha_pin.integrators.release import cut_at_release
from ngalpha_pin.integrators.slip_splitting import (
    cut_at_end_of_slip,
    ending_slips,
    slipping,
    slips_that_may_end,
    smooth_steps,
)
from ngalpha_pin.step.contact_history import join_percussions
from ngalpha_pin.system.adhesion import lets_go, sticky
from ngalpha_pin.system.contact_search import has_rims
from ngalpha_pin.system.fast_turns import meet_on_the_way, without_false_closings
from ngalpha_pin.system.fly_past import first_fly_past
from ngalpha_pin.system.state import StepResult
from ngalpha_pin.system.system import System


def divided(piece: Piece, halvings: int, cuts: int, struck: bool = False) -> StepResult:
    """The step, divided where something happens in it and halved where it does not converge.

    Args:
        piece: the step.
        halvings: how often at most.
        cuts: how many at most.
        struck: an impact of the same step is behind. From there on ends of slip are not located: that both fall into
            one step gets rarer with dt, as the order of the method asks.
    """
    if len(piece.state.holding) and len(lets_go(piece.system, piece.state)):  # what acts has jumped
        piece = piece._replace(state=anew(piece.system, piece.state, piece.state.holding))
    whole, cut = _in_one_piece(piece, cuts > 0, struck)
    if whole.converged and len(whole.closing):
        whole = without_false_closings(piece.system, piece.state, whole)
    # only shorter steps see what lies in the way of shapes that turn far
    passed = whole.converged and not len(whole.closing) and meet_on_the_way(piece.system, piece.state, whole.state)
    # balls that have passed through each other: a step that ends where they are nearest sees that they meet
    watched = whole.converged and len(whole.state.near) > 0
    nearest = first_fly_past(piece.system, piece.state, whole.state) if watched else None
    if nearest is not None and (halvings > 0 or not len(whole.closing)):
        passed = True
    if whole.converged and cuts and not passed:
        cut = first_cut(piece, whole, struck)
    if cut is not None:
        after = behind(piece.system, cut)
        rest = straight_rest(piece, cut, after)
        if rest is None:
            remains = piece._replace(state=after, dt=piece.dt - cut.h)
            rest = divided(remains, halvings, cuts - 1, struck or cut.hit is not None)
        if rest.converged:
            return joined(piece, cut, after, rest)
        if not whole.converged:  # behind what was taken for the end of a slip nothing is found
            return divided(piece, halvings, cuts, struck=True)
    closing = whole.closing
    if whole.converged and cuts and len(closing):
        whole = attempt(piece)
    if not whole.converged and piece.parameters.auto and has_rims(piece.system):
        # a rim that comes down nearly flat: its lowest point runs too fast
        again = attempt(piece, follow_rims=False)
        whole = replace(again, n_iter=again.n_iter + whole.n_iter)
        # points fixed in a body can miss what the rim has met
        passed = passed or (again.converged and meet_on_the_way(piece.system, piece.state, again.state, closing))
    if passed:
        whole = replace(whole, converged=False)
    if whole.converged or halvings == 0:
        return _with_holds(piece.system, whole)
    return _parts(piece, whole, nearest, halvings, cuts)


def _parts(piece: Piece, whole: StepResult, nearest: float | None, halvings: int, cuts: int) -> StepResult:
    """The step in two parts, of half the length or up to where points are nearest that have flown past.

    Args:
        piece: the step.
        whole: the step in one piece, which does not do.
        nearest: part of the step, or None.
        halvings: how often at most.
        cuts: how many at most.
    """
    part = 0.5 if nearest is None else nearest
    first = divided(piece._replace(dt=part * piece.dt), halvings - 1, cuts)
    if not first.converged:
        return replace(whole, n_iter=whole.n_iter + first.n_iter)
    # an impact is what was looked for: behind it others can be found in the same way, as long as there are cuts
    found = len(first.impacts) if nearest is not None else 0
    second = piece._replace(state=first.state, dt=(1.0 - part) * piece.dt)
    rest = divided(second, halvings if found and cuts else halvings - 1, max(cuts - found, 0))
    return halves(piece.system, whole, first, rest)


def _in_one_piece(piece: Piece, divides: bool, struck: bool) -> tuple[StepResult, Cut | None]:
    """The step up to its first impact; and, where it is not smooth because a slip ends, where that is.

    A slip that ends in it or a little later may leave it without a solution in one piece, for which all solvers would
    be asked.
    """
    if divides and not struck and piece.parameters.auto and slipping(piece.system, piece.state):
        smooth = attempt(smooth_steps(piece), until_closing=True)
        slips = None if smooth.converged else slips_that_may_end(piece)
        cut = None if slips is None else cut_at_end_of_slip(piece, smooth, slips)
        if smooth.converged or cut is not None:
            return smooth, cut
    return attempt(piece, until_closing=divides), None


def first_cut(piece: Piece, whole: StepResult, struck: bool = False) -> Cut | None:
    """Where a step is divided; None where nothing happens in it, or where the moment is not found.

    Args:
        piece: the step.
        whole: the step in one piece, without the contacts that close in it.
        struck: see `divided`.
    """
    system, start, end = piece.system, piece.state, whole.state
    if len(whole.closing):
        return cut_at_impact(piece, whole)
    if len(end.holding) and len(lets_go(system, end)):
        return cut_at_release(piece, whole)
    slips = None if struck else ending_slips(system, start, end)
    if slips is not None:
        return cut_at_end_of_slip(piece, whole, slips)
    bent = kinks(system, start, end) if system.contacts.soft.any() else start.contacts[:0]
    return cut_at_kink(piece, whole, bent) if len(bent) else None


def _with_holds(system: System, result: StepResult) -> StepResult:
    """A step at whose end contacts begin to hold, or have let go in a step that was captured."""
    state = result.state
    if not system.contacts.adheres or not result.converged:
        return result
    new = np.setdiff1d(sticky(system, state.contacts[state.P_N > 0.0]), state.holding)
    if len(new):
        system.place(state.q)
        new = np.intersect1d(new, resting_contacts(system, state.q, state.v)[0].index)
    if not len(new) and not len(lets_go(system, state)):
        return result
    after = anew(system, state, np.union1d(state.holding, new))
    return replace(result, state=join_percussions(system, state, replace(after, whole=state.whole)))
