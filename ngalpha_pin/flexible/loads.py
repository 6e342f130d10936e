"""Dead loads on beams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ngalpha_pin.errors import SceneError


@dataclass(frozen=True)
class PointLoad:
    """A force of constant direction and a moment at a beam point.

    Attributes:
        point: name of the beam point.
        force: in the axes of the world, shape (3,) [N]; what points out of the plane of the beam has no effect.
        moment: about the normal of the plane [N m].
    """

    point: str
    force: Sequence[float] = (0.0, 0.0, 0.0)
    moment: float = 0.0

    def __post_init__(self) -> None:
        """Check shapes."""
        _check_force(f"PointLoad at {self.point!r}", self.force)
        if not np.isfinite(self.moment):
            raise SceneError(f"PointLoad at {self.point!r}: moment = {self.moment} must be finite")


@dataclass(frozen=True)
class LineLoad:
    """A force of constant direction, spread evenly over the undeformed length of a beam.

    Attributes:
        beam: name of the beam.
        force: per length, in the axes of the world, shape (3,) [N/m].
    """

    beam: str
    force: Sequence[float]

    def __post_init__(self) -> None:
        """Check shapes."""
        _check_force(f"LineLoad on {self.beam!r}", self.force)


Load = PointLoad | LineLoad


def _check_force(what: str, force: Sequence[float]) -> None:
    if np.shape(force) != (3,) or not np.isfinite(force).all():
        raise SceneError(f"{what}: force = {force} must be a finite vector of length 3")
