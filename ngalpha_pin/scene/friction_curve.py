"""Friction coefficients that depend on the speed of slip: static above kinetic friction, Stribeck's curve, your own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError

# slip speeds at which a function is looked at and written down [m/s]
SPEEDS = np.concatenate(([0.0], np.geomspace(1e-7, 1e3, 2000)))
# difference between a slope and that of the values, in parts of the coefficient by the speed, that is none
SLOPE = 1e-3
NAME = "mu"


@dataclass(frozen=True)
class Stribeck:
    """mu(v) = mu_k + (mu_s - mu_k) exp(-(v / v_s)^exponent).

    Attributes:
        mu_s: static coefficient, that of sticking and of slip that begins [-].
        mu_k: kinetic coefficient, that of fast slip [-].
        v_s: speed of slip on which it changes [m/s].
        exponent: 2 or 1, or what fits a measurement [-], at least 1.
    """

    mu_s: float
    mu_k: float
    v_s: float
    exponent: float = 2.0

    def __post_init__(self) -> None:
        """Check ranges."""
        for name, low, above in (
            ("mu_s", 0.0, False),
            ("mu_k", 0.0, False),
            ("v_s", 0.0, True),
            ("exponent", 1.0, False),
        ):
            object.__setattr__(self, name, checks.number(f"Stribeck: {name}", getattr(self, name), low, above=above))

    @property
    def static(self) -> float:
        """The coefficient of sticking [-]."""
        return self.mu_s

    def __call__(self, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The coefficient and its slope [s/m] at speeds, shape (n,) each."""
        x = speed / self.v_s
        part = (self.mu_s - self.mu_k) * np.exp(-(x**self.exponent))
        return self.mu_k + part, -self.exponent / self.v_s * x ** (self.exponent - 1.0) * part


@dataclass(frozen=True)
class FrictionCurve:
    """A coefficient of friction from a function of the speed of slip.

    Attributes:
        function: of the speed v >= 0 [m/s]; returns the coefficient [-] and its derivative by v [s/m]. At zero it gives
            the coefficient of sticking.
    """

    function: Callable[[float], Any]

    def __post_init__(self) -> None:
        """Look at what it gives, and whether the slope is that of the values."""
        checks.function(f"{NAME}: function", self.function, "of the speed of slip that returns (mu, slope)")
        if isinstance(self.function, partial):  # of a file
            return
        for v in (0.0, 1e-3, 0.03, 0.5, 7.0):
            mu, slope = self._at(v)
            h = 1e-4 * max(v, 1e-3)
            rise = (self._at(v + h)[0] - self._at(max(v - h, 0.0))[0]) / (v + h - max(v - h, 0.0))
            if v > 0.0 and abs(rise - slope) > SLOPE * max(abs(slope), abs(rise), mu / v):
                raise SceneError(f"{NAME}: at {v:g} m/s its slope is given as {slope:g}, its values rise with {rise:g}")

    @property
    def static(self) -> float:
        """The coefficient of sticking [-]."""
        return float(self._at(0.0)[0])

    def __call__(self, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The coefficient and its slope [s/m] at speeds, shape (n,) each."""
        found = np.array([self._at(float(v)) for v in speed]).reshape(-1, 2)
        return found[:, 0], found[:, 1]

    def _at(self, v: float) -> np.ndarray:
        try:
            found = np.array(self.function(v), dtype=float)
        except Exception as error:
            raise SceneError(f"{NAME}: the function failed at a slip of {v:g} m/s with {error!r}") from error
        if found.shape != (2,) or not np.isfinite(found).all() or found[0] < 0.0:
            raise SceneError(f"{NAME}: got {found.tolist()} at {v:g} m/s; it must be (mu, slope), finite with mu >= 0")
        return found


Curve = Stribeck | FrictionCurve


def curve_to_plain(curve: Curve | None, whole: bool) -> dict[str, Any] | None:
    """A curve as a file holds it; where it need not be `whole` a function is written down as a table."""
    if curve is None:
        return None
    if isinstance(curve, Stribeck):
        return {name: getattr(curve, name) for name in ("mu_s", "mu_k", "v_s", "exponent")}
    if whole:
        return {"function": curve.function}
    return {"table": np.column_stack((SPEEDS, *curve(SPEEDS))).tolist()}


def curve_from_plain(plain: dict[str, Any] | None) -> Curve | None:
    """The inverse of `curve_to_plain`."""
    if plain is None:
        return None
    if "mu_s" in plain:
        return Stribeck(**plain)
    return FrictionCurve(plain.get("function") or partial(_from_table, np.array(plain["table"]).T))


def _from_table(table: np.ndarray, v: float) -> np.ndarray:
    """Value and slope of the cubic between two speeds of a table."""
    i = min(max(int(np.searchsorted(table[0], v, side="right")) - 1, 0), table.shape[1] - 2)
    cubic = CubicHermiteSpline(table[0, i : i + 2], table[1, i : i + 2], table[2, i : i + 2])
    return np.array([cubic(v), cubic(v, 1)])
