"""How much a contact gives back: Newton's, Poisson's or Stronge's coefficient, which may depend on the approach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError

LAWS = ("newton", "poisson", "stronge")
# speeds of approach at which a function is looked at and written down [m/s]
SPEEDS = np.concatenate(([0.0], np.geomspace(1e-6, 1e3, 1000)))


@dataclass(frozen=True)
class Restitution:
    """The coefficient of restitution of the normal direction, and what it is the ratio of.

    Attributes:
        e: a number in [0, 1], or a function of the speed of approach v >= 0 [m/s] that returns one [-].
        law: "newton": normal velocity after the impact by that before it (44). "poisson": percussion of expansion by
            that of compression. "stronge": the square is the work of expansion by that of compression. The last two
            follow friction through the impact and never add energy.
    """

    e: float | Callable[[float], float]
    law: str = "newton"

    def __post_init__(self) -> None:
        """Check ranges, so that a wrong number is reported where it was written."""
        checks.choice("Restitution: law", self.law, LAWS)
        if not callable(self.e):
            object.__setattr__(self, "e", checks.number("e_N", self.e, 0.0, 1.0))
        elif not isinstance(self.e, partial):  # of a file
            self(SPEEDS[::20])

    @property
    def largest(self) -> float:
        """Of the coefficients at all speeds [-]."""
        return float(self(SPEEDS).max()) if callable(self.e) else self.e

    def __call__(self, speed: np.ndarray) -> np.ndarray:
        """The coefficients at speeds of approach, shape (n,)."""
        if not callable(self.e):
            return np.full(len(speed), self.e)
        return np.array([self._at(self.e, float(v)) for v in speed])

    def _at(self, function: Callable[[float], float], v: float) -> float:
        try:
            found = float(function(v))
        except Exception as error:
            raise SceneError(f"e_N: the function failed at an approach of {v:g} m/s with {error!r}") from error
        if not 0.0 <= found <= 1.0:
            raise SceneError(f"e_N: got {found:g} at an approach of {v:g} m/s; it must be in [0, 1]")
        return found


def restitution_to_plain(found: Restitution | None, whole: bool) -> dict[str, Any] | None:
    """A restitution as a file holds it; where it need not be `whole` a function is written down as a table."""
    if found is None:
        return None
    e: Any = found.e
    if callable(e) and not whole:
        e = found(SPEEDS).tolist()
    return {"e": e, "law": found.law}


def restitution_from_plain(plain: dict[str, Any] | None) -> Restitution | None:
    """The inverse of `restitution_to_plain`."""
    if plain is None:
        return None
    e = plain["e"]
    return Restitution(partial(_from_table, np.array(e)) if isinstance(e, list) else e, plain["law"])


def _from_table(values: np.ndarray, v: float) -> float:
    return float(np.interp(v, SPEEDS, values))
