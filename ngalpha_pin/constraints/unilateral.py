"""Own unilateral constraints as rows among those of contacts: their kinematics by differences along the motion.

They may depend on time. Where contacts are looked at there is a configuration and no time, so that a scene with such
constraints has a clock among its coordinates, see `system.extra_states`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ngalpha_pin.constraints.provider import Bodies
from ngalpha_pin.constraints.user_defined import UserFunctions, UserRows
from ngalpha_pin.contact.point_rows import Motion

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


class Unilaterals:
    """The own unilateral constraints of a scene.

    Args:
        scene: declares them.
        model: with the clock as its last joint.
    """

    def __init__(self, scene: Scene, model: pin.Model):
        self._model, self._tree, self._constraints = model, scene.model, scene.unilaterals
        self._chosen: dict[bytes, UserFunctions] = {}

    def gaps(self, which: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Gaps of some of them, shape (n,)."""
        tree = self._tree
        nowhere = np.zeros(tree.nv)
        return np.array([self._constraints[i].gap.value(q[-1], q[: tree.nq], nowhere)[0] for i in which])

    def rows(self, which: np.ndarray, q: np.ndarray, motion: Motion) -> UserRows:
        """Rows of some of them: all gaps, then all slips.

        Args:
            which: their numbers, increasing.
            q: configuration with the clock, shape (nq,).
            motion: velocity and acceleration there.
        """
        key = which.tobytes()
        if key not in self._chosen:
            chosen = [self._constraints[i] for i in which]
            slips = [constraint.slip for constraint in chosen if constraint.slip is not None]
            functions = [*(constraint.gap for constraint in chosen), *slips]
            self._chosen[key] = UserFunctions(self._model, self._tree, functions)
        return UserRows(self._chosen[key], Bodies(float(q[-1]), q, [], [], motion))


def unilaterals(scene: Scene, model: pin.Model) -> Unilaterals | None:
    """The own unilateral constraints of a scene; None where it has none."""
    return Unilaterals(scene, model) if scene.unilaterals else None
