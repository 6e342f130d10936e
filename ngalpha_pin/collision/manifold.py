"""The contacts between shapes whose touching features change: a fixed number of places for every pair.

At the start of a step the pairs that are near get the features with which they may touch in that step; they stay the
same while the equations of the step are solved. A feature keeps the place of the one that was there in the step before,
so that its force goes on. A feature that appears starts without a force in the step before. One that vanishes while it
carries a force keeps its place as an open contact until its auxiliary force (96) has died away.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from copy import copy

import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.broad_phase import Proximity
from ngalpha_pin.collision.contact_points import ContactPoints, Surface
from ngalpha_pin.collision.features import NORMAL, SIDE, VANISHED, Feature, face, gap_along_normal, pack
from ngalpha_pin.collision.narrow_phase import SolidPair, distance, nearest, separation, steepest, touching_features
from ngalpha_pin.collision.shapes import Wall
from ngalpha_pin.collision.surface import farthest_faces
from ngalpha_pin.common.tolerances import MOVABLE

SLOTS = 12
# shapes whose distance is below this many times the possible motion of one step get their features
TOUCH_STEPS = 3.0
# distance from which coal's word on whether shapes overlap is taken, in parts of the size of the scene
TOUCH = 1e-5
# a direction in which no mechanism is likely to be unable to move a point
SOMEWHERE = np.array([0.3567, 0.8321, 0.4249]) / np.linalg.norm([0.3567, 0.8321, 0.4249])
# features further apart than this part of the smaller shape, or with normals this different, are not the same one
SAME, SAME_NORMAL = 0.2, 0.5
# poses and turns for which features are chosen, in parts of the size of a pair and of a radian: bodies at rest quiver
# by less than this, and what is chosen for the one pose serves the other; gaps are those of the pose itself
GRID = 2.0**-48
# what is in an empty place: a corner on a plane, with the gap of what has vanished
EMPTY = pack(face(np.zeros(3), np.array([0.0, 0.0, 1.0])), Feature(np.zeros(3)), np.array([0.0, 0.0, 1.0]))


class Slots:
    """Pairs of solids and the features that are in their places.

    Args:
        pairs: the shapes.

    Attributes:
        proximity: which of them are near.
        n: number of places, SLOTS for every pair.
        packed: features, shape (n, WIDTH); see `features`.
        loaded: which places are taken, shape (n,).
        open_gap: gap of an empty place [m].
        mobility: Gram matrix of the ways of B relative to A, in the axes of A, shape (n_pairs, 3, 3).
    """

    def __init__(self, pairs: list[SolidPair]):
        self.pairs, self.proximity = pairs, Proximity(pairs)
        self.n = SLOTS * len(pairs)
        self.mobility = np.tile(np.eye(3), (len(pairs), 1, 1))
        self._empty(1.0)

    def fresh(self) -> Slots:
        """The same for another system: places are empty, and no pair has been looked at."""
        found = copy(self)
        found.proximity = self.proximity.fresh()
        found._empty(self.open_gap)
        return found

    def _empty(self, gap: float) -> None:
        self.packed = np.tile(EMPTY, (self.n, 1))
        self.loaded = np.zeros(self.n, dtype=bool)
        self._chosen: list[tuple[bytes, list[np.ndarray]]] = [(b"", [])] * len(self.pairs)
        self.open_with(gap)

    def open_with(self, gap: float) -> None:
        """Set the gap of empty places [m]."""
        self.open_gap = gap
        self.packed[~self.loaded, VANISHED] = gap

    def stand_ins(self) -> list[ContactPoints]:
        """One contact point for every place, with name, joints, law and size of the pair; its geometry is not used."""
        found: list[ContactPoints] = []
        zero = np.zeros(3)
        for pair in self.pairs:
            a, b = pair.solids
            point = (float(np.linalg.norm(b.centre)) + 0.5 * b.size) * SOMEWHERE
            extent = float(np.linalg.norm(a.centre)) + 0.5 * a.size
            surface = Surface(pair.joints[0], zero, 0.0, zero, zero, extent, np.inf, 1.0)
            names, points = tuple(f"{pair.name}[{i}]" for i in range(SLOTS)), np.tile(point, (SLOTS, 1))
            of_both = surface, pair.law, pair.moving, pair.ellipse
            found.append(ContactPoints(names, pair.joints[1], points, points, 0.0, *of_both))
        return found

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
        taken = np.flatnonzero(self.loaded)
        self.loaded[taken] = False
        self.packed[taken] = EMPTY
        self.packed[taken, VANISHED] = self.open_gap

    def pose(self, data: pin.Data, i: int | np.integer) -> pin.SE3:
        """Pose of joint B in joint A of a pair."""
        return self.proximity.pose(data, i)

    def load(self, data: pin.Data, contents: np.ndarray, carries: np.ndarray, dt: float | None, within: float) -> None:
        """Fill the places at the start of a step with the features of the pairs that may touch in it.

        Args:
            data: with poses and velocities of the bodies.
            contents: what was in the places in the step before.
            carries: numbers of the places whose contacts carry a force, or have just done so.
            dt: length of the step [s]; None for corners that are fixed points.
            within: pairs have features from this distance, even where they are at rest [m].
        """
        self._clear()
        old = dict(zip(contents[:, 0].astype(int).tolist(), contents[:, 1:], strict=True))
        kept = set(carries.tolist())
        near = self.proximity.within(data, within, 0.0 if dt is None else TOUCH_STEPS * dt)
        pairs = np.union1d(near, carries // SLOTS)
        for i in pairs.tolist():
            here = {j: old[j] for j in range(i * SLOTS, (i + 1) * SLOTS) if j in old}
            present = [row for row in here.values() if row[VANISHED] == 0.0]
            X = self.pose(data, i)
            carry = [row for j, row in here.items() if j in kept and row[VANISHED] == 0.0]
            found = self.features(i, X, None if dt is None else self._turn(data, i, dt), present, carry)
            self._place(i, here, found, X, kept)
        for j in kept:
            if j in old and not self.loaded[j]:
                self.packed[j, :VANISHED], self.loaded[j] = old[j][:VANISHED], True

    def add_missing(self, data: pin.Data, normals: np.ndarray, tol: float) -> None:
        """Look whether a pair penetrates with features that are in no place, and add them.

        Args:
            data: with the poses of the bodies.
            normals: present normals of the places that are taken, in order, in the world, shape (taken, 3).
            tol: penetration that is none [m].
        """
        of_place = dict(zip(np.flatnonzero(self.loaded).tolist(), normals, strict=True))
        of_pair = self._by_pair(of_place)
        for i in {*of_pair, *self.proximity.within(data, tol).tolist()}:
            here = [j for j in of_pair.get(i, ()) if self.packed[j, VANISHED] == 0.0]
            pair, X = self.pairs[i], self.pose(data, i)
            known = np.array([of_place[j] for j in here]).reshape(-1, 3) @ data.oMi[pair.joints[0]].rotation
            if self._apart(pair, X, known, tol):
                continue
            before = self.packed[here]
            before[:, NORMAL] = known
            free = [j for j in range(i * SLOTS, (i + 1) * SLOTS) if not self.loaded[j]]
            for row in self.features(i, X, None, before):
                if gap_along_normal(row, X) >= -tol or not free:
                    continue
                place = free.pop(0)
                self.loaded[place], self.packed[place] = True, row

    def deepest(self, data: pin.Data, within: float, normals: np.ndarray) -> float:
        """A lower bound of the smallest gap of all pairs, exact where shapes touch; `within` where none is nearer [m].

        Separation along any direction bounds the gap from below; along the normal it is the gap.

        Args:
            data: with the poses of the bodies.
            within: distances above this one need not be exact [m].
            normals: present normals of the places that are taken, in order, in the world, shape (taken, 3).
        """
        lowest, of_place = within, dict(zip(np.flatnonzero(self.loaded).tolist(), normals, strict=True))
        of_pair = self._by_pair(of_place)
        pairs, bounds = self.proximity.bounds(data, np.full(len(self.pairs), within))
        for k in np.argsort(bounds, kind="stable"):
            if bounds[k] > lowest:
                break
            i = int(pairs[k])
            pair, X = self.pairs[i], self.pose(data, i)
            d, n, _, _ = distance(pair, X)
            if d < 0.1 * pair.size and not isinstance(pair.solids[0], Wall):
                R = data.oMi[pair.joints[0]].rotation
                known = [of_place[j] @ R for j in of_pair.get(i, ()) if self.packed[j, VANISHED] == 0.0]
                d = max(separation(pair, X, m) for m in (n, *known))
                if d < 0.0:  # where shapes touch, coal has no normal, but their faces have
                    found = touching_features(pair, X, None, ())
                    on_a, on_b = farthest_faces(pair.solids, X)
                    tried = [row[NORMAL] for row in found] + ([] if on_a is None else [on_a.normal])
                    tried += [n] if on_b is None else [-(X.rotation @ on_b.normal)]
                    d = max([d, *(separation(pair, X, m) for m in (*tried, steepest(pair, X, tried[0])))])
            lowest = min(lowest, d)
        return lowest

    def overlapping(self, data: pin.Data, depth: float) -> list[int]:
        """Numbers of the pairs whose shapes penetrate by more than a depth [m]."""
        found = []
        for i in self.proximity.within(data, self.open_gap * TOUCH):
            pair, X = self.pairs[i], self.pose(data, i)
            if separation(pair, X, nearest(pair, X, None)[0]) < -depth:
                found.append(int(i))
        return found

    def has_rims(self) -> bool:
        """Any feature is a rim or an ellipsoid."""
        here = self.packed[self.loaded]
        return bool(here[:, 9:18].any() or here[:, SIDE + 9 : SIDE + 18].any())

    def _by_pair(self, places: Iterable[int]) -> dict[int, list[int]]:
        """Some places, by the pairs that they belong to."""
        found: dict[int, list[int]] = {}
        for j in places:
            found.setdefault(j // SLOTS, []).append(j)
        return found

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

    def features(
        self,
        i: int,
        X: pin.SE3,
        turn: np.ndarray | None,
        before: Iterable[np.ndarray],
        carry: Sequence[np.ndarray] = (),
    ) -> list[np.ndarray]:
        """Features with which a pair may touch, without those whose gap no motion of the mechanism changes.

        They are a function of the arguments; the last answer is kept for bodies that do not move.
        """
        pair, before = self.pairs[i], list(before)
        R, p = _on_grid(X.rotation, 1.0), _on_grid(X.translation, pair.size)
        turn = None if turn is None else _on_grid(turn, 1.0)
        asked = b"|".join(b"".join(x.tobytes() for x in part) for part in ((R, p), before, carry))
        asked += b"" if turn is None else turn.tobytes()
        last, chosen = self._chosen[i]
        if asked != last:
            G = self.mobility[i]
            least = MOVABLE**2 * float(np.trace(G))
            found = touching_features(pair, pin.SE3(R, p), turn, before, carry)
            chosen = [x for x in found if x[NORMAL] @ G @ x[NORMAL] > least]
            self._chosen[i] = asked, chosen
        return chosen

    def _turn(self, data: pin.Data, i: int, dt: float) -> np.ndarray:
        """Rotation of B relative to A in a step, in the frame of A."""
        a, b = self.pairs[i].joints
        R_a, R_b = data.oMi[a].rotation, data.oMi[b].rotation
        return dt * (R_a.T @ (R_b @ data.v[b].angular) - data.v[a].angular)

    def _place(self, i: int, old: dict[int, np.ndarray], found: list[np.ndarray], X: pin.SE3, kept: set[int]) -> None:
        """Give every feature of a pair the place of the nearest one of the step before, or a free one."""
        places = {row.tobytes(): j for j, row in old.items()}
        new = {n: places.get(row.tobytes(), -1) for n, row in enumerate(found)}
        if len(set(new.values())) < len(new) or -1 in new.values():  # not all of them are there as they were
            new = dict.fromkeys(new, -1)
        if old and found and -1 in new.values():
            numbers, costs = list(old), apart(np.array(found), np.array(list(old.values())), X)
            taken: set[int] = set()
            for k in np.argsort(costs, axis=None, kind="stable"):
                n, j = divmod(int(k), len(old))
                if not costs[n, j] < SAME * self.pairs[i].size:
                    break
                if new[n] < 0 and numbers[j] not in taken:
                    new[n] = numbers[j]
                    taken.add(numbers[j])
        used = set(new.values()) | kept
        free = [j for j in range(i * SLOTS, (i + 1) * SLOTS) if j not in used]
        for n, row in enumerate(found):
            j = new[n] if new[n] >= 0 else (free.pop(0) if free else -1)
            if j >= 0:
                self.packed[j], self.loaded[j] = row, True


def _on_grid(x: np.ndarray, size: float) -> np.ndarray:
    """Numbers rounded to a grid that is fine beside a size, and a power of two, so that they are exact."""
    grid = GRID * 2.0 ** math.floor(math.log2(size))
    return np.asarray(np.round(x / grid) * grid + 0.0)  # no zero has a sign


def apart(new: np.ndarray, old: np.ndarray, X: pin.SE3) -> np.ndarray:
    """How far features are from each other, on the side where they are nearer and that is no face [m].

    Args:
        new: packed rows, shape (n, WIDTH).
        old: likewise, shape (m, WIDTH).
        X: pose of joint B in joint A.

    Returns:
        Distances, infinite between features of different normals, shape (n, m).
    """
    found = np.full((len(new), len(old)), np.inf)
    for start in (0, SIDE):
        a, b = new[:, None, start : start + SIDE], old[None, :, start : start + SIDE]
        away = np.sqrt(((a - b)[:, :, :3] ** 2).sum(axis=2))
        away += np.sqrt(np.sqrt(((a - b)[:, :, 9:18] ** 2).sum(axis=2)))
        found = np.where(_is_face(a) | _is_face(b), found, np.minimum(found, away))
    if not np.isfinite(found).all():
        places = [np.where(_is_face(x)[:, None], _in_a(x, X), x[:, :3]) for x in (new, old)]
        away = np.sqrt(((places[0][:, None] - places[1][None]) ** 2).sum(axis=2))
        found = np.where(np.isfinite(found), found, away)
    return np.where(new[:, NORMAL] @ old[:, NORMAL].T > SAME_NORMAL, found, np.inf)


def _is_face(side: np.ndarray) -> np.ndarray:
    """Whether a side, or the side A of a row, has two straight directions."""
    return np.asarray(side[..., 4:9:2].any(axis=-1))


def _in_a(rows: np.ndarray, X: pin.SE3) -> np.ndarray:
    """Points of side B in the frame of A."""
    return rows[:, SIDE : SIDE + 3] @ X.rotation.T + X.translation
