"""Flexible bodies: the planar Euler-Bernoulli beam."""

from .loads import LineLoad, PointLoad
from .planar_beam import PlanarBeam

__all__ = ["LineLoad", "PlanarBeam", "PointLoad"]
