"""The tree of a system with beams, as the forces at its frames see it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ..contact_kinematics import Motion

if TYPE_CHECKING:
    from ..scene import Scene
    from ..system import System


class TreeView:
    """What `Force.bind` uses of a system, without the coordinates of the beams.

    Attributes:
        scene: of the system.
        model: the tree.
        nv: its velocities.
    """

    def __init__(self, system: System):
        self._system = system
        self.scene: Scene = system.scene
        self.model: pin.Model = system.tree
        self.nv = system.tree.nv

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
        model = self._system.model
        pin.forwardKinematics(model, self._system.data, np.concatenate((q, np.zeros(model.nq - len(q)))))
