"""The motion within a step of an integrator, interpolated only where something is looked for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import DOP853, Radau

from ngalpha_pin.event_driven.smooth_phase import SmoothPhase

# stages of DOP853, of twelve, at which signs are looked at: 0.12, 0.33, 0.6 and 0.86 of a step; an implicit step is
# looked at in as many places
STAGES = (3, 5, 9, 10)
# accelerations within an implicit step, in units of those at its ends
BETWEEN = 2.0


class DenseStep:
    """The last step of an integrator.

    Args:
        solver: after the step.
        phase: what it integrates.
        v, a: velocities and accelerations at its beginning and its end, shape (2, nv) each.

    Attributes:
        t_0, t_1: its beginning and its end [s].
        fastest: bound of the velocities within it, from those at its ends and the accelerations between, shape (nv,).
    """

    def __init__(self, solver: DOP853 | Radau, phase: SmoothPhase, v: np.ndarray, a: np.ndarray):
        self._solver, self._phase = solver, phase
        self.t_0, self.t_1, self._y_1 = solver.t_old, solver.t, solver.y
        stages = BETWEEN * a if isinstance(solver, Radau) else solver.K[:, phase.nq : phase.nq + phase.nv]
        self.fastest = np.abs(v).max(axis=0) + 0.5 * (self.t_1 - self.t_0) * np.abs(stages).max(axis=0)
        self._stages = [] if isinstance(solver, Radau) else [phase.calls[stage - 1] for stage in STAGES]
        self._output: Callable[[float], np.ndarray] | None = None

    def y(self, t: float) -> np.ndarray:
        """Q, v and integrals at a time."""
        if t == self.t_1:
            return self._y_1
        if self._output is None:
            self._output = self._solver.dense_output()
        return self._output(t)

    def __call__(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Q and v at a time."""
        return self._phase.split(self.y(t))

    def signs(self, t: float) -> np.ndarray:
        """The signs that end the phase, at a time."""
        q, v = self(t)
        return self._phase.signs(self._phase.forces(t, q, v), v)

    def inner_signs(self) -> list[tuple[float, np.ndarray]]:
        """Times between both ends, with the signs there: of an explicit step nearly, as its stages give them."""
        if self._stages:
            return [(t, self._phase.signs(forces, v)) for t, v, forces in self._stages]
        times = np.linspace(self.t_0, self.t_1, len(STAGES) + 2)[1:-1]
        return [(t, self.signs(t)) for t in times.tolist()]
