"""Orders of convergence in numbers and in words, and the estimate of what a reference run itself is wrong by."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import TINY

SAFETY = 3.0  # errors below so many times the uncertainty of the reference are not used
ROUNDING = 1e-12  # errors below this part of the size of the motion are rounding
SECOND, FIRST, NONE = 1.75, 0.75, 0.25
NEAR_FIRST = 1.25


class Order(NamedTuple):
    """How errors fall with dt.

    Attributes:
        slope: of log(error) over log(dt), by least squares, or NaN where there is nothing to fit.
        words: what that means.
    """

    slope: float
    words: str

    def __str__(self) -> str:
        return self.words if np.isnan(self.slope) else f"{self.slope:.2f} ({self.words})"


def order(sizes: np.ndarray, errors: np.ndarray, size: float, uncertainty: float = 0.0) -> Order:
    """The order that errors show.

    Args:
        sizes: steps dt, shape (n,) [s].
        errors: shape (n,) [m]; NaN where a run failed.
        size: of the motion, the unit of rounding [m].
        uncertainty: of the reference [m].
    """
    sizes, errors = np.asarray(sizes, dtype=float), np.asarray(errors, dtype=float)
    ran = np.isfinite(errors)
    if not ran.any():
        return Order(np.nan, "no run came to its end")
    if (errors[ran] <= ROUNDING * size).all():
        return Order(np.nan, "exact to rounding at every dt")
    used = ran & (errors > SAFETY * uncertainty) & (errors > ROUNDING * size)
    if used.sum() < 2:
        return Order(np.nan, "not resolved: the errors are below what the reference can tell")
    slope = float(np.polyfit(np.log(sizes[used]), np.log(errors[used]), 1)[0])
    if slope >= SECOND:
        words = "second order" if slope < 2.5 else "higher than second order here"
    elif slope > NEAR_FIRST:
        words = "between first and second order"
    elif slope >= FIRST:
        words = "first order"
    else:
        words = "below first order" if slope > NONE else "the error does not fall over these dt"
    return Order(slope, words)


class Estimate(NamedTuple):
    """What the finest run is wrong by, from three runs whose steps halve.

    Attributes:
        uncertainty: of the finest run [m].
        order: that the three runs show, kept within 0.5 and 2.
        sound: the differences fall as an order between 0.5 and 3 says; otherwise the uncertainty is a guess.
    """

    uncertainty: float
    order: float
    sound: bool


def richardson(coarse_to_middle: float, middle_to_fine: float) -> Estimate:
    """Richardson's estimate of the error of the finest of three runs with steps 4 dt, 2 dt and dt.

    Args:
        coarse_to_middle: largest distance between the runs with 4 dt and 2 dt [m].
        middle_to_fine: between those with 2 dt and dt [m].
    """
    if middle_to_fine == 0.0:
        return Estimate(0.0, 2.0, True)
    observed = float(np.log2(max(coarse_to_middle, TINY) / middle_to_fine))
    used = float(np.clip(observed, 0.5, 2.0))
    return Estimate(middle_to_fine / (2.0**used - 1.0), used, 0.5 <= observed <= 3.0)
