"""Compliant contact: a normal force that grows with the penetration, where a rigid contact is not what one wants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ngalpha_pin.common import checks

Force = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class KelvinVoigt:
    """A spring and a damper side by side: F = k d + c d_dot of the penetration d, never negative.

    Attributes:
        stiffness: k [N/m].
        damping: c [N s/m].
    """

    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        """Check ranges."""
        _checked(self, ("stiffness", True), ("damping", False))

    def __call__(self, depth: np.ndarray, rate: np.ndarray) -> Force:
        """The force of contacts that touch and its derivatives by the penetration and by its rate, shape (n,) each."""
        force = self.stiffness * depth + self.damping * rate
        pushes = force > 0.0
        return np.where(pushes, force, 0.0), self.stiffness * pushes, self.damping * pushes

    def smooth(self, depth: float, rate: float) -> tuple[float, float]:
        """The force where nothing keeps it from pulling, and what is positive as long as it pushes."""
        force = self.stiffness * depth + self.damping * rate
        return force, force if self.damping else 1.0

    def energy(self, depth: np.ndarray) -> np.ndarray:
        """What is stored [J], of the shape of `depth`."""
        return 0.5 * self.stiffness * depth**2


@dataclass(frozen=True)
class HuntCrossley:
    """Hertz' law with damping that grows with the penetration d: F = k d^n (1 + c d_dot), never negative.

    Attributes:
        stiffness: k [N/m^n].
        damping: c [s/m]; 0 is Hertz' law. About 1.5 (1 - e) / v of an impact with the speed v that leaves with e v.
        exponent: n [-], at least 1; 1.5 of round bodies.
    """

    stiffness: float
    damping: float = 0.0
    exponent: float = 1.5

    def __post_init__(self) -> None:
        """Check ranges."""
        _checked(self, ("stiffness", True), ("damping", False))
        object.__setattr__(self, "exponent", checks.number("HuntCrossley: exponent", self.exponent, 1.0))

    @classmethod
    def of_spheres(cls, radius: float, modulus: float, damping: float = 0.0) -> HuntCrossley:
        """Hertz' law of two round bodies: k = 4/3 E* sqrt(R).

        Args:
            radius: R with 1/R = 1/R_1 + 1/R_2 [m].
            modulus: E* with 1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2 [Pa].
            damping: c [s/m].
        """
        R = checks.number("HuntCrossley: radius", radius, 0.0, above=True)
        return cls(4.0 / 3.0 * checks.number("HuntCrossley: modulus", modulus, 0.0, above=True) * R**0.5, damping)

    def __call__(self, depth: np.ndarray, rate: np.ndarray) -> Force:
        """The force of contacts that touch and its derivatives by the penetration and by its rate, shape (n,) each."""
        n, k, viscous = self.exponent, self.stiffness, np.maximum(1.0 + self.damping * rate, 0.0)
        elastic, slope = k * depth**n, n * k * depth ** (n - 1.0)
        return elastic * viscous, slope * viscous, self.damping * elastic * (viscous > 0.0)

    def smooth(self, depth: float, rate: float) -> tuple[float, float]:
        """The force where nothing keeps it from pulling, and what is positive as long as it pushes."""
        viscous = 1.0 + self.damping * rate
        return float(self.stiffness * max(depth, 0.0) ** self.exponent * viscous), viscous

    def energy(self, depth: np.ndarray) -> np.ndarray:
        """What is stored [J], of the shape of `depth`."""
        return self.stiffness / (self.exponent + 1.0) * depth ** (self.exponent + 1.0)


Compliance = KelvinVoigt | HuntCrossley
KINDS = {"KelvinVoigt": KelvinVoigt, "HuntCrossley": HuntCrossley}


def _checked(law: Any, *fields: tuple[str, bool]) -> None:
    for name, above in fields:
        what = f"{type(law).__name__}: {name}"
        object.__setattr__(law, name, checks.number(what, getattr(law, name), 0.0, above=above))


def compliance_to_plain(law: Compliance | None) -> dict[str, Any] | None:
    """A law as a file holds it."""
    return None if law is None else {"kind": type(law).__name__, **vars(law)}


def compliance_from_plain(plain: dict[str, Any] | None) -> Compliance | None:
    """The inverse of `compliance_to_plain`."""
    if plain is None:
        return None
    found: Compliance = KINDS[plain["kind"]](**{name: value for name, value in plain.items() if name != "kind"})
    return found
