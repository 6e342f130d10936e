"""The equations of one step, as their Newton matrix, their scales and the solvers see them."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from ngalpha_pin.contact.blocked_tangents import Immovable
from ngalpha_pin.contact.row_layout import Layout
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.numerics.block_matrix import Matrix
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System


class Scales(NamedTuple):
    """Fixed in a step at its first evaluation.

    Attributes:
        by_dof: what the residuals of a, U and Q are multiplied with, shape (3, nv), or (nv,) without multipliers.
        kinematic, direct: what the laws are multiplied with where kinematics vanish, and where forces do, shape (n,).
        r: prox parameters, shape (n,) [kg].
        force: typical force of each contact, shape (k,) [N].
        row, column: scales of the Newton matrix, shape (n,) each.
    """

    by_dof: np.ndarray
    kinematic: np.ndarray
    direct: np.ndarray
    r: np.ndarray
    force: np.ndarray
    row: np.ndarray
    column: np.ndarray


class Equations(Protocol):
    """R(x) of one step: what stays the same in all of its evaluations.

    Attributes:
        system: compiled scene.
        parameters: of the method.
        state: start of the step.
        dt: step [s].
        sub: contacts that are unknowns.
        layout: where their rows and multipliers stand.
        nv, n: number of velocities and of multipliers.
        gamma_c, beta_c: derivatives of v and dq by a at the end of the step [s], [s^2].
        immovable: tangents along which nothing moves in this step, or None.
    """

    system: System
    parameters: Parameters
    state: State
    dt: float
    sub: Subset
    layout: Layout
    nv: int
    n: int
    gamma_c: float
    beta_c: float
    immovable: Immovable | None
    _z_known: np.ndarray

    def linearise(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """See `newton_matrix.linearise`."""

    @property
    def carried(self) -> np.ndarray:
        """Contacts with a force at the start, shape (k,)."""

    def tangent(self, ev: Evaluation) -> Matrix | None:
        """T = d q1 / d dq; None stands for the identity."""

    @property
    def scales(self) -> Scales:
        """Of the step, after its first evaluation."""
