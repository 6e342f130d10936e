"""Where two shapes touch or are about to: the pairs of features that a step works with.

coal finds the nearest points; where shapes touch, its normal is not exact, so that they are moved apart along the
normal of the step before. The normal picks the features (see `shapes`), whose kinematics `feature_rows` then
computes without any further search. Where one side is a face, `face_clipping` finds what of the other side may come
to rest on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import coal
import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

from ngalpha_pin.collision.face_clipping import resting_points
from ngalpha_pin.collision.features import NORMAL, ON, SIDE, Face, Feature, Look, pack, tangents
from ngalpha_pin.collision.polytope import Polytope
from ngalpha_pin.collision.shapes import Solid, Wall
from ngalpha_pin.collision.surface import farthest_faces, row_is_surface, surface_test
from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.scene.contact import ContactLaw
from ngalpha_pin.scene.friction_ellipse import PlacedEllipse
from ngalpha_pin.scene.surface_velocity import MovingSurface

# shapes closer than this part of the smaller one are moved apart by it before coal looks for the normal
APART = 1e-2
SETTLED = 1 - 1e-12  # cosine between the normals of two looks that agree
LOOKS = 6
# cosine of the angle by which coal's normal may be off: somewhat above sqrt(2 tolerance / distance), 3e-4 for shapes of
# 0.2 m that are moved apart
NEARLY = 1 - 5e-7
TILTED = 1e-3  # by how much a normal is improved at most [rad]
# sine of the angle between straight sides that count as parallel; sharp edges that cross touch in one point, beside
# which their ends are no contacts
PARALLEL, PARALLEL_EDGES = 0.03, 1e-4
# of round shapes that overlap coal finds the depth to the first of these, now and then only to the second one; a huge
# number says so
COAL_TOLERANCES, FAILED = (1e-10, 1e-8, 1e-6), 1e300


@dataclass(frozen=True, eq=False)
class SolidPair:
    """Two convex geometries that may touch in any of their features.

    Attributes:
        name: of both geometries, in the order of the declaration.
        joints: that carry them.
        solids: their shapes in the frames of the joints.
        shapes, placements: the same for coal.
        law: mu, e_N, e_F, contact radius.
        moving: which of the surfaces moves along itself, or None.
        ellipse: of friction, or None.
    """

    name: str
    joints: tuple[int, int]
    solids: tuple[Solid, Solid]
    shapes: tuple[coal.CollisionGeometry, coal.CollisionGeometry]
    placements: tuple[pin.SE3, pin.SE3]
    law: ContactLaw
    moving: MovingSurface | None = None
    ellipse: PlacedEllipse | None = None

    @property
    def size(self) -> float:
        """Size of the smaller shape [m]."""
        return min(s.size for s in self.solids)


def distance(pair: SolidPair, X: pin.SE3) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Signed distance of a pair, normal from A to B and nearest points, for the pose X of joint B in joint A."""
    a, b = pair.solids
    if isinstance(a, Wall):
        normal = a.normal
        if a.two_sided and normal @ (X.act(b.centre) - a.centre) < 0.0:
            normal = -normal
        p = X.act(b.support(-(X.rotation.T @ normal)))
        d = float(normal @ (p - a.centre))
        return d, normal, p - d * normal, p
    placed = [pair.placements[0], X * pair.placements[1]]
    transforms = [coal.Transform3s(p.rotation, p.translation) for p in placed]
    for tolerance in COAL_TOLERANCES:
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        request.gjk_tolerance = request.epa_tolerance = tolerance
        d = float(coal.distance(pair.shapes[0], transforms[0], pair.shapes[1], transforms[1], request, result))
        if d > -FAILED:
            break
    return d, np.array(result.normal), np.array(result.getNearestPoint1()), np.array(result.getNearestPoint2())


def separation(pair: SolidPair, X: pin.SE3, n: np.ndarray) -> float:
    """Distance of the two shapes along a unit normal n from A to B: the gap is its maximum over all n [m]."""
    a, b = pair.solids
    return float(n @ (X.act(b.support(-(X.rotation.T @ n))) - a.support(n)))


def steepest(pair: SolidPair, X: pin.SE3, n: np.ndarray) -> np.ndarray:
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


def nearest(pair: SolidPair, X: pin.SE3, hint: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normal from A to B and nearest points, also where the shapes touch or penetrate a little."""
    d, n, p_A, p_B = distance(pair, X)
    s = APART * pair.size
    if isinstance(pair.solids[0], Wall) or d > s:
        return n, p_A, p_B
    if hint is not None:
        n = hint
    elif abs(d) < 1e-6 * pair.size or not np.isfinite(n).all():
        n = X.act(pair.solids[1].centre) - pair.solids[0].centre
        n = n / max(float(np.linalg.norm(n)), TINY)
    for _ in range(LOOKS):
        before = n
        _, n, p_A, p_B = distance(pair, pin.SE3(X.rotation, X.translation + s * before))
        p_B = p_B - s * before
        if n @ before > SETTLED:
            break
    return n, p_A, p_B


def touching_features(
    pair: SolidPair,
    X: pin.SE3,
    turn: np.ndarray | None,
    before: Sequence[np.ndarray],
    carry: Sequence[np.ndarray] = (),
) -> list[np.ndarray]:
    """Packed rows of the features with which a pair touches or is about to; none where others are surface beside it.

    Args:
        pair: the shapes.
        X: pose of joint B in joint A.
        turn: rotation of B relative to A in the step, in A, shape (3,) [rad]; None where corners must be fixed points.
        before: packed rows of the features of the step before.
        carry: those of them that carry a force.
    """
    hint = before[0][NORMAL] if len(before) else None
    look = Look(turn, np.array([row[:3] for row in before]).reshape(-1, 3))
    look_b = look.seen_from(X.rotation, np.array([row[SIDE : SIDE + 3] for row in before]).reshape(-1, 3))
    n, p_A, p_B = nearest(pair, X, hint)
    a, b = pair.solids
    R, back = X.rotation, X.inverse()
    f_a, f_b = a.feature_at(p_A, n), b.feature_at(back.act(p_B), -(R.T @ n))
    on_a = a.face(n) or (a.face(np.cross(f_a.E[:, 0], f_a.E[:, 1])) if f_a.flat == 2 else None)
    on_b = b.face(-(R.T @ n)) or (b.face(np.cross(f_b.E[:, 0], f_b.E[:, 1])) if f_b.flat == 2 else None)
    if on_a is None and on_b is None:
        on_a, on_b = _flush(pair, X, n)
    found = _on_faces(pair, X, (on_a, on_b), (look, look_b), carry)
    if found:
        return found
    found = _of_edges(pair, X, (f_a, f_b), n, (p_A, p_B), (look, look_b))
    if a.exposed is None and b.exposed is None:
        return found
    found = [row for row in found if row_is_surface(pair.solids, X, row)]
    return found or _on_faces(pair, X, farthest_faces(pair.solids, X), (look, look_b), carry)


def _on_faces(
    pair: SolidPair,
    X: pin.SE3,
    faces: tuple[Face | None, Face | None],
    looks: tuple[Look, Look],
    carry: Sequence[np.ndarray],
) -> list[np.ndarray]:
    """What of B rests on a face of A, or else what of A rests on one of B; faces are in the frames of their joints."""
    (a, b), (on_a, on_b) = pair.solids, faces
    if on_a is not None:
        kept = [X.act(row[SIDE : SIDE + 3]) for row in carry]
        corners = b.corners(-(X.rotation.T @ on_a.normal), looks[1]).moved(X)
        points = resting_points(on_a, corners, kept, surface_test(on_a, (a, pin.SE3.Identity()), (b, X)))
        if points:
            return [pack(on_a.feature, p.moved(X.inverse()), on_a.normal) for p in points]
    if on_b is not None:
        plane, kept = _moved_face(on_b, X), [row[:3] for row in carry]
        corners = a.corners(-plane.normal, looks[0])
        points = resting_points(plane, corners, kept, surface_test(plane, (b, X), (a, pin.SE3.Identity())))
        return [pack(p, on_b.feature, -plane.normal) for p in points]
    return []


def _of_edges(
    pair: SolidPair,
    X: pin.SE3,
    sides: tuple[Feature, Feature],
    n: np.ndarray,
    nearest: tuple[np.ndarray, np.ndarray],
    looks: tuple[Look, Look],
) -> list[np.ndarray]:
    """The features at the nearest points, of which neither rests on a face of the other."""
    f_a, f_b = sides
    parallel = PARALLEL_EDGES if f_a.r == f_b.r == 0.0 else PARALLEL
    if f_a.flat == f_b.flat == 1:
        across = np.cross(f_a.E[:, 0], X.rotation @ f_b.E[:, 0])
        sine = float(np.linalg.norm(across))
        if sine < parallel:
            return _parallel(pair, X, sides, n, nearest, looks)
        n = across / np.copysign(sine, across @ n)  # coal's normal is nearly that of the two lines
    if f_a.flat + f_b.flat > 2:  # beside a face, an edge or another face has no point of its own
        if pair.solids[0].exposed is not None or pair.solids[1].exposed is not None:
            return []
        f_b = replace(f_b, c=X.actInv(nearest[1]), E=np.zeros((3, 2)))
    return [pack(f_a, f_b, n)]


def _flush(pair: SolidPair, X: pin.SE3, n: np.ndarray) -> tuple[Face | None, Face | None]:
    """Two faces so nearly parallel that coal's normal may be anywhere between theirs; the one that keeps them apart."""
    a, b = pair.solids
    on_a, on_b = a.face(n, NEARLY), b.face(-(X.rotation.T @ n), NEARLY)
    if on_a is None or on_b is None:
        return None, None
    if separation(pair, X, on_a.normal) < separation(pair, X, -(X.rotation @ on_b.normal)):
        return None, on_b
    return on_a, on_b


def _moved_face(on: Face, X: pin.SE3) -> Face:
    corners = None if on.corners is None else on.corners @ X.rotation.T + X.translation
    return Face(on.feature.moved(X), X.rotation @ on.normal, corners)


def _parallel(
    pair: SolidPair,
    X: pin.SE3,
    sides: tuple[Feature, Feature],
    n: np.ndarray,
    nearest: tuple[np.ndarray, np.ndarray],
    looks: tuple[Look, Look],
) -> list[np.ndarray]:
    """Two straight sides along each other: the ends of what they share, as points of B against the line of A."""
    f_a, f_b = sides
    e, back, near = f_a.E[:, 0], X.inverse(), ON * pair.size
    a, b = pair.solids
    corners, ends = a.corners(n, looks[0]).support(n), b.corners(-(X.rotation.T @ n), looks[1]).moved(X)
    # a box that stands beside an edge offers all corners of its face
    span_A = corners[_from_line(corners, nearest[0], e) < near] @ e
    ends = ends[_from_line(ends.support(-n), nearest[1], X.rotation @ f_b.E[:, 0]) < near]
    if not (len(span_A) and len(ends)):
        return [pack(f_a, replace(f_b, E=np.zeros((3, 2))), n)]
    along = ends.support(-n) @ e
    low, high = int(np.argmin(along)), int(np.argmax(along))
    first, last = max(span_A.min(), along[low]), min(span_A.max(), along[high])
    width = along[high] - along[low]
    if not (last > first and width > 0.0):
        return [pack(f_a, replace(f_b, E=np.zeros((3, 2))), n)]
    parts = (np.array([first, last]) - along[low]) / width
    between = ends.between(np.array([low, low]), np.array([high, high]), parts, -n).moved(back)
    return [pack(f_a, between.feature(i), n) for i in (0, 1)]


def _from_line(points: np.ndarray, through: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Distances of points from the line through a point in the direction e."""
    away = points - through
    return np.asarray(np.sqrt(((away - (away @ e)[:, None] * e) ** 2).sum(axis=1)))
