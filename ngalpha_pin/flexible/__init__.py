"""Flexible bodies: the planar Euler-Bernoulli beam, rods in space, and cables."""

from .cable import Cable, CableForce
from .loads import LineLoad, PointLoad
from .planar_beam import PlanarBeam
from .rod import Rod, RodSectionForces
from .section import Section

__all__ = ["Cable", "CableForce", "LineLoad", "PlanarBeam", "PointLoad", "Rod", "RodSectionForces", "Section"]
