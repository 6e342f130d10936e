"""Shapes from their numbers alone: support functions, distances of points, and what they prove of a distance.

The distance of two convex shapes A and B is at least their separation along any unit normal n, -h_A(n) - h_B(-n) with
the support functions h, and at most the distance of any two of their points. Where both agree, they are the distance.
"""

from itertools import combinations

import coal
import numpy as np
from scipy.optimize import nnls

UNIT = 1e3  # weight of "parts sum up to one" beside metres


def corners(shape):
    """Points of which a polyhedral shape is the hull, shape (n, 3); None for a round one."""
    if isinstance(shape, coal.Box):
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return signs * np.array(shape.halfSide)
    if isinstance(shape, coal.TriangleP):
        return np.array([shape.a, shape.b, shape.c])
    if isinstance(shape, coal.BVHModelBase):
        return np.array(shape.vertices())
    return np.array(shape.points()) if isinstance(shape, coal.ConvexBase) else None


def reach(shape, m):
    """Support function in the frame of the shape: the largest m . x of its points, for a unit vector m."""
    across = np.hypot(m[0], m[1])
    if isinstance(shape, coal.Sphere):
        return shape.radius
    if isinstance(shape, coal.Capsule):
        return shape.radius + shape.halfLength * abs(m[2])
    if isinstance(shape, coal.Ellipsoid):
        return np.linalg.norm(np.array(shape.radii) * m)
    if isinstance(shape, coal.Cylinder):
        return shape.radius * across + shape.halfLength * abs(m[2])
    if isinstance(shape, coal.Cone):
        return max(shape.radius * across - shape.halfLength * m[2], shape.halfLength * m[2])
    return (corners(shape) @ m).max()


def outside(shape, x):
    """Distance of a point from the shape, in its frame; of an ellipsoid or a hull no less than it, and zero with it."""
    points, across = corners(shape), np.hypot(x[0], x[1])
    if isinstance(shape, coal.Box):
        return np.linalg.norm(np.maximum(np.abs(x) - np.array(shape.halfSide), 0.0))
    if points is not None:
        # the nearest sum of corners with positive parts
        parts, _ = nnls(np.vstack((points.T, np.full(len(points), UNIT))), np.append(x, UNIT))
        return np.linalg.norm(parts / parts.sum() @ points - x)
    if isinstance(shape, coal.Sphere):
        return max(np.linalg.norm(x) - shape.radius, 0.0)
    if isinstance(shape, coal.Capsule):
        return max(np.hypot(across, max(abs(x[2]) - shape.halfLength, 0.0)) - shape.radius, 0.0)
    if isinstance(shape, coal.Ellipsoid):
        scale = np.linalg.norm(x / np.array(shape.radii))  # x / scale is on its surface
        return max(1.0 - 1.0 / scale, 0.0) * np.linalg.norm(x)
    if isinstance(shape, coal.Cylinder):
        return np.hypot(max(across - shape.radius, 0.0), max(abs(x[2]) - shape.halfLength, 0.0))
    # a cone: below its face, in it, or beside the line from its rim to its tip
    side = np.array([-shape.radius, 2 * shape.halfLength])
    away = np.array([across - shape.radius, x[2] + shape.halfLength])
    if away[1] <= 0.0 and away[0] <= 0.0:
        return -away[1]
    if away[1] >= 0.0 and side[1] * away[0] <= side[0] * away[1]:
        return 0.0
    along = np.clip(away @ side / (side @ side), 0.0, 1.0)
    return np.linalg.norm(away - along * side)


def bounds_of_distance(shapes, poses, n, points):
    """Proven lower and upper bound of the distance of two shapes from a unit normal and two points in the world."""
    lower, upper = 0.0, np.linalg.norm(points[1] - points[0])
    for shape, pose, m, p in zip(shapes, poses, (n, -n), points, strict=True):
        local = pose.rotation.T @ m
        lower -= m @ pose.translation + reach(shape, local)
        upper += outside(shape, pose.actInv(p))
    return lower, upper


def distance_of_segments(a, b):
    """Distance of two segments, each of shape (2, 3): of the lines, or of an end from the other segment."""
    x, y, d = a[1] - a[0], b[1] - b[0], a[0] - b[0]
    s, t = np.linalg.lstsq(np.column_stack((x, -y)), -d, rcond=None)[0]
    found = [np.linalg.norm(d + s * x - t * y)] if 0 <= s <= 1 and 0 <= t <= 1 else []
    for p, line in ((a[0], b), (a[1], b), (b[0], a), (b[1], a)):
        e = line[1] - line[0]
        found.append(np.linalg.norm(p - line[0] - np.clip((p - line[0]) @ e / (e @ e), 0, 1) * e))
    return min(found)


def check_gap(scene, system, rows, k):
    """The gap of contact k between "a" and "b" is their distance, up to rounding.

    A cone is, where its side is touched, the cylinder that has its curvature at the nearest point of coal, which is
    exact to the root of its tolerance of 1e-10: the gap is too large by no more than that tolerance.
    """
    gap, n, p_B = rows.g_N[k], rows.normals[k], rows.c[k]
    if not system.slots.n:  # two spheres: the point is the centre of "a"
        p_B = p_B - scene.geometry("a").geometry.radius * n
    points = [p_B - gap * n, p_B]
    if not system.slots.n:
        n, points = -n, points[::-1]
    geometries = [scene.geometry(name) for name in "ab"]
    poses = [system.data.oMi[g.parentJoint] * g.placement for g in geometries]
    shapes = [g.geometry for g in geometries]
    lower, upper = bounds_of_distance(shapes, poses, n, points)
    cone = any(isinstance(shape, coal.Cone) for shape in shapes)
    assert upper - 2e-12 <= gap <= lower + (1e-10 if cone else 1e-14)
    return shapes, poses


def furthest(shape, m):
    """A point of the shape with the largest m . x, in its frame."""
    m = m / np.linalg.norm(m)
    across = np.hypot(m[0], m[1])
    out = np.array([m[0], m[1], 0.0]) / across if across else np.zeros(3)
    end = np.array([0.0, 0.0, np.copysign(1.0, m[2])])
    if isinstance(shape, coal.Sphere):
        return shape.radius * m
    if isinstance(shape, coal.Capsule):
        return shape.radius * m + shape.halfLength * end
    if isinstance(shape, coal.Ellipsoid):
        axes = np.array(shape.radii)
        return axes**2 * m / np.linalg.norm(axes * m)
    if isinstance(shape, coal.Cylinder):
        return shape.radius * out + shape.halfLength * end
    if isinstance(shape, coal.Cone):
        base = shape.radius * out - [0.0, 0.0, shape.halfLength]
        tip = np.array([0.0, 0.0, shape.halfLength])
        return base if base @ m > tip @ m else tip
    points = corners(shape)
    return points[np.argmax(points @ m)]


def best_separation(shapes, poses, n, width, looks=40, kept=14):
    """The largest separation along normals about a given one, by cutting planes: a lower bound of the distance.

    With normals n0 + T z the separation s is the least of linear functions of z, one for every two points. The best z
    so far has s / |n| = g, a better one has s - g |n| > 0, which is concave.

    Args:
        shapes: two of them.
        poses: in the world.
        n: unit normal, shape (3,).
        width: how far its ends are looked for [rad].
        looks: at separations.
        kept: so many of the lowest planes are used.
    """
    e = np.eye(3)[np.argmin(np.abs(n))]
    T = np.column_stack((np.cross(n, e), np.cross(n, np.cross(n, e))))
    T *= width / np.linalg.norm(T, axis=0)
    middle = 0.5 * (poses[0].translation + poses[1].translation)
    walls = np.array([[1.0, 0, 0], [0, 1.0, 0], [-1.0, 0, 0], [0, -1.0, 0]])
    best, z, planes = -np.inf, np.zeros(2), np.zeros((0, 3))  # slopes and height at z = 0
    for _ in range(looks):
        m = n + T @ z
        a, b = (X.act(furthest(s, X.rotation.T @ d)) - middle for s, X, d in zip(shapes, poses, (m, -m), strict=True))
        size = np.linalg.norm(m)
        best = max(best, (b - a) @ m / size)
        slope = T.T @ (b - a - best * m / size)
        planes = np.vstack((planes, np.append(slope, (b - a) @ m - best * size - slope @ z)))
        planes = planes[np.argsort(planes[:, :2] @ z + planes[:, 2])[:kept]]
        # where three planes meet, walls at |z| = 1 among them, the highest point that is above none of them
        scale = max(np.abs(planes[:, :2]).max(), 1e-300)
        A = np.vstack((np.column_stack((-planes[:, :2] / scale, np.ones(len(planes)))), walls))
        y = np.append(planes[:, 2] / scale, np.ones(4))
        i = np.array(list(combinations(range(len(y)), 3)))
        i = i[np.abs(np.linalg.det(A[i])) > 1e-14]
        found = np.linalg.solve(A[i], y[i][:, :, None])[:, :, 0]
        found = found[(found @ A.T <= y + 1e-15 + 1e-13 * np.abs(y)).all(axis=1)]
        if not len(found):
            return best
        top = found[np.argmax(found[:, 2])]
        if np.abs(top[:2] - z).max() < 1e-15:
            return best
        z = top[:2]
    return best
