"""Beams and rods of a run: their centrelines and the forces in their sections over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import UnknownName
from ngalpha_pin.flexible.cable import Cable, CableForce
from ngalpha_pin.flexible.planar_beam import PlanarBeam, SectionForces
from ngalpha_pin.flexible.rod import Rod, RodSectionForces
from ngalpha_pin.scene.strands import reach

TUBE_POINTS = 33  # of the centreline of a beam or rod in a picture


def tubes(trajectory: Any) -> list[tuple[str, np.ndarray, float]]:
    """Name, centreline in the world, shape (n + 1, TUBE_POINTS, 3) [m], and radius [m] of every beam, rod and cable."""
    scene, xi, found = trajectory.scene, np.linspace(0.0, 1.0, TUBE_POINTS), []
    bodies = [(name, beam, beam.radius) for name, beam in scene.beams.items()]
    bodies += [(name, strand, strand.radius or strand.length / 200) for name, strand in scene.strands.items()]
    for name, body, radius in bodies:
        at = scene.slices[body].q
        found.append((name, np.array([body.points(q, xi) for q in trajectory.q[:, at]]), radius))
    return found


def section_forces(
    trajectory: Any, body: str | PlanarBeam | Rod | Cable, xi: np.ndarray
) -> SectionForces | RodSectionForces | CableForce:
    """See `Trajectory.section_forces`."""
    scene = trajectory.scene
    named = {**scene.beams, **scene.strands}
    if isinstance(body, str) and body not in named:
        raise UnknownName("beam, rod or cable", body, named)
    flexible = named[body] if isinstance(body, str) else body
    if not any(flexible is known for known in named.values()):
        raise checks.fail("beam, rod or cable", body, f"one of this run: {', '.join(named) or 'it has none'}")
    if isinstance(flexible, Cable) and not flexible.stretches:
        name = next(name for name, cable in scene.cables.items() if cable is flexible)
        return _held_lengths(trajectory, name, flexible, xi)
    at = scene.slices[flexible]
    pairs = zip(trajectory.q[:, at.q], trajectory.v[:, at.v], strict=True)
    values = zip(*(flexible.section_forces(q, v, xi) for q, v in pairs), strict=True)
    kinds = {PlanarBeam: SectionForces, Rod: RodSectionForces, Cable: CableForce}
    return kinds[type(flexible)](*map(np.array, values))


def _held_lengths(trajectory: Any, name: str, cable: Cable, xi: np.ndarray) -> CableForce:
    """Tension of a cable that does not stretch: forces of the contacts that keep its lengths."""
    segments = cable.segment(xi)
    values = {i: trajectory.contact_force(*reach(name, i)).force for i in set(segments.tolist())}
    return CableForce(np.column_stack([np.linalg.norm(values[int(i)], axis=1) for i in segments]))
