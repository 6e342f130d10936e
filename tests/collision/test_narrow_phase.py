"""Every pair of shapes that may touch, at random poses: gap, normal, their rates and accelerations."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from exact_shapes import check_gap, corners, distance_of_segments, outside, reach
from shape_scenes import SHAPES, random_pose, two_bodies

import ngalpha_pin as nga
from ngalpha_pin.system.system import System

UP = np.array([0.0, 0.0, 1.0])


# one of the shapes is hollowed out, and its hull is what touches
pytestmark = pytest.mark.filterwarnings("ignore:contact takes the convex hull")


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
TO_POINTS = (coal.Sphere, coal.Capsule, coal.Box, coal.Cylinder, coal.Cone)
"""Shapes whose distance from a point is a closed form."""
PAIRS = [(a, b) for i, a in enumerate(CONVEX) for b in list(CONVEX)[i:]]
PAIRS += [(a, b) for a in UNBOUNDED for b in CONVEX] + [(a, b) for a in HOLLOW for b in WITH_POINTS]
ALL = CONVEX | UNBOUNDED | HOLLOW


def true_gap(names, shape, pose):
    """Gap between a shape at a pose and a plane or the inside of a hollow shape, in the frame of that."""
    if names[0] in UNBOUNDED:
        above, below = (-reach(shape, pose.rotation.T @ -m) for m in (UP, -UP))
        heights = above + pose.translation[2] - 0.05, below - pose.translation[2] + 0.05
        return heights[0] if names[0] == "half-space" else max(heights)
    points, radius = corners(shape), 0.0
    if points is None:  # a sphere or a capsule
        points, radius = np.array([s * getattr(shape, "halfLength", 0.0) * UP for s in (-1, 1)]), shape.radius
    points = points @ pose.rotation.T + pose.translation
    return 2.5 - radius - np.linalg.norm(points[:, :2] if names[0] == "hollow cylinder" else points, axis=1).max()


def closed_form(shapes, poses):
    """Distance of a sphere from a shape, or of two capsules; None for others."""
    for (a, b), (X_a, X_b) in ((shapes, poses), (shapes[::-1], poses[::-1])):
        if isinstance(a, coal.Sphere) and isinstance(
            b, (coal.Sphere, coal.Capsule, coal.Box, coal.Cylinder, coal.Cone)
        ):
            return outside(b, X_b.actInv(X_a.translation)) - a.radius
    if all(isinstance(shape, coal.Capsule) for shape in shapes):
        ends = [[X.act(s * c.halfLength * UP) for s in (-1, 1)] for c, X in zip(shapes, poses, strict=True)]
        return distance_of_segments(*np.array(ends)) - shapes[0].radius - shapes[1].radius
    return None


def rows_at(system, q, v=None, a=None):
    """Rows of the features that were loaded, and of the points."""
    taken = system.contacts.n_fixed + np.flatnonzero(system.slots.loaded)
    sub = system.contacts.subset(np.concatenate((np.arange(system.contacts.n_fixed), taken)))
    v = np.zeros(system.nv) if v is None else v
    system.dynamics(0.0, q, v, np.zeros(system.nv) if a is None else a)
    return system.contact_rows(sub, q, v, np.zeros(system.nv) if a is None else a)


def check_pair(names, poses):
    """The gap is the distance, its normal separates, W_N^T v is its rate and g_N_ddot the rate of that."""
    scene = two_bodies(*(ALL[name] for name in names))
    system, rng, count, h = System(scene), np.random.default_rng(5), 0, 1e-5
    while count < poses:
        q, v, a = random_pose(rng, 0.5), rng.normal(size=6), rng.normal(size=6)
        system.place_moving(q, v)
        slots = system.slots
        slots.load(system.data, slots.contents()[:0], np.zeros(0, dtype=int), None, np.inf)
        rows = rows_at(system, q, v, a)
        k = int(np.argmin(rows.g_N))
        gap = rows.g_N[k]
        if gap < 2e-2:
            continue
        count += 1
        if names[0] in CONVEX:
            found = closed_form(*check_gap(scene, system, rows, k))
        else:
            b = scene.geometry("b")
            pose = scene.geometry("a").placement.actInv(system.data.oMi[b.parentJoint] * b.placement)
            found = true_gap(names, b.geometry, pose)
        assert found is None or gap == pytest.approx(found, abs=1e-10 if "cone" in names else 1e-12)
        rate, acceleration = rows.rate[k], rows.acceleration[k]
        assert rows.W[k] @ v == pytest.approx(rate, abs=1e-12)
        step = 0.5 * h * h * a
        later = rows_at(system, pin.integrate(scene.model, q, h * v + step), v + h * a)
        before = rows_at(system, pin.integrate(scene.model, q, -h * v + step), v - h * a)
        size = 1.0 + np.abs(acceleration)
        assert (later.g_N[k] - before.g_N[k]) / (2 * h) == pytest.approx(rate, abs=1e-6 * size)
        assert (later.rate[k] - before.rate[k]) / (2 * h) == pytest.approx(acceleration, abs=1e-5 * size)


@pytest.mark.parametrize("names", PAIRS, ids="-".join)
def test_gap_normal_and_rates(names):
    check_pair(names, 8)


@pytest.mark.long
@pytest.mark.parametrize("names", PAIRS, ids="-".join)
def test_gap_normal_and_rates_at_many_poses(names):
    check_pair(names, 100)
