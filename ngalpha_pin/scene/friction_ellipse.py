"""Friction that differs by direction: skates, sledges, wheels with rollers, brushed metal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError

NAME = "FrictionEllipse"


@dataclass(frozen=True)
class FrictionEllipse:
    """Coefficients of friction along two directions that a body carries: (F_1 / along)^2 + (F_2 / across)^2 <= la_N^2.

    Attributes:
        along: coefficient in the direction of the axis [-], above 0.
        across: coefficient at a right angle to it, in the plane of contact [-], above 0.
        axis: direction in the axes of the frame, shape (3,); what of it lies in the plane of contact counts.
        frame: name of one of the two geometries, or of a frame or joint on one of the two bodies, which carries the
            axis; empty is the second geometry of the pair.
    """

    along: float
    across: float
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    frame: str = ""

    def __post_init__(self) -> None:
        """Check ranges."""
        for name in ("along", "across"):
            object.__setattr__(self, name, checks.number(f"{NAME}: {name}", getattr(self, name), 0.0, above=True))
        object.__setattr__(self, "axis", tuple(checks.direction(f"{NAME}: axis", self.axis).tolist()))
        if not isinstance(self.frame, str) or self.frame:
            checks.name(f"{NAME}: frame", self.frame)

    @property
    def largest(self) -> float:
        """The larger coefficient [-]."""
        return max(self.along, self.across)


class PlacedEllipse(NamedTuple):
    """An ellipse on the bodies of a contact.

    Attributes:
        axis: in the axes of the joint that carries it, shape (3,).
        on_b: it turns with the body of the contact point; otherwise with the one of the surface.
        scale: both coefficients in parts of the larger one, shape (2,).
    """

    axis: np.ndarray
    on_b: bool
    scale: np.ndarray


class _Frames(Protocol):
    """A scene whose frames are looked for."""

    def frame(self, name: str) -> pin.Frame:
        """The frame of that name."""


def placed_ellipse(
    scene: _Frames, law: Any, geometries: tuple[pin.GeometryObject, pin.GeometryObject], point: pin.GeometryObject
) -> PlacedEllipse | None:
    """The ellipse of a law on the bodies of a pair; None where friction is the same in all directions.

    Args:
        scene: it belongs to.
        law: of the pair.
        geometries: of the pair, in the order of the declaration.
        point: the one of them that has the contact point.

    Raises:
        SceneError: the frame is on neither of the two bodies. UnknownName: there is no such frame.
    """
    ellipse: FrictionEllipse | None = law.ellipse
    if ellipse is None:
        return None
    named = {g.name: g for g in geometries}
    if not ellipse.frame or ellipse.frame in named:
        geometry = named.get(ellipse.frame, geometries[1])
        joint, rotation = int(geometry.parentJoint), geometry.placement.rotation
    else:
        frame = scene.frame(ellipse.frame)
        joint, rotation = int(frame.parentJoint), frame.placement.rotation
    if joint not in [int(g.parentJoint) for g in geometries]:
        a, b = (g.name for g in geometries)
        raise SceneError(
            f"{NAME}: the frame {ellipse.frame!r} is on neither of the bodies of {a!r} and {b!r}; name one of theirs, "
            "or one of the two geometries"
        )
    scale = np.array([ellipse.along, ellipse.across]) / ellipse.largest
    return PlacedEllipse(rotation @ np.array(ellipse.axis), joint == int(point.parentJoint), scale)
