"""Dead loads on beams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ngalpha_pin.common import checks


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
        what = f"PointLoad at {checks.name('PointLoad: point', self.point)!r}"
        checks.vector(f"{what}: force", self.force)
        checks.number(f"{what}: moment", self.moment)


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
        checks.vector(f"LineLoad on {checks.name('LineLoad: beam', self.beam)!r}: force", self.force)


Load = PointLoad | LineLoad
