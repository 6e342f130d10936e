"""What the equations of one step are evaluated to."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from .contact_kinematics import Motion
from .contact_laws import ContactResidual
from .joint_friction import FrictionResidual
from .system import ContactRows, Dynamics


class Choice(NamedTuple):
    """How Newton treats friction: factors on the prox parameters of the contacts, shape (k,), whether with the laws of
    the paper, and a factor on the prox parameters of joint friction.

    A large factor keeps any slip, a small one keeps a contact sticking as long as its cone allows. Friction that acts
    from the moment of impact and follows the slip with its impulses alone can leave an impact with dependent
    directions, or a frictional catastrophe, without a solution; (80) and (112) have one.
    """

    factors: np.ndarray | None
    paper: bool
    joints: float = 1.0


class Evaluation:
    """R(x) and what it was computed from.

    Attributes:
        x: the iterate.
        q, v, dq: configuration, velocity and tangent step at the end of the step.
        dynamics: equations of motion there.
        R: residuals of a, U and Q, shape (3, nv).
        rows, contact: contact kinematics and laws, where the step has contacts.
        parts: the kinematics of contacts, joint friction and constraints, those that the step has.
        friction: laws of joint friction, where the scene has it.
        W: generalized force directions of all rows, transposed, shape (rows, nv).
        y, kinematic, law: kinematics of all multipliers, where they have to vanish, and the residual, shape (n,).
        z: forces of the contact laws (see `contact_laws`), shape (n_c,).
        ratio, share: kappa_hat_N / P_N and, where that ratio is free to move, P_F / P_N.
        error: largest scaled residual; the step has converged at <= 1.
    """

    x: np.ndarray
    q: np.ndarray
    v: np.ndarray
    dq: np.ndarray
    dynamics: Dynamics
    R: np.ndarray
    rows: ContactRows
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


class KinematicRows(Protocol):
    """Rows of one kind: of contacts, joint friction or constraints.

    Attributes:
        W: generalized force directions, transposed, shape (rows, nv).
        rate, acceleration: rates of position-level rows or velocity-level quantities, and their derivatives by time.
        sizes: of the positions and of the velocities that the rows subtract, whose rounding is felt [m], [m/s].
    """

    W: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray

    @property
    def sizes(self) -> tuple[float, float]:
        """See above."""

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each of the shape of W."""
