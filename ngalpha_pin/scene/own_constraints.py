"""Declarations of constraints from functions of the user's own, on position and on velocity level."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.scene.constraints import named
from ngalpha_pin.scene.protocols import Declared
from ngalpha_pin.scene.user_function import array_of, called


class UserConstraint:
    """A constraint from a function of the user's own, whose derivatives are found by differences.

    Args:
        function: smooth; returns shape (n,) or a number.
        name: by default the name of the function.
        step: displacement of the differences [rad or m], small against the lengths over which the function bends.
    """

    def __init__(self, function: Callable[..., Any], name: str | None = None, step: float = 2e-3):
        kind = type(self).__name__
        self.name = named(name, f"{kind} {getattr(function, '__name__', 'of a function')}")
        self.function = checks.function(f"{self.name}: function", function, "that returns a number or shape (n,)")
        self.step = checks.number(f"{self.name}: step", step, 0.0, above=True)
        self.n: int | None = None

    def check(self, scene: Declared) -> None:
        """The function can be called; at the neutral configuration its value may be singular, its shape counts."""
        model, nowhere = scene.model, np.full(1, np.nan)
        with np.errstate(all="ignore"):
            given = self.call(0.0, pin.neutral(model), np.zeros(model.nv))
        self.n = len(array_of(self.name, given, 0.0, None, nowhere))

    def value(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """What has to vanish, shape (n,).

        Raises:
            SceneError: the function fails, the shape is another one than before, or the value is not finite.
        """
        return array_of(self.name, self.call(t, q, v), t, None if self.n is None else (self.n,), q, v)

    def call(self, t: float, q: np.ndarray, v: np.ndarray) -> Any:
        """The function itself."""
        return called(self.name, self.function, t, q, v)


class PositionConstraint(UserConstraint):
    """g(t, q) = 0 on position level, with q of shape (nq,).

    Attributes:
        row: its derivative by v where that is the same everywhere, shape (nv,), for which no differences are taken.
    """

    row: np.ndarray | None = None

    def call(self, t: float, q: np.ndarray, v: np.ndarray) -> Any:
        """The function itself."""
        return called(self.name, self.function, t, q)


class VelocityConstraint(UserConstraint):
    """gamma(t, q, v) = 0 on velocity level, affine in v of shape (nv,)."""
