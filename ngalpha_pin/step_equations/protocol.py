"""The equations of one step, as their Newton matrix, their scales and the solvers see them."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ngalpha_pin.contact.blocked_tangents import Immovable
from ngalpha_pin.contact.row_layout import Layout
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.linalg.block_matrix import Matrix
from ngalpha_pin.step_equations.evaluation import Evaluation
from ngalpha_pin.step_equations.parameters import Parameters
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System


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

    def tangent(self, ev: Evaluation) -> Matrix | None:
        """T = d q1 / d dq; None stands for the identity."""

    @property
    def row_scale(self) -> np.ndarray:
        """Factors that make the rows of the Newton matrix comparable, shape (n,)."""

    @property
    def column_scale(self) -> np.ndarray:
        """The same of its columns, shape (n,)."""
