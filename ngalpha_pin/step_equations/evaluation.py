"""What the equations of one step are evaluated to."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from ngalpha_pin.contact.joint_friction import FrictionResidual
from ngalpha_pin.contact.laws import ContactResidual
from ngalpha_pin.contact.point_rows import KinematicRows
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.system.system import Dynamics

ALL_CHOICES = 4  # contacts for which every pattern of prox parameters is tried; with more, that of all of them
PREFER = 1e12  # factor on the prox parameter of a contact that prefers slip; zero prefers stick


class Choice(NamedTuple):
    """How Newton treats friction: factors on the prox parameters, shape (k,), and with which of the laws.

    A large factor keeps any slip, a small one keeps a contact sticking as long as its cone allows. Friction that acts
    from the moment of impact and follows the slip with its impulses alone can leave an impact with dependent
    directions, or a frictional catastrophe, without a solution; (80) and (112) have one. Where many contacts are
    closed, the friction of an impact at one of them may lift another one off whose friction it needs: without the
    displacement by frictional impulses within the step the gaps do not know of friction, and the levels are solved one
    by one. And where contacts slip in directions that are given, the forces between many of them may have no solution
    at all (Painleve's paradox); the percussions have one.

    Attributes:
        factors: on the prox parameters of friction, or None.
        joints: factor on those of joint friction.
        paper: (112) instead of the slip law of second order, and (80) for the displacement.
        displaces: frictional impulses move the bodies within the step already.
        accelerates: contacts have forces; otherwise percussions do all of their work in this step.
    """

    factors: np.ndarray | None
    paper: bool
    displaces: bool = True
    joints: float = 1.0
    accelerates: bool = True


def choices(sub: Subset, with_joints: bool, paper: bool) -> Iterator[Choice]:
    """Prox parameters of friction to try where the usual ones do not lead to a solution.

    Any r > 0 has the same solutions, but not the same way there: with dependent directions r decides which contact
    gives up sticking where not all of them can stick; in a frictional catastrophe, which contact stops slipping.

    Args:
        sub: contacts that are unknowns.
        with_joints: some joint has dry friction.
        paper: with the slip law (112).
    """
    if with_joints:
        yield Choice(None, paper, joints=PREFER)
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
            yield Choice(factors, paper)


class Evaluation:
    """R(x) and what it was computed from.

    Attributes:
        x: the iterate.
        q, v, dq: configuration, velocity and tangent step at the end of the step.
        dynamics: equations of motion there.
        R: residuals of a, U and Q, shape (3, nv).
        contact: laws of the contacts, where the step has any.
        parts: the kinematics of contacts, joint friction and constraints, those that the step has.
        friction: laws of joint friction, where the scene has it.
        W: generalized force directions of all rows, transposed, shape (rows, nv).
        y, kinematic, law: kinematics of all multipliers, where they have to vanish, and the residual, shape (n,).
        z: forces of the contact laws (see `contact.laws`), shape (n_c,).
        ratio, share: kappa_hat_N / P_N and, where that ratio is free to move, P_F / P_N.
        error: largest scaled residual; the step has converged at <= 1.
    """

    x: np.ndarray
    q: np.ndarray
    v: np.ndarray
    dq: np.ndarray
    dynamics: Dynamics
    R: np.ndarray
    parts: list[KinematicRows]
    contact: ContactResidual
    friction: FrictionResidual
    W: np.ndarray
    y: np.ndarray
    kinematic: np.ndarray
    law: np.ndarray
    z: np.ndarray
    ratio: np.ndarray
    share: np.ndarray
    error: float

    def index_sets(self) -> bytes:
        """Something that is equal where all index sets are."""
        return self.kinematic.tobytes()
