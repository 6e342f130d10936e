"""Forces with the point that their moments are about."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class WrenchAt(NamedTuple):
    """A force and a moment over time, in the axes of the world; of one state without the first axis.

    Attributes:
        force: shape (n + 1, 3) [N], of percussions [N s].
        moment: about `point`, shape (n + 1, 3) [N m], of percussions [N m s].
        point: shape (n + 1, 3) [m].
    """

    force: np.ndarray
    moment: np.ndarray
    point: np.ndarray

    def about(self, point: np.ndarray) -> WrenchAt:
        """The same wrench with its moment about another point.

        Args:
            point: shape (3,) or (n + 1, 3) [m].
        """
        there = np.broadcast_to(np.asarray(point, dtype=float), self.force.shape)
        return WrenchAt(self.force, self.moment + np.cross(self.point - there, self.force), there)

    @classmethod
    def of_origin(cls, wrench: np.ndarray) -> WrenchAt:
        """Wrenches about the origin of the world, (force, moment) in the last axis of length 6."""
        return cls(wrench[..., :3], wrench[..., 3:], np.zeros_like(wrench[..., :3]))
