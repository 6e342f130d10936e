"""Shapes from their numbers alone: support functions, distances of points, and what they prove of a distance.

The distance of two convex shapes A and B is at least their separation along any unit normal n, -h_A(n) - h_B(-n) with
the support functions h, and at most the distance of any two of their points. Where both agree, they are the distance.
"""

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
