"""What a run of chosen accuracy is asked for, checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError

# the least error that can be asked for: solvers get a smaller share of it, which has to stay above rounding; and the
# shortest step, in parts of the run, whose sum over all steps rounding does not feel
LEAST, SHORTEST = 1e-12, 1e-9


@dataclass(frozen=True)
class Accuracy:
    """What a run of chosen accuracy is asked for.

    Attributes:
        rtol, atol: allowed error, relative to the size of a coordinate [-] and absolute [SI].
        max_step, min_step: bounds of the steps [s]; events that are closer than `min_step` are captured.
    """

    rtol: float
    atol: float
    max_step: float
    min_step: float


def checked_accuracy(
    rtol: float, atol: float | None, max_step: float, min_step: float | None, duration: float
) -> Accuracy:
    """What the user asks for, with its defaults.

    Raises:
        SceneError: a number that cannot be used.
    """
    rtol = checks.number("rtol", rtol, LEAST, 0.999)
    # of zero, it could not be met where a coordinate vanishes
    atol = rtol if atol is None else checks.number("atol", atol, 0.0, above=True)
    max_step = (
        np.inf
        if isinstance(max_step, float) and max_step == np.inf
        else checks.number("max_step", max_step, 0.0, above=True, unit="seconds")
    )
    if min_step is not None:
        min_step = checks.number("min_step", min_step, 0.0, above=True, unit="seconds")
    min_step = min(SHORTEST * duration, max_step) if min_step is None else min_step
    if not 0.0 < min_step <= max_step:
        raise SceneError(f"min_step = {min_step} must be positive and at most max_step = {max_step}")
    return Accuracy(float(rtol), float(atol), float(max_step), float(min_step))


def checked_times(t_eval: Sequence[float] | np.ndarray | None, start: float, t_end: float) -> np.ndarray | None:
    """The times to record.

    Raises:
        SceneError: they do not increase, or leave the run.
    """
    if t_eval is None:
        return None
    times = checks.array("t_eval", t_eval, (None,))
    if not len(times) or (np.diff(times) <= 0).any():
        raise SceneError("t_eval must be increasing finite times")
    if times[0] < start or times[-1] > t_end:
        raise SceneError(f"t_eval goes from {times[0]:g} to {times[-1]:g} s, outside of [{start:g}, {t_end:g}]")
    return times
