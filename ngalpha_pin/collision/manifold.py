"""The contacts between shapes whose touching features change: a fixed number of places for every pair.

At the start of a step the pairs that are near get the features with which they may touch in that step; they stay the
same while the equations of the step are solved. A feature keeps the place of the one that was there in the step before,
so that its force goes on. A feature that appears starts without a force in the step before. One that vanishes while it
carries a force keeps its place as an open contact until its auxiliary force (96) has died away.
"""

from __future__ import annotations

import math
from copy import copy

import numpy as np
import pinocchio as pin

from ngalpha_pin import engine
from ngalpha_pin.collision.broad_phase import Proximity
from ngalpha_pin.collision.contact_points import ContactPoints, Surface
from ngalpha_pin.collision.features import SIDE, VANISHED, Feature, face, pack
from ngalpha_pin.collision.narrow_phase import SolidPair, gap, overlap

SLOTS = engine.SLOTS  # places of every pair
TOUCH_STEPS = engine.TOUCH_STEPS  # shapes nearer than this many times the motion of one step get their features
# distance from which coal's word on whether shapes overlap is taken, in parts of the size of the scene
TOUCH = 1e-5
# a direction in which no mechanism is likely to be unable to move a point
SOMEWHERE = np.array([0.3567, 0.8321, 0.4249]) / np.linalg.norm([0.3567, 0.8321, 0.4249])
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
        native: the same in the engine, see `engine/places.hpp`.
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
        self.native = engine.Places(self.proximity.native)
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

        Every feature gets the place of the nearest one of the step before, or a free one.

        Args:
            data: with poses and velocities of the bodies.
            contents: what was in the places in the step before.
            carries: numbers of the places whose contacts carry a force, or have just done so.
            dt: length of the step [s]; None for corners that are fixed points.
            within: pairs have features from this distance, even where they are at rest [m].
        """
        self._clear()
        step = math.nan if dt is None else dt
        self.native.load(self.proximity.bodies(data), contents, carries.tolist(), step, within, *self._table)

    def add_missing(self, data: pin.Data, normals: np.ndarray, tol: float) -> np.ndarray:
        """Look whether a pair penetrates with features that are in no place, and add them; their places, increasing.

        Where all places of a pair are taken, an open one is given away that the step has not begun with.

        Args:
            data: with the poses of the bodies.
            normals: present normals of the places that are taken, in order, in the world, shape (taken, 3).
            tol: penetration that is none [m].
        """
        places = self.native.add_missing(self.proximity.bodies(data), normals, tol, *self._table)
        return np.unique(np.array(places, dtype=int))

    @property
    def _table(self) -> tuple[np.ndarray, ...]:
        return self.packed, self.loaded, self.mobility

    def deepest(self, data: pin.Data, within: float, normals: np.ndarray) -> float:
        """A lower bound of the smallest gap of all pairs, exact where shapes touch; `within` where none is nearer [m].

        Separation along any direction bounds the gap from below; along the normal it is the gap.

        Args:
            data: with the poses of the bodies.
            within: distances above this one need not be exact [m].
            normals: present normals of the places that are taken, in order, in the world, shape (taken, 3).
        """
        lowest, of_pair = within, _by_pair(np.flatnonzero(self.loaded).tolist(), normals)
        pairs, bounds = self.proximity.bounds(data, np.full(len(self.pairs), within))
        for k in np.argsort(bounds, kind="stable"):
            if bounds[k] > lowest:
                break
            i = int(pairs[k])
            known = np.array([n for j, n in of_pair.get(i, ()) if self.packed[j, VANISHED] == 0.0]).reshape(-1, 3)
            R = data.oMi[self.pairs[i].joints[0]].rotation
            lowest = min(lowest, gap(self.pairs[i], self.pose(data, i), known @ R))
        return lowest

    def overlapping(self, data: pin.Data, depth: float) -> list[int]:
        """Numbers of the pairs whose shapes penetrate by more than a depth [m]."""
        found = []
        for i in self.proximity.within(data, self.open_gap * TOUCH):
            if overlap(self.pairs[i], self.pose(data, i)) < -depth:
                found.append(int(i))
        return found

    def has_rims(self) -> bool:
        """Any feature is a rim or an ellipsoid."""
        here = self.packed[self.loaded]
        return bool(here[:, 9:18].any() or here[:, SIDE + 9 : SIDE + 18].any())

    def features(
        self,
        i: int,
        X: pin.SE3,
        turn: np.ndarray | None,
        before: np.ndarray,
        carry: np.ndarray,
    ) -> np.ndarray:
        """Packed rows of the features with which a pair may touch, shape (n, WIDTH).

        Without those whose gap no motion of the mechanism changes. They are a function of the arguments; the last
        answer is kept for bodies that do not move.

        Args:
            i: number of the pair.
            X: pose of joint B in joint A.
            turn: rotation of B relative to A in a step, in A, shape (3,) [rad]; None where corners are fixed points.
            before: rows of the features of the step before, shape (n, WIDTH).
            carry: those of them that carry a force.
        """
        found = self.native.features(i, X.rotation, X.translation, turn, before, carry, self.mobility)
        return np.asarray(found)


def apart(new: np.ndarray, old: np.ndarray, X: pin.SE3) -> np.ndarray:
    """How far features are from each other, on the side where they are nearer and that is no face [m].

    Args:
        new: packed rows, shape (n, WIDTH).
        old: likewise, shape (m, WIDTH).
        X: pose of joint B in joint A.

    Returns:
        Distances, infinite between features of different normals, shape (n, m).
    """
    return np.asarray(engine.apart(new, old, X.rotation, X.translation))


def _by_pair(places: list[int], normals: np.ndarray) -> dict[int, list[tuple[int, np.ndarray]]]:
    """Places with their normals, by the pairs that they belong to."""
    found: dict[int, list[tuple[int, np.ndarray]]] = {}
    for j, n in zip(places, normals, strict=True):
        found.setdefault(j // SLOTS, []).append((j, n))
    return found
