"""One round of the fixed-point iterations for contacts of many bodies: see `linearised_round`, without matrices G.

Its contact problems are solved by the engine, in the coordinates of the trees, from the forces of the last round.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import CONE, STILL, TINY
from ngalpha_pin.contact.laws import IndexSets
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.contact.tree_problem import TreeProblem
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.sparse import CrowdEquations

# part of the tolerance of the step that a problem may leave where the result counts as it is
LEFT = 0.1
# friction that is held back at first, how often more contacts may turn out to slip with that, and the slip velocity
# that is none, in parts of the largest velocity, where the problem is not solved (`STILL` where it is)
HELD_BACK, HELD_ROUNDS, STILL_ROUGHLY = 0.98, 4, 1e-4


class _Level(NamedTuple):
    """Velocities or accelerations: y = b + G P, from which forces to go on, and how well they have to fit."""

    problem: TreeProblem
    b: np.ndarray
    guess: np.ndarray
    tolerance: float

    @classmethod
    def at(cls, problem: TreeProblem, y: np.ndarray, P: np.ndarray, tolerance: float) -> _Level:
        """The level where forces P make kinematics y."""
        return cls(problem, y - problem.response(P), P, tolerance)

    def moves(self, sub: Subset, P: np.ndarray, still: float = STILL) -> np.ndarray:
        """Contacts that slip, or start to, by more than a part of the largest velocity, shape (k,)."""
        largest = max(float(np.abs(self.b).max(initial=0.0)), TINY)
        return _sizes(sub, self.slip(sub, P)) > still * largest

    def slip(self, sub: Subset, P: np.ndarray) -> np.ndarray:
        """Slip velocities, shape (m,)."""
        return (self.b + self.problem.response(P))[sub.k :]


def crowd_round(equations: CrowdEquations, evaluation: Evaluation) -> tuple[np.ndarray, IndexSets]:
    """Multipliers from the three contact problems, then a, U and Q that go with them.

    Args:
        equations: of the step.
        evaluation: of the last iterate.

    Returns:
        The next iterate, and the index sets of the three problems.
    """
    sub, layout, laws = equations.sub, equations.layout, evaluation.options
    k, o = sub.k, sub.of_F
    # what the residuals of a, U and Q do to gaps, velocities and accelerations
    y = evaluation.y + equations.response(evaluation)
    kappa, P, la = equations.row_forces(evaluation)
    free, held = equations.problems(evaluation)
    tolerance = LEFT * equations.parameters.tol
    velocities = _Level.at(held, y[layout.at_v], P, tolerance)
    accelerations = _Level.at(held, y[layout.at_a], la, tolerance)
    whole = laws.slack is not None  # index sets are not asked for, so that no friction is held back
    slipped, slipped_a = ((x[:k] > 0.0) & at_bound(sub, x) | whole for x in (P, la))
    gaps = np.concatenate((y[layout.at_g], np.zeros(sub.m))) - free.response(kappa)
    every, share = np.ones(k, dtype=bool), np.zeros(sub.m)
    # friction shifts the gaps, and only contacts that close have friction
    for _ in range(2 if laws.displaces else 1):
        if laws.displaces:
            touches = kappa[:k] > 0.0 if kappa[:k].any() else gaps[:k] <= 0.0
            P_c = _forces(velocities, sub, touches, slipped)  # (131), (137)
            share = _shares(sub, P_c) * ~equations.carried[o] if not laws.paper else share
        kappa = free.solve(gaps, np.ones(k), every, kappa, tolerance, every, share)[0]  # (128)
    touches = kappa[:k] > 0.0
    if whole:  # of the corners of a face some carry it, and the others touch as well
        touches |= (gaps + free.response(kappa))[:k] <= equations.gap_tolerance
    if not laws.displaces:
        P_c = _forces(velocities, sub, touches, slipped)
    closed = P_c[:k] > 0.0
    on_cone = closed & at_bound(sub, P_c)
    slip = np.where(on_cone[o], velocities.slip(sub, P_c), 0.0)
    la_c = _forces(accelerations, sub, closed & laws.accelerates, slipped_a, slip)  # (134), (140)
    pulls = la_c[:k] > 0.0
    stick = closed & ~(on_cone & velocities.moves(sub, P_c))
    stick_a = stick & pulls & ~(at_bound(sub, la_c) & accelerations.moves(sub, la_c))
    sets = IndexSets(touches | closed, closed, pulls, stick, stick_a)
    return equations.with_forces(evaluation, kappa, P_c, la_c), sets


def _shares(sub: Subset, P: np.ndarray) -> np.ndarray:
    """kappa_hat_F / kappa_hat_N = P_F / P_N, shape (m,)."""
    carries = P[: sub.k] > 0.0
    return np.where(carries, 1.0 / np.where(carries, P[: sub.k], 1.0), 0.0)[sub.of_F] * P[sub.k :]


def _sizes(sub: Subset, y: np.ndarray) -> np.ndarray:
    """Norms of the friction rows of each contact, shape (k,)."""
    return np.sqrt(np.bincount(sub.of_F, y * y, sub.k))


def at_bound(sub: Subset, P: np.ndarray) -> np.ndarray:
    """Cones on whose edge friction is, shape (c,)."""
    cones = sub.cones
    return np.asarray(cones.sizes(P[sub.k : sub.k + sub.m]) >= cones.mu * P[: sub.k][cones.contact] * (1 - CONE))


def _forces(
    level: _Level, sub: Subset, touches: np.ndarray, slipped: np.ndarray, slip: np.ndarray | None = None
) -> np.ndarray:
    """Percussions from velocities, or forces from accelerations with friction against a slip that is given.

    Where directions are dependent, a solution may be at the edge of the friction cones although forces inside of them
    do as well, and rounding would decide between stick and slip. With a little less friction such contacts end inside;
    those that slip with that, or are known to have slipped, get all of it. All do where index sets are not asked for.
    """
    P, slips, tied, direction = level.guess, slipped, None, None
    if slip is not None:
        speed = _sizes(sub, slip)
        tied = speed > 0.0
        direction = -slip / np.where(tied, speed, 1.0)[sub.of_F]
        slips = slipped | tied
    for _ in range(HELD_ROUNDS):
        mu = np.where(slips, sub.mu, HELD_BACK * sub.mu)
        P, solved = level.problem.solve(level.b, mu, touches, P, level.tolerance, tied, direction)
        if slips.all():
            break
        moves = touches & (P[: sub.k] > 0.0) & level.moves(sub, P, STILL if solved else STILL_ROUGHLY)
        if not (moves & ~slips & (sub.mu > 0.0)).any():
            break
        slips = slips | moves
    return P
