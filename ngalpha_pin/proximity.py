"""Which pairs of solids are near, without looking at the others.

Spheres around the shapes tell most pairs apart. Of the rest, every pair remembers its distance at the last look and the
pose that B then had relative to A: until B has moved by as much, the pair cannot touch. What is remembered only spares
looks, it never changes what they find.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from .narrow_phase import SolidPair, distance
from .solids import Wall
from .spatial import cross, dot

# part of the size of a pair by which a distance that coal finds may be too large
DOUBT = 1e-6


class Proximity:
    """Distances of pairs of solids, as far as anyone needs them.

    Args:
        pairs: the shapes.
    """

    def __init__(self, pairs: list[SolidPair]):
        self.pairs = pairs
        n = len(pairs)
        self._a, self._b = np.array([p.joints for p in pairs], dtype=int).reshape(-1, 2).T
        a, b = [p.solids[0] for p in pairs], [p.solids[1] for p in pairs]
        self._centres_a = np.array([s.centre for s in a]).reshape(-1, 3)
        self._centres_b = np.array([s.centre for s in b]).reshape(-1, 3)
        self._size_b = 0.5 * np.array([s.size for s in b])
        self._radii = self._size_b + np.array([0.0 if isinstance(s, Wall) else 0.5 * s.size for s in a])
        self._walls = np.array([s.normal if isinstance(s, Wall) else np.zeros(3) for s in a]).reshape(-1, 3)
        self._is_wall = self._walls.any(axis=1)
        self._two_sided = np.array([isinstance(s, Wall) and s.two_sided for s in a], dtype=bool)
        self._doubt = DOUBT * np.array([p.size for p in pairs])
        # the last look: distance, and the centre and the axes of B seen from A
        self._found = np.full(n, -np.inf)
        self._x, self._R = np.zeros((n, 3)), np.zeros((n, 3, 3))
        self._data: pin.Data | None = None

    def within(self, data: pin.Data, reach: float | np.ndarray) -> np.ndarray:
        """Numbers of the pairs whose distance is not above `reach`, one for all or one for each of them [m]."""
        reach = np.broadcast_to(np.asarray(reach, dtype=float), self._found.shape)
        i, bounds = self.bounds(data, reach)
        return np.array([j for j in i[~(bounds > reach[i])] if not self.look(data, j) > reach[j]], dtype=int)

    def bounds(self, data: pin.Data, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pairs that spheres around them do not prove to be farther than `reach`, with lower bounds of the distances.

        Args:
            data: with the poses of the bodies.
            reach: of every pair, shape (n_pairs,) [m].
        """
        R, p = self._poses(data)
        apart = self._spheres(R, p)
        i = np.flatnonzero(~(apart > reach))
        if len(i) == 0:
            return i, apart[i]
        x, R_ab = self._relative(R, p, i)
        moved, turned = x - self._x[i], R_ab - self._R[i]
        # 2 sin(angle / 2) times the radius of B
        way = np.sqrt(dot(moved, moved)) + np.sqrt(0.5 * (turned**2).sum(axis=(1, 2))) * self._size_b[i]
        return i, np.maximum(apart[i], self._found[i] - way - self._doubt[i])

    def look(self, data: pin.Data, i: int | np.integer) -> float:
        """Distance of a pair [m]."""
        X = self.pose(data, i)
        self._found[i] = distance(self.pairs[i], X)[0]
        self._x[i], self._R[i] = X.act(self._centres_b[i]), X.rotation
        return float(self._found[i])

    def pose(self, data: pin.Data, i: int | np.integer) -> pin.SE3:
        """Pose of joint B in joint A of a pair."""
        return data.oMi[int(self._a[i])].actInv(data.oMi[int(self._b[i])])

    def speeds(self, data: pin.Data) -> np.ndarray:
        """Bounds of the speed of any point of B seen from A, shape (n_pairs,) [m/s]."""
        R, p = self._poses(data)
        v = np.array([twist.vector for twist in data.v])
        linear, angular = (np.einsum("kij,kj->ki", R, part) for part in (v[:, :3], v[:, 3:]))
        a, b = self._a, self._b
        c = np.einsum("kij,kj->ki", R[b], self._centres_b)
        turning = angular[b] - angular[a]
        way = linear[b] + cross(angular[b], c) - linear[a] - cross(angular[a], c + p[b] - p[a])
        return np.sqrt(dot(way, way)) + np.sqrt(dot(turning, turning)) * self._size_b

    def _spheres(self, R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Lower bounds of the distances of all pairs from spheres around them, shape (n_pairs,) [m]."""
        a, b = self._a, self._b
        apart = np.einsum("kij,kj->ki", R[b], self._centres_b) + p[b]
        apart -= np.einsum("kij,kj->ki", R[a], self._centres_a) + p[a]
        height = np.einsum("ki,ki->k", np.einsum("kij,kj->ki", R[a], self._walls), apart)
        height = np.where(self._two_sided, np.abs(height), height)
        return np.where(self._is_wall, height, np.sqrt(dot(apart, apart))) - self._radii

    def _relative(self, R: np.ndarray, p: np.ndarray, i: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centre and axes of B seen from A of some pairs, shapes (k, 3) and (k, 3, 3)."""
        a, b = self._a[i], self._b[i]
        R_a = R[a].transpose(0, 2, 1)
        R_ab = R_a @ R[b]
        x = np.einsum("kij,kj->ki", R_a, p[b] - p[a]) + np.einsum("kij,kj->ki", R_ab, self._centres_b[i])
        return x, R_ab

    def _poses(self, data: pin.Data) -> tuple[np.ndarray, np.ndarray]:
        """Rotations and translations of all joints, shapes (n, 3, 3) and (n, 3)."""
        if self._data is not data:  # Pinocchio writes into these arrays in place
            self._data = data
            self._live = [pose.rotation for pose in data.oMi], [pose.translation for pose in data.oMi]
        return np.array(self._live[0]), np.array(self._live[1])
