"""Two shapes that may touch, as the engine knows them: their distance and the features with which they touch.

The compiled part is `engine/narrow_phase.cpp`: it has one call of coal for a look at the nearest points, the features
there, and what of one shape may come to rest on a face of the other, as packed rows (see `features`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

from ngalpha_pin import engine
from ngalpha_pin.collision.features import tangents
from ngalpha_pin.collision.polytope import Polytope
from ngalpha_pin.collision.shapes import Solid, Wall
from ngalpha_pin.scene.contact import ContactLaw
from ngalpha_pin.scene.friction_ellipse import PlacedEllipse
from ngalpha_pin.scene.surface_velocity import MovingSurface

TILTED = 1e-3  # by how much a normal is improved at most [rad]
# shapes nearer than this part of the smaller one are looked at along all normals that they have
NEAR = 0.1


@dataclass(frozen=True, eq=False)
class SolidPair:
    """Two convex geometries that may touch in any of their features.

    Attributes:
        name: of both geometries, in the order of the declaration.
        joints: that carry them.
        solids: their shapes in the frames of the joints.
        shapes, placements: the same for coal, shapes as the engine holds them, None for half-spaces and planes.
        law: mu, e_N, e_F, contact radius.
        moving: which of the surfaces moves along itself, or None.
        ellipse: of friction, or None.
    """

    name: str
    joints: tuple[int, int]
    solids: tuple[Solid, Solid]
    shapes: tuple[Any, Any]
    placements: tuple[pin.SE3, pin.SE3]
    law: ContactLaw
    moving: MovingSurface | None = None
    ellipse: PlacedEllipse | None = None

    @property
    def size(self) -> float:
        """Size of the smaller shape [m]."""
        return min(s.size for s in self.solids)

    @cached_property
    def native(self) -> Any:
        """The pair in the engine."""
        (a, b), (at_a, at_b) = self.solids, self.placements
        poses = (at_a.rotation, at_a.translation, at_b.rotation, at_b.translation)
        return engine.ShapePair(a.native, b.native, *self.shapes, *poses)


def distance(pair: SolidPair, X: pin.SE3) -> float:
    """Signed distance of a pair, for the pose X of joint B in joint A [m]."""
    return float(pair.native.distance(X.rotation, X.translation)[0])


def separation(pair: SolidPair, X: pin.SE3, n: np.ndarray) -> float:
    """Distance of the two shapes along a unit normal n from A to B: the gap is its maximum over all n [m]."""
    return float(pair.native.separation(X.rotation, X.translation, n))


def overlap(pair: SolidPair, X: pin.SE3) -> float:
    """Separation of a pair along the normal at its nearest points, where it is near [m]."""
    return separation(pair, X, pair.native.nearest(X.rotation, X.translation)[1])


def gap(pair: SolidPair, X: pin.SE3, known: np.ndarray) -> float:
    """Distance of a pair, or a lower bound of it, exact where the shapes touch [m].

    Separation along any direction bounds the gap from below; along the normal it is the gap.

    Args:
        pair: the shapes.
        X: pose of joint B in joint A.
        known: normals along which the shapes may touch, in A, shape (n, 3).
    """
    R, p = X.rotation, X.translation
    d, n, _, _ = pair.native.distance(R, p)
    if d >= NEAR * pair.size or isinstance(pair.solids[0], Wall):
        return float(d)
    d = max(separation(pair, X, m) for m in (n, *known))
    if d < 0.0:  # where shapes touch, coal has no normal, but their faces have
        tried = np.concatenate((pair.native.normals(R, p), n[None]))
        d = max([d, *(separation(pair, X, m) for m in (*tried, _steepest(pair, X, tried[0])))])
    return d


def _steepest(pair: SolidPair, X: pin.SE3, n: np.ndarray) -> np.ndarray:
    """The normal near n along which two polytopes that touch are furthest apart; n where one of them is none.

    There the separation is a concave function of the normal: a linear program in two tangents and the heights of both.
    """
    a, b = pair.solids
    if not (isinstance(a, Polytope) and isinstance(b, Polytope)):
        return n
    t, V, W = tangents(n), a.V / pair.size, (b.V @ X.rotation.T + X.translation) / pair.size
    below = np.column_stack((V @ t.T, -np.ones(len(V)), np.zeros(len(V))))
    above = np.column_stack((-W @ t.T, np.zeros(len(W)), np.ones(len(W))))
    heights = np.concatenate(((V @ n).max() - V @ n, W @ n - (W @ n).min())) / TILTED
    bounds = [(-1.0, 1.0), (-1.0, 1.0), (None, None), (None, None)]
    found = linprog([0.0, 0.0, 1.0, -1.0], np.concatenate((below, above)), heights, bounds=bounds).x
    if found is None:
        return n
    better = n + TILTED * found[:2] @ t
    return np.asarray(better / np.linalg.norm(better))
