"""Which pairs of solids are near, without looking at the others.

Spheres around the shapes tell most pairs apart. Of the rest, every pair remembers its distance at the last look and the
pose that B then had relative to A: until B has moved by as much, the pair cannot touch. And pairs that were far away at
the last look at all of them are not looked at before some body has moved far enough, so that they cost nothing. What is
remembered only spares looks, it never changes what they find.

A broadphase that is built for every look would have to be asked in every step: see `benchmarks/broadphase.py`, which
measures coal's trees beside this.
"""

from __future__ import annotations

from copy import copy

import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.narrow_phase import SolidPair, distance
from ngalpha_pin.collision.shapes import Wall
from ngalpha_pin.numerics.spatial import cross, dot

# part of the size of a pair by which a distance that coal finds may be too large
DOUBT = 1e-6
# up to which distance pairs are listed in a look at all of them: so many times what was asked for, and at least this
# part of the size of a typical pair
LISTED, LISTED_SIZE = 16.0, 0.5


class Proximity:
    """Distances of pairs of solids, as far as anyone needs them.

    Args:
        pairs: the shapes.
    """

    def __init__(self, pairs: list[SolidPair]):
        self.pairs = pairs
        self._a, self._b = np.array([p.joints for p in pairs], dtype=int).reshape(-1, 2).T
        a, b = [p.solids[0] for p in pairs], [p.solids[1] for p in pairs]
        self._centres_a = np.array([s.centre for s in a]).reshape(-1, 3)
        self._centres_b = np.array([s.centre for s in b]).reshape(-1, 3)
        self._size_b = 0.5 * np.array([s.size for s in b])
        self._radii = self._size_b + np.array([0.0 if isinstance(s, Wall) else 0.5 * s.size for s in a])
        self._walls = np.array([s.normal if isinstance(s, Wall) else np.zeros(3) for s in a]).reshape(-1, 3)
        self._is_wall: np.ndarray = np.any(self._walls, axis=1)
        self._two_sided = np.array([isinstance(s, Wall) and s.two_sided for s in a], dtype=bool)
        self._doubt = DOUBT * np.array([p.size for p in pairs])
        joints = max(int(self._a.max(initial=0)), int(self._b.max(initial=0))) + 1
        self._extent = np.zeros(joints)
        for joint, centres, solids in ((self._a, self._centres_a, a), (self._b, self._centres_b, b)):
            sizes = np.array([0.0 if isinstance(s, Wall) else 0.5 * s.size for s in solids])
            np.maximum.at(self._extent, joint, np.sqrt(dot(centres, centres)) + sizes)
        # a wall that moves sweeps any distance
        self._always = np.flatnonzero(self._is_wall & (self._a > 0))
        self._typical = float(np.median([p.size for p in pairs])) if pairs else 0.0
        self._begin()

    def fresh(self) -> Proximity:
        """The same, before any look."""
        found = copy(self)
        found._begin()
        return found

    def _begin(self) -> None:
        n = len(self.pairs)
        # the last look: distance, and the centre and the axes of B seen from A
        self._found = np.full(n, -np.inf)
        self._x, self._R = np.zeros((n, 3)), np.zeros((n, 3, 3))
        self._data: pin.Data | None = None
        # the last look at all pairs: poses of the joints, the pairs that are listed since, and how far the others were
        self._seen: tuple[np.ndarray, np.ndarray] | None = None
        self._listed, self._others_from = np.arange(n), -np.inf

    def within(self, data: pin.Data, reach: float, ahead: float = 0.0) -> np.ndarray:
        """Numbers of the pairs whose distance is not above a reach.

        Args:
            data: with the poses of the bodies and, where `ahead` is not zero, their velocities.
            reach: the same for all [m].
            ahead: time for which the pairs approach each other in addition [s].
        """
        most = reach + (2.0 * ahead * self._fastest(data) if ahead > 0.0 else 0.0)
        listed = self._near(data, most)
        own = reach + (ahead * self.speeds(data, listed) if ahead > 0.0 else np.zeros(len(listed)))
        i, bounds = self.bounds(data, own, listed)
        own = own[np.searchsorted(listed, i)]
        looks = zip(i.tolist(), bounds.tolist(), own.tolist(), strict=True)
        return np.array([j for j, bound, to in looks if not (bound > to or self.look(data, j) > to)], dtype=int)

    @property
    def shapes(self) -> tuple[np.ndarray, ...]:
        """What is fixed of all pairs, and last the extent of every joint.

        Both centres, half the size of B, radii, normals of walls, which of them have two sides, doubts.
        """
        of_pairs = (self._centres_a, self._centres_b, self._size_b, self._radii, self._walls)
        return *of_pairs, self._two_sided, self._doubt, self._extent

    @property
    def joints(self) -> tuple[np.ndarray, np.ndarray]:
        """Joints of A and B of every pair."""
        return self._a, self._b

    @property
    def looks(self) -> tuple[np.ndarray, ...] | None:
        """What the looks have found; None before all pairs were looked at.

        Distances, centres and axes of B; rotations and translations of the joints at the last look at all pairs; the
        pairs that are listed since, and how far the others were.
        """
        if self._seen is None:
            return None
        return self._found, self._x, self._R, *self._seen, self._listed, np.array(self._others_from)

    def forget(self) -> None:
        """Look at all pairs the next time."""
        self._seen = None

    def _fastest(self, data: pin.Data) -> float:
        """Bound of the speed of any point of a shape [m/s]."""
        v = np.array([twist.vector for twist in data.v])[: len(self._extent)]
        return float((np.sqrt(dot(v[:, :3], v[:, :3])) + np.sqrt(dot(v[:, 3:], v[:, 3:])) * self._extent).max())

    def _near(self, data: pin.Data, most: float) -> np.ndarray:
        """Increasing numbers of the pairs that may be nearer than `most`, of all pairs where that is not finite."""
        R, p = self._poses(data)
        if self._seen is not None:
            n = len(self._extent)
            moved, turned = p[:n] - self._seen[1][:n], R[:n] - self._seen[0][:n]
            way = np.sqrt(dot(moved, moved)) + np.sqrt(0.5 * (turned**2).sum(axis=(1, 2))) * self._extent
            if 2.0 * float(way.max()) + most <= self._others_from:
                return self._listed
        upto = max(LISTED * most, LISTED_SIZE * self._typical)
        if not np.isfinite(upto):
            return np.arange(len(self.pairs))
        near = ~(self._spheres(R, p) > upto)
        near[self._always] = True
        self._seen, self._listed, self._others_from = (R, p), np.flatnonzero(near), upto
        return self._listed

    def bounds(
        self, data: pin.Data, reach: np.ndarray, among: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pairs that spheres around them do not prove to be farther than `reach`, with lower bounds of the distances.

        Args:
            data: with the poses of the bodies.
            reach: of every pair that is looked at [m].
            among: numbers of these pairs; None for all.
        """
        R, p = self._poses(data)
        apart = self._spheres(R, p, slice(None) if among is None else among)
        at = np.flatnonzero(~(apart > reach))
        i, apart = at if among is None else among[at], apart[at]
        if len(i) == 0:
            return i, apart
        x, R_ab = self._relative(R, p, i)
        moved, turned = x - self._x[i], R_ab - self._R[i]
        # 2 sin(angle / 2) times the radius of B
        way = np.sqrt(dot(moved, moved)) + np.sqrt(0.5 * (turned**2).sum(axis=(1, 2))) * self._size_b[i]
        return i, np.maximum(apart, self._found[i] - way - self._doubt[i])

    def look(self, data: pin.Data, i: int | np.integer) -> float:
        """Distance of a pair [m]."""
        X = self.pose(data, i)
        self._found[i] = distance(self.pairs[i], X)[0]
        self._x[i], self._R[i] = X.act(self._centres_b[i]), X.rotation
        return float(self._found[i])

    def pose(self, data: pin.Data, i: int | np.integer) -> pin.SE3:
        """Pose of joint B in joint A of a pair."""
        return data.oMi[int(self._a[i])].actInv(data.oMi[int(self._b[i])])

    def speeds(self, data: pin.Data, i: np.ndarray) -> np.ndarray:
        """Bounds of the speed of any point of B seen from A of some pairs, shape (k,) [m/s]."""
        R, p = self._poses(data)
        v = np.array([twist.vector for twist in data.v])
        linear, angular = (np.einsum("kij,kj->ki", R, part) for part in (v[:, :3], v[:, 3:]))
        a, b = self._a[i], self._b[i]
        c = np.einsum("kij,kj->ki", R[b], self._centres_b[i])
        turning = angular[b] - angular[a]
        way = linear[b] + cross(angular[b], c) - linear[a] - cross(angular[a], c + p[b] - p[a])
        return np.sqrt(dot(way, way)) + np.sqrt(dot(turning, turning)) * self._size_b[i]

    def _spheres(self, R: np.ndarray, p: np.ndarray, i: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Lower bounds of the distances of some pairs from spheres around them, shape (k,) [m]."""
        a, b = self._a[i], self._b[i]
        apart = np.einsum("kij,kj->ki", R[b], self._centres_b[i]) + p[b]
        apart -= np.einsum("kij,kj->ki", R[a], self._centres_a[i]) + p[a]
        height = np.einsum("ki,ki->k", np.einsum("kij,kj->ki", R[a], self._walls[i]), apart)
        height = np.where(self._two_sided[i], np.abs(height), height)
        return np.where(self._is_wall[i], height, np.sqrt(dot(apart, apart))) - self._radii[i]

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
