"""Beams and rods of a run: their centrelines and the forces in their sections over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import UnknownName
from ngalpha_pin.flexible.planar_beam import PlanarBeam, SectionForces
from ngalpha_pin.flexible.rod import Rod, RodSectionForces

TUBE_POINTS = 33  # of the centreline of a beam or rod in a picture


def tubes(trajectory: Any) -> list[tuple[str, np.ndarray, float]]:
    """Name, centreline in the world, shape (n + 1, TUBE_POINTS, 3) [m], and radius [m] of every beam and rod."""
    scene, xi, found = trajectory.scene, np.linspace(0.0, 1.0, TUBE_POINTS), []
    bodies = [(name, beam, beam.radius) for name, beam in scene.beams.items()]
    bodies += [(name, rod, rod.section.radius or rod.length / 200) for name, rod in scene.rods.items()]
    for name, body, radius in bodies:
        at = scene.slices[body].q
        found.append((name, np.array([body.points(q, xi) for q in trajectory.q[:, at]]), radius))
    return found


def section_forces(trajectory: Any, body: str | PlanarBeam | Rod, xi: np.ndarray) -> SectionForces | RodSectionForces:
    """See `Trajectory.section_forces`."""
    scene = trajectory.scene
    named = {**scene.beams, **scene.rods}
    if isinstance(body, str) and body not in named:
        raise UnknownName("beam or rod", body, named)
    flexible = named[body] if isinstance(body, str) else body
    if not any(flexible is known for known in named.values()):
        raise checks.fail("beam or rod", body, f"one of this run: {', '.join(named) or 'it has none'}")
    at = scene.slices[flexible]
    pairs = zip(trajectory.q[:, at.q], trajectory.v[:, at.v], strict=True)
    values = zip(*(flexible.section_forces(q, v, xi) for q, v in pairs), strict=True)
    kind = SectionForces if isinstance(flexible, PlanarBeam) else RodSectionForces
    return kind(*map(np.array, values))
