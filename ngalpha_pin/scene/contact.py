"""What the user says about a contact: the pair of geometries and the law (37)-(49), and concave shapes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import coal
import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.compliance import Compliance, HuntCrossley, KelvinVoigt
from ngalpha_pin.scene.friction_curve import Curve, FrictionCurve, Stribeck
from ngalpha_pin.scene.friction_ellipse import FrictionEllipse
from ngalpha_pin.scene.restitution import Restitution
from ngalpha_pin.scene.surface_velocity import SurfaceVelocity, surface_velocity


@dataclass(frozen=True)
class ContactLaw:
    """Signorini's law, Newton's impact law and Coulomb friction of one pair, equations (40), (44), (48), (49).

    Attributes:
        mu: friction coefficient [-], >= 0, that of sticking; 0 leaves the friction rows out.
        e_N: restitution coefficient of the normal direction [-], in [0, 1]; of a function the largest one.
        e_F: restitution coefficient of the tangential direction [-], in [-1, 1].
        contact_radius: radius of the contact area of Coulomb-Contensou friction (157) [m]; 0 leaves drilling out.
        surface_velocity: with which the surface of the second geometry of a pair moves along itself; None rests.
        adhesion: force that every point of the contact holds, once it is closed [N].
        rolling_resistance: arm of the normal force that resists rolling, mu_R times the radius of a ball [m].
        curve: of the coefficient over the speed of slip; may be given as `mu`. None is Coulomb's law.
        restitution: of another law than Newton's, or with a coefficient that depends on the approach; may be given as
            `e_N`. None is Newton's law with a number.
        compliance: normal force over the penetration; None is rigid.
        ellipse: coefficients that differ by direction; may be given as `mu`. None is a circle.
    """

    mu: float | Curve | FrictionEllipse = 0.0
    e_N: float | Callable[[float], float] | Restitution = 0.0
    e_F: float = 0.0
    contact_radius: float = 0.0
    surface_velocity: SurfaceVelocity | None = None
    adhesion: float = 0.0
    rolling_resistance: float = 0.0
    curve: Curve | None = None
    restitution: Restitution | None = None
    compliance: Compliance | None = None
    ellipse: FrictionEllipse | None = None

    def __post_init__(self) -> None:
        """Check ranges, so that a wrong number is reported where it was written."""
        if isinstance(self.mu, (Stribeck, FrictionCurve)):
            object.__setattr__(self, "curve", self.mu)
        if isinstance(self.mu, FrictionEllipse):
            object.__setattr__(self, "ellipse", self.mu)
        if self.ellipse is not None:
            object.__setattr__(self, "mu", self.ellipse.largest)
        if self.curve is not None:
            object.__setattr__(self, "mu", self.curve.static)
        self._restore()
        bounds = {"mu": (0.0, np.inf), "e_N": (0.0, 1.0), "e_F": (-1.0, 1.0), "contact_radius": (0.0, np.inf)}
        bounds |= {"adhesion": (0.0, np.inf), "rolling_resistance": (0.0, np.inf)}
        for name, (low, high) in bounds.items():
            object.__setattr__(self, name, checks.number(name, getattr(self, name), low, high))
        object.__setattr__(self, "surface_velocity", surface_velocity(self.surface_velocity))
        if self.e_F and self.restitution is not None and self.restitution.law != "newton":
            raise SceneError(f"e_F belongs to Newton's law of restitution, not to {self.restitution.law!r}")

        if self.compliance is not None:
            checks.instance("compliance", self.compliance, (KelvinVoigt, HuntCrossley), "KelvinVoigt or HuntCrossley")
            for name in ("e_N", "e_F", "adhesion"):
                if getattr(self, name):
                    raise SceneError(f"a compliant contact takes no {name}: its damping says what comes back")

    def _restore(self) -> None:
        """Take apart what is given as e_N."""
        given, found = self.e_N, self.restitution
        if callable(given) and not isinstance(given, Restitution):
            given = Restitution(given)
        if isinstance(given, Restitution):
            plain = given.law == "newton" and not callable(given.e)
            object.__setattr__(self, "restitution", None if plain else given)
            object.__setattr__(self, "e_N", given.largest)
        elif found is not None and found.largest != given:  # another number for the same law
            object.__setattr__(self, "restitution", Restitution(given, found.law) if found.law != "newton" else None)

    def __repr__(self) -> str:
        return f"ContactLaw({told(self)})"

    @property
    def coefficient(self) -> float:
        """The friction coefficient of sticking [-]."""
        assert isinstance(self.mu, float)
        return self.mu

    @property
    def bounce(self) -> float:
        """The largest restitution coefficient of the normal direction [-]."""
        assert isinstance(self.e_N, float)
        return self.e_N


def told(law: ContactLaw) -> str:
    """What of a law was given: mu, e_N, and what differs from the defaults."""
    parts = {"mu": law.ellipse or law.curve or law.mu, "e_N": law.restitution or law.e_N}
    for field in fields(law):
        value = getattr(law, field.name)
        if field.name not in (*parts, "curve", "ellipse", "restitution") and value != field.default:
            parts[field.name] = value
    return ", ".join(f"{name}={value!r}" for name, value in parts.items())


@dataclass(frozen=True)
class ContactPair:
    """Two geometries, by name, and the law between them.

    Attributes:
        geometry_a, geometry_b: their names.
        law: mu, e_N, e_F, contact radius.
        found: declared by two patterns, not by name; left out where the shapes overlap at the start.
    """

    geometry_a: str
    geometry_b: str
    law: ContactLaw
    found: bool = False

    def __post_init__(self) -> None:
        """Check types."""
        for name in ("geometry_a", "geometry_b"):
            checks.name(f"ContactPair: {name}", getattr(self, name))
        checks.instance("ContactPair: law", self.law, ContactLaw, "a ContactLaw")
        checks.flag("ContactPair: found", self.found)

    def __repr__(self) -> str:
        return f"ContactPair({self.geometry_a!r}, {self.geometry_b!r}, {told(self.law)})"

    @property
    def key(self) -> frozenset[str]:
        """The two names, in no order."""
        return frozenset((self.geometry_a, self.geometry_b))


@dataclass(frozen=True)
class Hollow:
    """A shape that is touched from its inside: coal has no concave primitive.

    Attributes:
        shape: `coal.Cylinder` (its lateral surface) or `coal.Sphere`.
    """

    shape: coal.CollisionGeometry

    def __post_init__(self) -> None:
        """Only shapes with a closed-form inside are accepted."""
        if not isinstance(self.shape, (coal.Cylinder, coal.Sphere)):
            raise SceneError(f"Hollow takes a coal.Cylinder or a coal.Sphere, not {type(self.shape).__name__}")
