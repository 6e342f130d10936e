"""The contacts between shapes whose touching features change: a fixed number of places for every pair.

At the start of a step the pairs that are near get the features with which they may touch in that step; they stay the
same while the equations of the step are solved. A feature keeps the place of the one that was there in the step before,
so that its force goes on. A feature that appears starts without a force in the step before. One that vanishes while it
carries a force keeps its place as an open contact until its auxiliary force (96) has died away.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from .features import NORMAL, SIDE, VANISHED, WIDTH, Feature, face, gap_along_normal, pack
from .geometry import ContactPoint, Surface
from .narrow_phase import SolidPair, distance, nearest, separation, touching_features
from .solids import Wall

SLOTS = 12
# distance from which coal's word on whether shapes overlap is taken, in parts of the size of the scene
TOUCH = 1e-5
# a direction in which no mechanism is likely to be unable to move a point
SOMEWHERE = np.array([0.3567, 0.8321, 0.4249]) / np.linalg.norm([0.3567, 0.8321, 0.4249])
# features further apart than this part of the smaller shape, or with normals this different, are not the same one
SAME, SAME_NORMAL = 0.2, 0.5
# what is in an empty place: a corner on a plane, with the gap of what has vanished
EMPTY = pack(face(np.zeros(3), np.array([0.0, 0.0, 1.0])), Feature(np.zeros(3)), np.array([0.0, 0.0, 1.0]))


class Slots:
    """Pairs of solids and the features that are in their places.

    Args:
        model: of the scene.
        pairs: the shapes.

    Attributes:
        n: number of places, SLOTS for every pair.
        packed: features, shape (n, WIDTH); see `features`.
        loaded: which places are taken, shape (n,).
        open_gap: gap of an empty place [m].
    """

    def __init__(self, model: pin.Model, pairs: list[SolidPair]):
        self.pairs = pairs
        self.n = SLOTS * len(pairs)
        self.open_gap = 1.0
        self.packed = np.zeros((self.n, WIDTH))
        self.loaded = np.zeros(self.n, dtype=bool)
        self._clear()
        self._joints = np.array([p.joints for p in pairs], dtype=int).reshape(-1, 2)
        a, b = [p.solids[0] for p in pairs], [p.solids[1] for p in pairs]
        self._centres = np.array([[s.centre, t.centre] for s, t in zip(a, b, strict=True)]).reshape(-1, 2, 3)
        self._radii = np.array(
            [(0.0 if isinstance(s, Wall) else 0.5 * s.size) + 0.5 * t.size for s, t in zip(a, b, strict=True)]
        )
        self._walls = np.array([s.normal if isinstance(s, Wall) else np.zeros(3) for s in a]).reshape(-1, 3)
        self._two_sided = np.array([isinstance(s, Wall) and s.two_sided for s in a], dtype=bool)

    def stand_ins(self) -> list[ContactPoint]:
        """One contact point for every place, with name, joints, law and size of the pair; its geometry is not used."""
        points: list[ContactPoint] = []
        for pair in self.pairs:
            a, b = pair.solids
            point = (float(np.linalg.norm(b.centre)) + 0.5 * b.size) * SOMEWHERE
            extent = float(np.linalg.norm(a.centre)) + 0.5 * a.size
            zero = np.zeros(3)
            surface = Surface(pair.joints[0], zero, 0.0, zero, zero, extent, np.inf, 1.0)
            joint, names = pair.joints[1], [f"{pair.name}[{i}]" for i in range(SLOTS)]
            points += [ContactPoint(name, joint, point, 0.0, surface, pair.law) for name in names]
        return points

    def contents(self) -> np.ndarray:
        """What is in the places, to be kept in a state: number and features, shape (loaded, 1 + WIDTH)."""
        taken = np.flatnonzero(self.loaded)
        return np.concatenate((taken[:, None], self.packed[taken]), axis=1)

    def restore(self, contents: np.ndarray) -> None:
        """Put back what `contents` has given."""
        self._clear()
        places = contents[:, 0].astype(int)
        self.loaded[places] = True
        self.packed[places] = contents[:, 1:]

    def restore_one(self, contents: np.ndarray, ends: np.ndarray, i: int) -> None:
        """Put back part i of several `contents` in one array, each of which ends at one of `ends`."""
        if self.n:
            self.restore(contents[ends[i - 1] if i else 0 : ends[i]])

    def _clear(self) -> None:
        self.loaded[:] = False
        self.packed[:] = EMPTY
        self.packed[:, VANISHED] = self.open_gap

    def bounds(self, data: pin.Data) -> np.ndarray:
        """Lower bounds of the distances of all pairs from spheres around them, shape (n_pairs,) [m]."""
        R = np.array([data.oMi[int(j)].rotation for j in range(len(data.oMi))])
        p = np.array([data.oMi[int(j)].translation for j in range(len(data.oMi))])
        ja, jb = self._joints.T
        x_a = np.einsum("kij,kj->ki", R[ja], self._centres[:, 0]) + p[ja]
        x_b = np.einsum("kij,kj->ki", R[jb], self._centres[:, 1]) + p[jb]
        apart = x_b - x_a
        normal = np.einsum("kij,kj->ki", R[ja], self._walls)
        height = np.einsum("ki,ki->k", normal, apart)
        height = np.where(self._two_sided, np.abs(height), height)
        wall = self._walls.any(axis=1)
        return np.where(wall, height, np.sqrt(np.einsum("ki,ki->k", apart, apart))) - self._radii

    def distances(self, data: pin.Data, within: float) -> np.ndarray:
        """Distances of all pairs, shape (n_pairs,) [m]; of those farther than `within` a lower bound above it."""
        found = self.bounds(data)
        for i in np.flatnonzero(~(found > within)):
            found[i] = distance(self.pairs[i], self.pose(data, i))[0]
        return found

    def pose(self, data: pin.Data, i: int | np.integer) -> pin.SE3:
        """Pose of joint B in joint A of a pair."""
        a, b = self.pairs[i].joints
        return data.oMi[a].actInv(data.oMi[b])

    def load(
        self,
        data: pin.Data,
        near: np.ndarray,
        contents: np.ndarray,
        carries: np.ndarray,
        dt: float | None,
        within: float,
    ) -> None:
        """Fill the places at the start of a step.

        Args:
            data: with poses and velocities of the bodies.
            near: numbers of the pairs that may touch in the step.
            contents: what was in the places in the step before.
            carries: numbers of the places whose contacts carry a force, or have just done so.
            dt: length of the step [s]; None for corners that are fixed points.
            within: distance from which a pair without a force needs no features [m].
        """
        self.restore(contents)
        before, features = self.loaded.copy(), self.packed.copy()
        kept = np.zeros(self.n, dtype=bool)
        kept[carries] = True
        self._clear()
        for i in near:
            places = np.arange(i * SLOTS, (i + 1) * SLOTS)
            old = places[before[places]]
            X = self.pose(data, i)
            if not kept[places].any() and distance(self.pairs[i], X)[0] > within:
                continue
            present = old[features[old, VANISHED] == 0.0]
            turn = None if dt is None else self._turn(data, i, dt)
            found = touching_features(self.pairs[i], X, turn, features[present])
            self._place(places, {int(j): features[j] for j in old}, found, X, kept, SAME * self.pairs[i].size)
        lost = np.flatnonzero(kept & before & ~self.loaded)
        self.packed[lost, :VANISHED] = features[lost, :VANISHED]
        self.loaded[lost] = True

    def add_missing(self, data: pin.Data, near: np.ndarray, normals: np.ndarray, tol: float) -> bool:
        """Look whether a pair penetrates with features that are in no place, and add them.

        Args:
            data: with the poses of the bodies.
            near: numbers of the pairs that may touch.
            normals: present normals of all places in the world, shape (n, 3).
            tol: penetration that is none [m].

        Returns:
            Whether anything was added.
        """
        added = False
        for i in near:
            places = np.arange(i * SLOTS, (i + 1) * SLOTS)
            here = self._here(i)
            pair, X = self.pairs[i], self.pose(data, i)
            R = data.oMi[pair.joints[0]].rotation
            known = normals[here] @ R
            if self._apart(pair, X, known, tol):
                continue
            before = self.packed[here]
            before[:, NORMAL] = known
            free = [int(j) for j in places if not self.loaded[j]]
            for row in touching_features(pair, X, None, before):
                if gap_along_normal(row, X) >= -tol or not free:
                    continue
                place = free.pop(0)
                self.loaded[place], self.packed[place], added = True, row, True
        return added

    def deepest(self, data: pin.Data, within: float, normals: np.ndarray) -> float:
        """A lower bound of the smallest gap of all pairs, exact where shapes touch; `within` where none is nearer [m].

        Separation along any direction bounds the gap from below; along the normal it is the gap.

        Args:
            data: with the poses of the bodies.
            within: distances above this one need not be exact [m].
            normals: present normals of all places in the world, shape (n, 3).
        """
        lowest = within
        for i in np.flatnonzero(self.bounds(data) < within):
            pair, X = self.pairs[i], self.pose(data, i)
            d, n, _, _ = distance(pair, X)
            if d < 0.1 * pair.size and not isinstance(pair.solids[0], Wall):
                R = data.oMi[pair.joints[0]].rotation
                d = max([separation(pair, X, m) for m in (n, *(normals[self._here(i)] @ R))])
            lowest = min(lowest, d)
        return lowest

    def overlapping(self, data: pin.Data, depth: float) -> list[int]:
        """Numbers of the pairs whose shapes penetrate by more than a depth [m]."""
        found = []
        for i in np.flatnonzero(self.bounds(data) < -depth):
            pair, X = self.pairs[i], self.pose(data, i)
            if distance(pair, X)[0] < self.open_gap * TOUCH and separation(pair, X, nearest(pair, X, None)[0]) < -depth:
                found.append(int(i))
        return found

    def has_rims(self) -> bool:
        """Any feature is a rim or an ellipsoid."""
        here = self.packed[self.loaded]
        return bool(here[:, 9:18].any() or here[:, SIDE + 9 : SIDE + 18].any())

    def _here(self, i: int | np.integer) -> np.ndarray:
        places = np.arange(i * SLOTS, (i + 1) * SLOTS)
        return places[self.packed[places, VANISHED] == 0.0]

    def _apart(self, pair: SolidPair, X: pin.SE3, known: np.ndarray, tol: float) -> bool:
        """The shapes are apart along a known normal, or far from each other."""
        tried: list[np.ndarray] = []
        for n in known:
            if any(n @ m > 1 - 1e-14 for m in tried):
                continue
            if separation(pair, X, n) >= -tol:
                return True
            tried.append(n)
        return not len(known) and distance(pair, X)[0] > tol

    def _turn(self, data: pin.Data, i: int, dt: float) -> np.ndarray:
        """Rotation of B relative to A in a step, in the frame of A."""
        a, b = self.pairs[i].joints
        R_a, R_b = data.oMi[a].rotation, data.oMi[b].rotation
        return dt * (R_a.T @ (R_b @ data.v[b].angular) - data.v[a].angular)

    def _place(
        self,
        places: np.ndarray,
        old: dict[int, np.ndarray],
        found: list[np.ndarray],
        X: pin.SE3,
        kept: np.ndarray,
        same: float,
    ) -> None:
        """Give every feature the place of the nearest one of the step before, or a free one."""
        costs = [
            (_distance(before, row, X), n, j)
            for n, row in enumerate(found)
            for j, before in old.items()
            if before[NORMAL] @ row[NORMAL] > SAME_NORMAL
        ]
        new = dict.fromkeys(range(len(found)), -1)
        for cost, n, j in sorted(costs):
            if cost < same and new[n] < 0 and j not in new.values():
                new[n] = j
        free = [int(j) for j in places if j not in new.values() and not kept[j]]
        for n, row in enumerate(found):
            j = new[n] if new[n] >= 0 else (free.pop(0) if free else -1)
            if j >= 0:
                self.packed[j], self.loaded[j] = row, True


def _distance(old: np.ndarray, new: np.ndarray, X: pin.SE3) -> float:
    """How far two features are from each other, on the side where they are nearer and that is no face [m]."""
    found = []
    for start in (0, SIDE):
        a, b = old[start : start + SIDE], new[start : start + SIDE]
        if not (_is_face(a) or _is_face(b)):
            found.append(float(np.linalg.norm(a[:3] - b[:3]) + np.linalg.norm(a[9:18] - b[9:18]) ** 0.5))
    return min(found) if found else float(np.linalg.norm(_place_in_a(old, X) - _place_in_a(new, X)))


def _is_face(side: np.ndarray) -> bool:
    return bool(side[4:9:2].any())


def _place_in_a(row: np.ndarray, X: pin.SE3) -> np.ndarray:
    return X.act(row[SIDE : SIDE + 3]) if _is_face(row[:SIDE]) else row[:3]
