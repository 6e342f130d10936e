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
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin import engine
from ngalpha_pin.collision.narrow_phase import SolidPair
from ngalpha_pin.collision.shapes import Wall
from ngalpha_pin.numerics.spatial import dot

# part of the size of a pair by which a distance that coal finds may be too large
DOUBT = 1e-6


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
        self._two_sided = np.array([isinstance(s, Wall) and s.two_sided for s in a], dtype=bool)
        self._doubt = DOUBT * np.array([p.size for p in pairs])
        joints = max(int(self._a.max(initial=0)), int(self._b.max(initial=0))) + 1
        self._extent = np.zeros(joints)
        for joint, centres, solids in ((self._a, self._centres_a, a), (self._b, self._centres_b, b)):
            sizes = np.array([0.0 if isinstance(s, Wall) else 0.5 * s.size for s in solids])
            np.maximum.at(self._extent, joint, np.sqrt(dot(centres, centres)) + sizes)
        points = [self._centres_a, self._centres_b, self._walls]
        numbers = [x.tolist() for x in (self._size_b, self._radii, self._doubt, self._extent)]
        typical = float(np.median([p.size for p in pairs])) if pairs else 0.0
        self.native = engine.NearPairs.of(
            [p.native for p in pairs],
            self._a.tolist(),
            self._b.tolist(),
            points,
            numbers,
            self._two_sided.tolist(),
            typical,
        )
        self._data: pin.Data | None = None

    def fresh(self) -> Proximity:
        """The same, before any look."""
        found = copy(self)
        found.native, found._data = self.native.fresh(), None
        return found

    def bodies(self, data: pin.Data) -> Any:
        """Where Pinocchio writes poses and velocities of the joints, for the engine."""
        if self._data is not data:
            parts = [[x.rotation for x in data.oMi], [x.translation for x in data.oMi]]
            parts += [[x.linear for x in data.v], [x.angular for x in data.v]]
            self._data, self._bodies = data, engine.Bodies(*([x.ctypes.data for x in part] for part in parts))
        return self._bodies

    def within(self, data: pin.Data, reach: float, ahead: float = 0.0) -> np.ndarray:
        """Numbers of the pairs whose distance is not above a reach.

        Args:
            data: with the poses of the bodies and, where `ahead` is not zero, their velocities.
            reach: the same for all [m].
            ahead: time for which the pairs approach each other in addition [s].
        """
        return np.array(self.native.within(self.bodies(data), reach, ahead), dtype=int)

    def forget(self) -> None:
        """Look at all pairs the next time."""
        self.native.forget()

    def bounds(
        self, data: pin.Data, reach: np.ndarray, among: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pairs that spheres around them do not prove to be farther than `reach`, with lower bounds of the distances.

        Args:
            data: with the poses of the bodies.
            reach: of every pair that is looked at [m].
            among: numbers of these pairs; None for all.
        """
        every = np.arange(len(self.pairs)) if among is None else among
        i, lower = self.native.bounds(self.bodies(data), every.tolist(), reach.tolist())
        return np.array(i, dtype=int), np.array(lower)

    def look(self, data: pin.Data, i: int | np.integer) -> float:
        """Distance of a pair [m]."""
        return float(self.native.look(self.bodies(data), int(i)))

    def pose(self, data: pin.Data, i: int | np.integer) -> pin.SE3:
        """Pose of joint B in joint A of a pair."""
        return data.oMi[int(self._a[i])].actInv(data.oMi[int(self._b[i])])

    def speeds(self, data: pin.Data, i: np.ndarray) -> np.ndarray:
        """Bounds of the speed of any point of B seen from A of some pairs, shape (k,) [m/s]."""
        return np.array(self.native.speeds(self.bodies(data), i.tolist()))
