"""Declaration of an own unilateral constraint: a gap and, if wanted, slip velocities, as functions of the user."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.constraints import named
from ngalpha_pin.scene.own_constraints import PositionConstraint, VelocityConstraint
from ngalpha_pin.scene.protocols import Declared


class UnilateralConstraint:
    """g(t, q) >= 0, as a contact: a force that pushes where the gap is closed, with restitution and friction.

    Args:
        gap: of (t, q), smooth, returns a number; its force is along the derivative by q, so that it is newtons where
            the gap is metres.
        e_N: restitution coefficient [-], in [0, 1].
        mu: friction coefficient [-], with `slip`.
        slip: of (t, q, v), affine in v, returns the slip velocity, a number or shape (2,) [m/s]; None is no friction.
        name: by default the name of the function.
        step: displacement of the differences [rad or m], see `PositionConstraint`.
    """

    by_names = False  # its functions are of all coordinates, which are others where models are put together

    def __init__(
        self,
        gap: Callable[[float, np.ndarray], Any],
        e_N: float = 0.0,
        mu: float = 0.0,
        slip: Callable[[float, np.ndarray, np.ndarray], Any] | None = None,
        name: str | None = None,
        step: float = 2e-3,
    ):
        self.name = named(name, f"UnilateralConstraint {getattr(gap, '__name__', 'of a function')}")
        self.gap = PositionConstraint(gap, f"{self.name}: gap", step)
        self.e_N = checks.number(f"{self.name}: e_N", e_N, 0.0, 1.0)
        self.mu = checks.number(f"{self.name}: mu", mu, 0.0)
        self.slip = None if slip is None else VelocityConstraint(slip, f"{self.name}: slip", step)
        if (slip is None) != (self.mu == 0.0):
            raise SceneError(f"{self.name}: friction needs both, mu and slip")

    def check(self, scene: Declared) -> None:
        """The functions can be called, and have the right shapes."""
        self.gap.check(scene)
        if self.gap.n != 1:
            raise SceneError(f"{self.name}: gap gave {self.gap.n} numbers; expected one")
        if self.slip is not None:
            self.slip.check(scene)
            if self.slip.n not in (1, 2):
                raise SceneError(f"{self.name}: slip gave {self.slip.n} numbers; expected one or two")

    @property
    def n_F(self) -> int:
        """Number of friction rows."""
        return 0 if self.slip is None else int(self.slip.n or 0)

    @property
    def stands_in(self) -> bool:
        """It is one whose functions have stayed behind, as in a scene from a file."""
        return self.gap.function is touching

    @classmethod
    def standing_in(cls, name: str, e_N: float, mu: float, n_F: int) -> UnilateralConstraint:
        """One without its functions, which touches all the time and in whose direction nothing moves."""

        def slip(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
            return np.zeros(n_F)

        return cls(touching, e_N, mu, slip if n_F else None, name)


def touching(t: float, q: np.ndarray) -> float:
    """The gap of a constraint whose own function is not known."""
    return 0.0
