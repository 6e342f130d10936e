"""Flexible bodies: the planar Euler-Bernoulli beam."""

from .planar_beam import PlanarBeam

__all__ = ["PlanarBeam"]
