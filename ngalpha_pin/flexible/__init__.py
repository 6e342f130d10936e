"""Flexible bodies: the planar Euler-Bernoulli beam, and rods in space."""

from .loads import LineLoad, PointLoad
from .planar_beam import PlanarBeam
from .rod import Rod, RodSectionForces
from .section import Section

__all__ = ["LineLoad", "PlanarBeam", "PointLoad", "Rod", "RodSectionForces", "Section"]
