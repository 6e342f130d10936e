"""With which of the laws a step is evaluated: one frozen value, handed to `evaluate` and kept by what it returns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from ngalpha_pin.contact.laws import IndexSets
from ngalpha_pin.contact.table import Subset

ALL_CHOICES = 4  # contacts for which every pattern of prox parameters is tried; with more, that of all of them
PREFER = 1e12  # factor on the prox parameter of a contact that prefers slip; zero prefers stick


@dataclass(frozen=True, eq=False, slots=True)
class LawOptions:
    """How the laws of one evaluation are read.

    A large factor on a prox parameter of friction keeps any slip, a small one keeps a contact sticking as long as its
    cone allows. Friction that acts from the moment of impact and follows the slip with its impulses alone can leave an
    impact with dependent directions, or a frictional catastrophe, without a solution; (80) and (112) have one. Where
    many contacts are closed, the friction of an impact at one of them may lift another one off whose friction it needs:
    without the displacement by frictional impulses within the step the gaps do not know of friction, and the levels are
    solved one by one. And where contacts slip in directions that are given, the forces between many of them may have no
    solution at all (Painleve's paradox); the percussions have one.

    Attributes:
        paper: (112) instead of the slip law of second order, and (80) for the displacement.
        displaces: frictional impulses move the bodies within the step already.
        accelerates: contacts have forces; otherwise percussions do all of their work in this step.
        factors: on the prox parameters of friction, shape (k,), or None.
        joints: factor on those of joint friction.
        sets: index sets of the contacts that are prescribed, or None where the prox functions find them.
        slack: see `ContactResidual`, or None.
        monotone: joints stick with no other percussions than those between slip one way and the other.
        held: which motors are taken to be at their upper (1) or lower (-1) effort limit, shape (nv,), or None where
            the torque that they are asked for says so.
    """

    paper: bool
    displaces: bool = True
    accelerates: bool = True
    factors: np.ndarray | None = None
    joints: float = 1.0
    sets: IndexSets | None = None
    slack: np.ndarray | None = None
    monotone: bool = False
    held: np.ndarray | None = None


SECOND_ORDER, PAPER = LawOptions(paper=False), LawOptions(paper=True)
"""The two laws as they are by default."""


def other_prox_parameters(sub: Subset, with_joints: bool, paper: bool) -> Iterator[LawOptions]:
    """Prox parameters of friction to try where the usual ones do not lead to a solution.

    Any r > 0 has the same solutions, but not the same way there: with dependent directions r decides which contact
    gives up sticking where not all of them can stick; in a frictional catastrophe, which contact stops slipping.

    Args:
        sub: contacts that are unknowns.
        with_joints: some joint has dry friction.
        paper: with the slip law (112).
    """
    if with_joints:
        yield LawOptions(paper, joints=PREFER)
    with_friction = np.unique(sub.of_F)
    n = len(with_friction)
    if n == 0:
        return
    patterns = np.ones((1, n), dtype=bool)
    if n <= ALL_CHOICES:
        patterns = np.array(sorted(product((False, True), repeat=n), key=sum)[1:]).reshape(-1, n)
    for factor in (PREFER, 0.0):
        for pattern in patterns:
            factors = np.ones(sub.k)
            factors[with_friction[pattern]] = factor
            yield LawOptions(paper, factors=factors)
