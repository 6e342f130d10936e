"""How the motion of the bodies of a tree changes with its configuration, at given v and a.

A change of coordinate j moves everything beyond its joint by the twist X = J_j, in the world. With the twist V and the
spatial acceleration A of a body there, and V_p, A_p those of the parent of that joint,

    dJ_k = X x J_k        dV = X x (V - V_p)        dA = X x (A - A_p) + (V_p x X) x (V - V_p)
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.contact.reach import moved_by
from ngalpha_pin.numerics.spatial import force_cross


class Tree:
    """What stays the same: which coordinates move which joints.

    Attributes:
        support: 1 where a coordinate moves a joint, shape (joints, nv).
        follows: 1 where the twist of coordinate k moves with coordinate j, shape (nv, nv).
        parent: parent joint of each coordinate's joint, shape (nv,).
    """

    def __init__(self, model: pin.Model):
        self.support = np.array([moved_by(model, joint) for joint in range(model.njoints)]).reshape(-1, model.nv)
        joint = np.repeat(np.arange(model.njoints), list(model.nvs))
        self.follows = self.support[joint]
        self.parent = np.array(list(model.parents), dtype=int)[joint]


class TreeMotion:
    """Twists and accelerations of all bodies and their derivatives by q.

    Attributes:
        tree: see `Tree`.
        J: twists of the coordinates, shape (nv, 6).
        V, A: of every joint's body, about the origin of the world, shape (joints, 6).
    """

    def __init__(self, tree: Tree, motion: Motion):
        self.tree, self.J = tree, motion.J.T.copy()
        self.V = tree.support @ (motion.J * motion.v).T
        self.A = tree.support @ (motion.J * motion.a + motion.dJ * motion.v).T
        self._turned = products(self.V[tree.parent], self.J)

    def moved(self, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacement, dV and dA of some bodies by each coordinate, shape (k, nv, 6) each."""
        tree, J = self.tree, self.J
        moves = tree.support[joints][:, :, None]
        relative_V = self.V[joints][:, None] - self.V[tree.parent]
        relative_A = self.A[joints][:, None] - self.A[tree.parent]
        dV, dA = products(J, relative_V), products(J, relative_A) + products(self._turned, relative_V)
        return moves * J, moves * dV, moves * dA

    def turned(self, wrenches: np.ndarray) -> np.ndarray:
        """Change of J^T F where the twists of the coordinates move and the wrenches on them stay.

        Args:
            wrenches: on what each coordinate moves, shape (nv, 6).

        Returns:
            Row k is the generalized force of coordinate k, column j its derivative by coordinate j, shape (nv, nv).
        """
        changed: np.ndarray = self.tree.follows * (force_cross(self.J, wrenches) @ self.J.T)
        return changed


def products(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Spatial cross products of motions along the last axis, whose other axes are broadcast."""
    found = np.empty(np.broadcast_shapes(x.shape, y.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[..., i] = x[..., 3 + j] * y[..., k] - x[..., 3 + k] * y[..., j]
        found[..., i] += x[..., j] * y[..., 3 + k] - x[..., k] * y[..., 3 + j]
        found[..., 3 + i] = x[..., 3 + j] * y[..., 3 + k] - x[..., 3 + k] * y[..., 3 + j]
    return found
