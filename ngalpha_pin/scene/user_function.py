"""Functions of the user's own: what they return is checked, and an error names whose function it was."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ngalpha_pin.errors import SceneError

# steps of the differences of such functions: by time [s], and by a value [rad, m or m/s, or parts of the size of a
# state]
TIME_STEP, DIFFERENCE = 1e-3, 1e-6


def called(name: str, function: Callable[..., Any], t: float, *where: Any) -> Any:
    """What function(t, *where) gives.

    Raises:
        SceneError: it fails; the exception of the function is the cause.
    """
    try:
        return function(t, *where)
    except SceneError:
        raise
    except Exception as error:
        raise SceneError(f"{name}: the function failed at t = {t:g} with {error!r}") from error


def check_pure(name: str, function: Callable[..., Any], t: float, *where: np.ndarray) -> None:
    """A control is evaluated any number of times in a step, also at motions and times that it does not come to.

    Raises:
        SceneError: two calls with the same arguments give two things; one of them fails.
    """
    with np.errstate(all="ignore"):  # it may be singular there
        first, second = (np.array(called(name, function, t, *(x.copy() for x in where)), dtype=float) for _ in range(2))
    if first.shape != second.shape or not np.array_equal(first, second, equal_nan=True):
        raise SceneError(
            f"{name}: two calls with the same (t, q, v) give {first.tolist()} and {second.tolist()}; a control is "
            "called any number of times in a step and must depend on its arguments alone: a law with a memory, a "
            "filter or noise is a SampledControl"
        )


def array_of(name: str, given: Any, t: float, shape: tuple[int, ...] | None, *where: np.ndarray) -> np.ndarray:
    """What a function gave, as a finite array of that shape; None is any shape (n,), and a number is (1,).

    At a q or v that is not finite, where an iterate has run away, the value is not looked at: the step is repeated.

    Raises:
        SceneError: it is something else.
    """
    try:
        value = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        value = np.full((1, 1, 1), np.nan)
    value = value[None] if shape in (None, (1,)) and value.ndim == 0 else value
    fits = value.ndim == 1 if shape is None else value.shape == shape
    if fits and (np.isfinite(value).all() or not all(np.isfinite(x).all() for x in where)):
        return value
    wanted = "one dimension" if shape is None else f"shape {shape}"
    raise SceneError(f"{name}: got {given!r} at t = {t:g}; it must be finite with {wanted}")
