"""Which integrator a smooth phase is given to: DOP853, or Radau where friction or a beam makes it stiff.

A slip in space turns into the direction of its friction at the rate mu la_N / (m |slip|), which has no bound where it
begins. An explicit step is limited by this rate, not by the accuracy, for as long as the slip is slow. Across the long
axis of an ellipse it turns faster by the square of the ratio of the axes, so that such a slip begins with Radau.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853, Radau

from ngalpha_pin.event_driven.smooth_phase import SmoothPhase
from ngalpha_pin.event_driven.tolerances import Accuracy

# step in units of the time in which a slip turns: explicit steps above it, and implicit steps below it, are exchanged
STIFF, MILD = 3.0, 1.0
# explicit steps above it before they are exchanged: forces that run away are stiff for a moment
PATIENCE = 4
# the first implicit steps are short: the explicit ones come back when the rate has fallen to this part
FALLEN = 0.03
# allowed error of the integrals of the forces, which are not controlled
ANY = 1e6
# relative tolerance of a step that its rounding does not reach
FINEST = 1e-13
# the local errors of a run add up: each is kept below this part of the tolerance; the implicit integrator estimates
# them by a method of third order beside its own, which is far more exact
SHARE, IMPLICIT_SHARE = 0.005, 0.2


def phase_solver(
    phase: SmoothPhase,
    t: float,
    y: np.ndarray,
    t_end: float,
    accuracy: Accuracy,
    first: float | None = None,
    stiff: bool = False,
) -> DOP853 | Radau:
    """The integrator of a phase from (t, y) on.

    Args:
        phase: gives the right-hand side.
        t: time [s].
        y: see `SmoothPhase.start`.
        t_end: end of the run [s].
        accuracy: what is asked for.
        first: first step [s]; None lets the integrator choose.
        stiff: take the implicit one.
    """
    stiff = stiff or has_waves(phase)
    share = IMPLICIT_SHARE if stiff else SHARE
    atol = np.full(len(y), share * accuracy.atol)
    atol[phase.nq + phase.nv :] = ANY
    first = None if first is None else min(first, t_end - t, accuracy.max_step)
    rtol = max(share * accuracy.rtol, FINEST)
    kind = Radau if stiff else DOP853
    return kind(phase.rate, t, y, t_end, max_step=accuracy.max_step, first_step=first, rtol=rtol, atol=atol)


def has_waves(phase: SmoothPhase) -> bool:
    """There are flexible bodies, whose fast waves limit explicit steps for as long as the run takes."""
    return phase.system.beams is not None or bool(phase.system.scene.strands)


class Exchange:
    """Watches the steps of a phase and exchanges its integrator.

    Args:
        phase: what is integrated.
        t_end: end of the run [s].
        accuracy: what is asked for.
    """

    def __init__(self, phase: SmoothPhase, t_end: float, accuracy: Accuracy):
        self._phase, self._t_end, self._accuracy = phase, t_end, accuracy
        # rate when the implicit integrator was taken
        self._rate, self._stiff_steps = phase.turning_rate() if phase.begins_stiff else 0.0, 0

    def after(self, solver: DOP853 | Radau) -> DOP853 | Radau:
        """The integrator for what comes after its last step."""
        implicit, h, rate = isinstance(solver, Radau), solver.t - solver.t_old, self._phase.turning_rate()
        if implicit:
            stiff = rate * h > MILD or rate > FALLEN * self._rate or has_waves(self._phase)
        else:
            self._stiff_steps = self._stiff_steps + 1 if rate * h > STIFF else 0
            stiff, self._rate = self._stiff_steps > PATIENCE, rate
        if stiff == implicit:
            return solver
        self._stiff_steps = 0
        return phase_solver(self._phase, solver.t, solver.y, self._t_end, self._accuracy, h, stiff)
