"""What the equations of one step are evaluated to."""

from __future__ import annotations

import numpy as np

from ngalpha_pin.contact.joint_friction import FrictionResidual
from ngalpha_pin.contact.laws import ContactResidual
from ngalpha_pin.contact.point_rows import KinematicRows
from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.system.system import Dynamics


class Evaluation:
    """R(x) and what it was computed from.

    Attributes:
        x: the iterate.
        options: the laws it was evaluated with.
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
    options: LawOptions
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
