"""The step of the paper in dense numpy."""

from .run import simulate

__all__ = ["simulate"]
