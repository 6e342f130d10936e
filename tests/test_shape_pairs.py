"""Every pair of shapes that may touch, at 100 random poses: gap, normal, their rates and accelerations."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from test_shapes import SHAPES, random_pose, two_bodies

import ngalpha_pin as nga
from ngalpha_pin.system import System

POSES = 100
UP = np.array([0.0, 0.0, 1.0])


def mesh():
    """A bent tetrahedron with a point inside of it, as triangles."""
    points = np.array([[0.3, 0, 0], [-0.2, 0.25, 0], [-0.2, -0.25, 0.05], [0.05, 0, 0.35], [0.0, 0.0, 0.1]])
    triangles = [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 4), (2, 4, 0), (4, 3, 0)]
    found = coal.BVHModelOBBRSS()
    found.beginModel(len(triangles), len(points))
    vertices, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for p in points:
        vertices.append(p)
    for t in triangles:
        faces.append(coal.Triangle(*t))
    found.addSubModel(vertices, faces)
    found.endModel()
    return found


CONVEX = {**SHAPES, "mesh": mesh()}
UNBOUNDED = {"half-space": coal.Halfspace(UP, 0.05), "plane": coal.Plane(UP, 0.05)}
HOLLOW = {
    "hollow cylinder": nga.Hollow(coal.Cylinder(2.5, 40.0)),
    "hollow sphere": nga.Hollow(coal.Sphere(2.5)),
}
WITH_POINTS = ("sphere", "capsule", "box", "convex", "triangle", "mesh")
PAIRS = [(a, b) for i, a in enumerate(CONVEX) for b in list(CONVEX)[i:]]
PAIRS += [(a, b) for a in UNBOUNDED for b in CONVEX] + [(a, b) for a in HOLLOW for b in WITH_POINTS]
ALL = CONVEX | UNBOUNDED | HOLLOW


def sampled(shape):
    """Points of a surface, those with 2,000 normals or the corners, from the numbers of the shape, shape (n, 3)."""
    m = np.random.default_rng(7).normal(size=(2000, 3))
    m /= np.linalg.norm(m, axis=1, keepdims=True)
    across = m[:, :2] / np.linalg.norm(m[:, :2], axis=1, keepdims=True)
    side = np.sign(m[:, 2:])
    if isinstance(shape, coal.Sphere):
        return float(shape.radius) * m
    if isinstance(shape, coal.Capsule):
        return shape.radius * m + shape.halfLength * side * UP
    if isinstance(shape, coal.Ellipsoid):
        scaled = m * np.array(shape.radii)
        return np.array(shape.radii) * scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
    if isinstance(shape, coal.Cylinder):
        return np.hstack((shape.radius * across, shape.halfLength * side))
    if isinstance(shape, coal.Cone):
        return np.vstack(
            (np.hstack((shape.radius * across, -shape.halfLength * np.ones_like(side))), shape.halfLength * UP)
        )
    if isinstance(shape, coal.Box):
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return signs * np.array(shape.halfSide)
    if isinstance(shape, coal.TriangleP):
        return np.array([shape.a, shape.b, shape.c])
    return np.array(shape.vertices() if isinstance(shape, coal.BVHModelBase) else shape.points())


def true_gap(scene, system, names):
    """Gap between the sampled shape "b" and a plane or the inside of a hollow shape: exact for points."""
    a, b = scene.geometry("a"), scene.geometry("b")
    pose = a.placement.inverse() * system.data.oMi[b.parentJoint] * b.placement
    points = sampled(b.geometry) @ pose.rotation.T + pose.translation
    if names[0] in UNBOUNDED:
        height = points[:, 2] - 0.05
        return height.min() if names[0] == "half-space" else max(height.min(), -height.max())
    radius = 0.0
    if isinstance(b.geometry, (coal.Sphere, coal.Capsule)):
        half = getattr(b.geometry, "halfLength", 0.0)
        points = np.array([s * half * UP for s in (-1, 1)]) @ pose.rotation.T + pose.translation
        radius = b.geometry.radius
    if names[0] == "hollow cylinder":
        points = points[:, :2]
    return 2.5 - radius - np.linalg.norm(points, axis=1).max()


def separated(scene, system, n):
    """Distance of the sampled shapes along a direction of the world from a to b: never more than the gap."""
    ends = []
    for name, sign in (("a", -1.0), ("b", 1.0)):
        g = scene.geometry(name)
        pose = system.data.oMi[g.parentJoint] * g.placement
        ends.append(sign * ((sampled(g.geometry) @ pose.rotation.T + pose.translation) @ n))
    return float(ends[1].min() + ends[0].min())


def rows_at(system, q, v=None, a=None):
    """Rows of the features that were loaded, and of the points."""
    taken = system.contacts.n_fixed + np.flatnonzero(system.slots.loaded)
    sub = system.contacts.subset(np.concatenate((np.arange(system.contacts.n_fixed), taken)))
    v = np.zeros(system.nv) if v is None else v
    system.dynamics(0.0, q, v, np.zeros(system.nv) if a is None else a)
    return system.contact_rows(sub, q, v, np.zeros(system.nv) if a is None else a)


@pytest.mark.parametrize("names", PAIRS, ids="-".join)
def test_gap_normal_and_rates(names):
    """The gap is the distance, its normal separates, W_N^T v is its rate and g_N_ddot the rate of that."""
    scene = two_bodies(*(ALL[name] for name in names))
    system, rng, count, h = System(scene), np.random.default_rng(5), 0, 1e-5
    while count < POSES:
        q, v, a = random_pose(rng, 0.5), rng.normal(size=6), rng.normal(size=6)
        system.place_moving(q, v)
        slots = system.slots
        slots.load(system.data, slots.contents()[:0], np.zeros(0, dtype=int), None, np.inf)
        rows = rows_at(system, q, v, a)
        k = int(np.argmin(rows.g_N))
        gap, n = rows.g_N[k], rows.normals[k].copy()
        if gap < 2e-2:
            continue
        count += 1
        if names[0] in CONVEX:
            if slots.n:
                assert gap == pytest.approx(slots.proximity.look(system.data, 0), abs=2e-6)
            else:  # two spheres: the point is in "a"
                n = -n
            # a sample of a round shape stands off the shape by its curvature over the distance of the sample
            assert gap - 1e-9 <= separated(scene, system, n) <= gap + 4e-3
        else:
            found = true_gap(scene, system, names)
            assert found - 4e-3 <= gap <= found + 1e-9
            if names[1] in ("box", "convex", "triangle", "mesh") or names[0] in HOLLOW:
                assert gap == pytest.approx(found, abs=1e-12)
        rate, acceleration = rows.rate[k], rows.acceleration[k]
        assert rows.W[k] @ v == pytest.approx(rate, abs=1e-12)
        step = 0.5 * h * h * a
        later = rows_at(system, pin.integrate(scene.model, q, h * v + step), v + h * a)
        before = rows_at(system, pin.integrate(scene.model, q, -h * v + step), v - h * a)
        size = 1.0 + np.abs(acceleration)
        assert (later.g_N[k] - before.g_N[k]) / (2 * h) == pytest.approx(rate, abs=1e-6 * size)
        assert (later.rate[k] - before.rate[k]) / (2 * h) == pytest.approx(acceleration, abs=1e-5 * size)
