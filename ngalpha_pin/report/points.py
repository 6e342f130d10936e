"""One measure of error for every system: how far its material points are from where they should be [m]."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.system import System


class MaterialPoints:
    """Of every body with mass its centre, and a point on each principal axis at the radius of gyration about it.

    So a rotation counts by the distance that the mass of the body moves, and angles and lengths have one unit.

    Args:
        scene: with the multibody tree; beams count by their bodies.
    """

    def __init__(self, scene: Scene):
        self._system, self._beams = System(scene), bool(scene.beams)
        self.model = model = self._system.model
        self._data = model.createData()
        joints: list[int] = []
        local: list[np.ndarray] = []
        for j, inertia in list(enumerate(model.inertias))[1:]:
            if inertia.mass <= 0:
                continue
            # the nodes of a beam have no inertia of their own, which shows as numbers that are none
            known = np.isfinite(inertia.inertia).all() and np.isfinite(inertia.lever).all()
            moments, axes = np.linalg.eigh(inertia.inertia if known else np.zeros((3, 3)))
            arms = np.sqrt(np.maximum(moments, 0.0) / inertia.mass) * axes
            centre = np.array(inertia.lever) if known else np.zeros(3)
            local += [centre, *(centre + arms.T)]
            joints += [j] * 4
        self._joints, self._local = np.array(joints, dtype=int), np.array(local).reshape(-1, 3)

    def positions(self, q: np.ndarray) -> np.ndarray:
        """Of the points in the world at many configurations.

        Args:
            q: shape (n, nq).

        Returns:
            Shape (n, n_points, 3) [m].
        """
        found = np.empty((len(q), len(self._joints), 3))
        for i, q_i in enumerate(q):
            pin.forwardKinematics(self.model, self._data, self._system.kinematic(q_i))
            poses = [self._data.oMi[j] for j in range(self.model.njoints)]
            R, p = np.array([pose.rotation for pose in poses]), np.array([pose.translation for pose in poses])
            found[i] = np.einsum("kij,kj->ki", R[self._joints], self._local) + p[self._joints]
        return found

    def energy(self, q: np.ndarray, v: np.ndarray | None) -> float:
        """Kinetic and potential energy of the bodies [J]; NaN where no velocity is told, or beams carry some of it.

        Args:
            q: configuration, shape (nq,).
            v: velocity, shape (nv,), or None.
        """
        if v is None or self._beams or not (np.isfinite(q).all() and np.isfinite(v).all()):
            return float("nan")
        kinetic = pin.computeKineticEnergy(self.model, self._data, q, v)
        return float(kinetic + pin.computePotentialEnergy(self.model, self._data, q))


def largest_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Largest distance between two motions of the same points [m]; times at which the other is NaN do not count.

    NaN where it is known at no time.

    Args:
        a: positions, shape (n, n_points, 3) [m].
        b: the others.
    """
    if a.shape[1] == 0:
        return 0.0
    distance = np.linalg.norm(a - b, axis=2).max(axis=1)
    known = np.isfinite(b).all(axis=(1, 2))
    return float(distance[known].max()) if known.any() else float("nan")
