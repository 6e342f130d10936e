"""The tree of a system with beams, as the forces at its frames see it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.errors import SceneError


class _Whole(Protocol):
    """The system with its beams."""

    tree: pin.Model
    model: pin.Model
    data: pin.Data
    scene: Any

    @property
    def poses(self) -> tuple[list[np.ndarray], list[np.ndarray]]: ...

    def motion(self, v: np.ndarray, a: np.ndarray) -> Motion: ...


class TreeView:
    """What `Force.bind` uses of a system, without the coordinates of the beams.

    Attributes:
        model: the tree.
        nv: its velocities.
        scene: itself, for `frame`.
    """

    def __init__(self, system: _Whole):
        self._system, self.scene = system, self
        self.model: pin.Model = system.tree
        self.nv = system.tree.nv

    def frame(self, name: str) -> pin.Frame:
        """The frame of a body of the tree.

        Raises:
            SceneError: it is a point of a beam.
        """
        if any(point.name == name for point in self._system.scene.beam_points):
            raise SceneError(
                f"{name!r} is a point of a beam, and forces at frames act on the bodies of the tree: "
                "use PointLoad, or tie a body to it by a constraint"
            )
        return self._system.scene.frame(name)

    @property
    def poses(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Rotation and translation of every joint."""
        return self._system.poses

    def motion(self, v: np.ndarray, a: np.ndarray) -> Motion:
        """Columns of the tree, with v and a of the tree."""
        whole, n = self._system.motion(v, a), self.nv
        return Motion(whole.J[:, :n], whole.dJ[:, :n], whole.dAdv[:, :n], v, a)

    def place(self, q: np.ndarray) -> None:
        """Move the bodies of the tree to q; the beam points go to the origins of their planes."""
        model, of_tree = self._system.model, q[: self.model.nq]
        pin.forwardKinematics(model, self._system.data, np.append(of_tree, np.zeros(model.nq - len(of_tree))))
