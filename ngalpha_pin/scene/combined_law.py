"""The law between two surfaces of which each has properties of its own, see `Scene.set_surface`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.compliance import Compliance, HuntCrossley, KelvinVoigt
from ngalpha_pin.scene.contact import ContactLaw
from ngalpha_pin.scene.restitution import Restitution


@dataclass(frozen=True)
class _Smaller:
    """The smaller one of two coefficients at a speed of approach."""

    a: Restitution
    b: Restitution

    def __call__(self, v: float) -> float:
        return float(min(self.a(np.array([v]))[0], self.b(np.array([v]))[0]))


def combined_law(a: ContactLaw, b: ContactLaw) -> ContactLaw:
    """Geometric mean of mu, the smaller restitution, larger arms; two compliances act one behind the other.

    Raises:
        SceneError: the two have laws of which none is that of both.
    """
    return ContactLaw(
        float(np.sqrt(a.coefficient * b.coefficient)),
        _restitution(a, b),
        min(a.e_F, b.e_F),
        max(a.contact_radius, b.contact_radius),
        rolling_resistance=max(a.rolling_resistance, b.rolling_resistance),
        compliance=_compliance(a.compliance, b.compliance),
    )


def _restitution(a: ContactLaw, b: ContactLaw) -> float | Restitution:
    """Of a number it is not said which law it is of: it goes with that of the other surface."""
    found = [law.restitution for law in (a, b) if law.restitution is not None]
    if not found or a.compliance is not None or b.compliance is not None:
        return min(a.bounce, b.bounce)
    names = {restitution.law for restitution in found}
    if len(names) > 1:
        raise SceneError(
            f"e_N: one surface has the law {found[0].law!r} and the other one {found[1].law!r}; say that of the pair, "
            "e.g. add_contact(..., e_N=Restitution(0.5, 'poisson'))"
        )
    law = names.pop()
    of_a, of_b = (x.restitution or Restitution(x.bounce, law) for x in (a, b))
    e: float | Callable[[float], float] = min(a.bounce, b.bounce)
    return Restitution(_Smaller(of_a, of_b) if callable(of_a.e) or callable(of_b.e) else e, law)


def _compliance(a: Compliance | None, b: Compliance | None) -> Compliance | None:
    """Of one force through both: stiffness of the two in a row, and damping that takes as much as both of them.

    A rigid surface leaves that of the other one. With parts s_a + s_b = 1 of the penetration c = c_a s_a^2 + c_b s_b^2,
    which is exact to first order in the damping.
    """
    if a is None or b is None:
        return a or b
    if isinstance(a, KelvinVoigt) and isinstance(b, KelvinVoigt):
        k, part = a.stiffness * b.stiffness / (a.stiffness + b.stiffness), b.stiffness / (a.stiffness + b.stiffness)
        return KelvinVoigt(k, a.damping * part**2 + b.damping * (1 - part) ** 2)
    if isinstance(a, HuntCrossley) and isinstance(b, HuntCrossley) and a.exponent == b.exponent:
        n = a.exponent
        depth_a, depth_b = a.stiffness ** (-1 / n), b.stiffness ** (-1 / n)
        part = depth_a / (depth_a + depth_b)
        return HuntCrossley((depth_a + depth_b) ** -n, a.damping * part**2 + b.damping * (1 - part) ** 2, n)
    raise SceneError(
        f"compliance: one surface has {a} and the other one {b}, which are not one law in a row; say that of the pair, "
        "add_contact(..., compliance=...)"
    )
