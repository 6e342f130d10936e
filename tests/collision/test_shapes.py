"""Every pair of shapes: the gap is the distance, second-order rates along a motion, falls onto each other."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from exact_shapes import check_gap
from shape_scenes import SHAPES, random_pose, two_bodies

import ngalpha_pin as nga
from ngalpha_pin import references
from ngalpha_pin.collision.features import NORMAL
from ngalpha_pin.collision.narrow_phase import distance
from ngalpha_pin.collision.shapes import solid
from ngalpha_pin.scene.convex_hull import FLAT
from ngalpha_pin.system.system import System

NAMES = list(SHAPES)
PAIRS = [(a, b) for i, a in enumerate(NAMES) for b in NAMES[i:] if (a, b) != ("sphere", "sphere")]
GROUND = coal.Box(3, 3, 0.4)
TRIANGLE = np.hypot(0.3, 0.6)
"""Largest distance of a corner of the triangle from its first one [m]."""


def loaded(system, q):
    """Rows of what the narrow phase finds at q."""
    system.place_moving(q, np.zeros(system.nv))
    slots = system.slots
    slots.load(system.data, slots.contents()[:0], np.zeros(0, dtype=int), 0.0, np.inf)
    return system.contacts.subset(system.contacts.n_fixed + np.flatnonzero(slots.loaded))


def check_distance(pair, poses):
    """The gap is proven to be the distance, so that what coal says beside it is coal's error.

    Of pairs of round shapes coal stops up to 4e-9 below the distance, whatever tolerance it is given, and above it by
    its tolerance, twice 1e-10 at most. It measures a triangle as a plate of the thickness FLAT times its size, all
    of which counts across its plane.
    """
    thin = sum(isinstance(SHAPES[name], coal.TriangleP) for name in pair) * 0.5 * FLAT * TRIANGLE
    scene = two_bodies(*(SHAPES[name] for name in pair))
    system, rng, count = System(scene), np.random.default_rng(1), 0
    while count < poses:
        q = random_pose(rng, 0.4)
        system.place(q)
        found = distance(system.slots.pairs[0], system.slots.pose(system.data, 0))
        if found < 1e-3:
            continue
        count += 1
        rows = system.point_rows(loaded(system, q))
        k = int(np.argmin(rows.g_N))
        check_gap(scene, system, rows, k)
        assert -2e-10 < rows.g_N[k] - found < thin + 5e-9


@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_gap_is_the_distance_and_coal_is_near_it(pair):
    check_distance(pair, 8)


@pytest.mark.long
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_gap_is_the_distance_and_coal_is_near_it_at_many_poses(pair):
    check_distance(pair, 100)


@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_gap_keeps_its_meaning_down_to_contact(pair):
    """Moved together along the normal by the distance, the gap is zero, although coal has no normal there."""
    system, rng = System(two_bodies(*(SHAPES[name] for name in pair))), np.random.default_rng(2)
    for _ in range(10):
        q = random_pose(rng, 0.0)
        q[:3] = 1.2 * (u := rng.normal(size=3)) / np.linalg.norm(u)
        rows = system.point_rows(loaded(system, q))
        k = int(np.argmin(rows.g_N))
        before = system.slots.packed[system.slots.loaded][k]
        q[:3] -= rows.g_N[k] * rows.normals[k]
        contents = np.concatenate(([0.0], before))[None]
        system.place_moving(q, np.zeros(6))
        system.slots.load(system.data, contents, np.array([0]), 0.0, np.inf)
        sub = system.contacts.subset(system.contacts.n_fixed + np.flatnonzero(system.slots.loaded))
        again = system.point_rows(sub)
        assert abs(again.g_N.min()) < 1e-14


def falling(shape, seed, **law):
    scene = two_bodies(GROUND, shape)
    scene.contacts.clear()
    scene.add_geometry("ground", GROUND, placement=pin.SE3(np.eye(3), np.array([0, 0, -0.2])))
    scene.add_contact("b", "ground", **law)
    rng = np.random.default_rng(seed)
    q0 = random_pose(rng, 0.0)
    q0[:3] = [0, 0, 0.6]
    return scene, q0, 0.3 * rng.normal(size=6)


@pytest.mark.parametrize("name", ["sphere", "capsule", "box", "ellipsoid"])
def test_fall_onto_a_box(name):
    scene, q0, v0 = falling(SHAPES[name], 1, mu=0.5)
    run = nga.simulate(scene, q0, v0, t_end=0.6, dt=5e-3)
    audit = run.audit()
    assert audit.ok
    assert audit.penetration <= 1e-9
    assert run.P_N.any()


def standing(shape, height, **law):
    """A shape upright on a plane."""
    scene = two_bodies(GROUND, shape)
    scene.contacts.clear()
    scene.add_plane("plane")
    scene.collision_model.geometryObjects[scene.collision_model.getGeometryId("b")].placement = pin.SE3.Identity()
    scene.add_contact("b", "plane", **law)
    q0 = pin.neutral(scene.model)
    q0[2] = height
    return scene, q0


def test_cylinder_stands_on_its_face():
    scene, q0 = standing(coal.Cylinder(0.2, 0.5), 0.25, mu=0.5)
    run = nga.simulate(scene, q0, t_end=0.5, dt=1e-2)
    assert run.audit().ok
    assert np.abs(run.v).max() < 1e-12
    assert run.la_N.sum(axis=1) == pytest.approx(9.81, rel=1e-9)


def test_cylinder_rolls_on_its_side_as_in_the_book():
    """Without slip v stays; it started with slip: v = v0 - mu g t until it rolls with v0 / (1 + m r^2 / I)."""
    radius, mu, inertia = 0.2, 0.3, 1.0 / 12 * (2 * 0.4**2)
    scene, q0 = standing(coal.Cylinder(radius, 0.5), radius, mu=mu)
    q0[3:7] = pin.Quaternion(pin.exp3(np.array([np.pi / 2, 0, 0]))).coeffs()
    run = nga.simulate(scene, q0, np.array([1.0, 0, 0, 0, 0, 0]), t_end=0.5, dt=1e-3)
    rolls = 1.0 / (1.0 + inertia / radius**2)
    speed = np.maximum(1.0 - mu * 9.81 * run.t, rolls)
    along = np.linalg.norm(run.v[:, :3], axis=1)  # its frame turns
    assert np.abs(along - speed).max() < mu * 9.81 * 1e-3
    # momentum and spin change by the same friction, whenever it ends within its step; what is left is the velocity in
    # the frame that turns with the cylinder, of second order: 5.3e-7 m/s here and 4 times as much with twice the step
    coarse = nga.simulate(scene, q0, np.array([1.0, 0, 0, 0, 0, 0]), t_end=0.5, dt=2e-3)
    error, error_2 = (np.linalg.norm(x.v[-1, :3]) - rolls for x in (run, coarse))
    assert abs(error) < 6e-7
    assert error_2 / error == pytest.approx(4.0, rel=0.05)
    audit = run.audit()
    assert audit.ok and audit.penetration < 1e-12


def test_disc_rolls_steadily_on_its_rim():
    """Circular rolling at constant inclination: all of the closed form of a thin disc stays for one second."""
    r, mass, tilt, rate = 0.3, 1.0, 0.5, 0.0
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "disc")
    C, A = 0.5 * mass * r**2, 0.25 * mass * r**2
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), np.diag([A, A, C])), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_plane("plane")
    scene.add_geometry("disc", coal.Cylinder(r, 1e-11), parent="disc")
    scene.add_contact("disc", "plane", mu=10.0)
    # centre at rest: the contact point runs around a circle of radius r cos(tilt), tilt of the disc from the plane
    rate = np.sqrt(4 * 9.81 / (r * np.sin(tilt)))
    q0 = pin.neutral(model)
    q0[2] = r * np.sin(tilt)
    q0[3:7] = pin.Quaternion(pin.exp3(np.array([0, tilt, 0]))).coeffs()
    # lowest point at +x of the disc; angular velocity along the diameter through it, in the frame of the disc
    omega = -rate * np.sin(tilt) * np.array([1.0, 0.0, 0.0])
    v0 = np.concatenate((np.zeros(3), omega))
    # the centre stays, the inclination stays, the energy stays, to second order
    moved, lost = [], []
    for dt in (2e-3, 1e-3):
        run = nga.simulate(scene, q0, v0, t_end=0.5, dt=dt)
        moved.append(np.abs(run.q[:, :3] - q0[:3]).max())
        lost.append(np.abs(run.energy.total - run.energy.total[0]).max())
        assert run.audit().penetration < 1e-10
    assert moved[1] < 1e-6 and lost[1] < 3e-5 * run.energy.kinetic[0]
    assert moved[0] / moved[1] == pytest.approx(4.0, rel=0.1)
    assert lost[0] / lost[1] == pytest.approx(4.0, rel=0.1)


def test_features_keep_their_places_while_a_box_slides():
    scene, q0, _ = falling(coal.Box(0.4, 0.4, 0.4), 0, mu=0.2)
    scene.collision_model.geometryObjects[scene.collision_model.getGeometryId("b")].placement = pin.SE3.Identity()
    q0 = pin.neutral(scene.model)
    q0[2] = 0.2
    run = nga.simulate(scene, q0, np.array([0.5, 0.1, 0, 0, 0, 0]), t_end=0.4, dt=2e-3)
    # the same four corners carry the weight all the way
    assert (run.la_N[1:] > 1e-6).sum(axis=1).max() <= 4
    used = np.flatnonzero((run.la_N > 1e-6).any(axis=0))
    assert len(used) == 4
    slide = np.hypot(0.5, 0.1) ** 2 / (2 * 0.2 * 9.81)
    assert np.hypot(*(run.q[-1, :2] - q0[:2])) == pytest.approx(slide, rel=1e-2)


def test_a_corner_that_leaves_the_table_lets_go():
    """A box slides over the edge: its leading corners are replaced by points on the edge, and no force is invented."""
    scene, _, _ = falling(coal.Box(0.4, 0.4, 0.4), 0)
    scene.contacts.clear()
    scene.collision_model.geometryObjects[scene.collision_model.getGeometryId("b")].placement = pin.SE3.Identity()
    scene.add_geometry("table", coal.Box(1.0, 1.0, 0.2), placement=pin.SE3(np.eye(3), np.array([0, 0, -0.1])))
    scene.add_contact("b", "table")
    q0 = pin.neutral(scene.model)
    q0[:3] = [0.25, 0.0, 0.2]
    run = nga.simulate(scene, q0, np.array([1.0, 0, 0, 0, 0, 0]), t_end=0.2, dt=1e-3)
    stands = run.q[:, 0] < 0.49
    assert run.q[-1, 0] > 0.44
    assert run.la_N[stands].sum(axis=1) == pytest.approx(9.81, rel=1e-6)
    assert np.abs(run.v[stands] - [1, 0, 0, 0, 0, 0]).max() < 1e-9
    assert run.audit().penetration < 1e-9


def test_steps_of_chosen_accuracy_capture_features():
    """A box that tumbles onto another one: its flight is a free fall, and two tolerances agree after its impacts."""
    scene, q0, v0 = falling(coal.Box(0.4, 0.4, 0.4), 2, mu=0.5)
    times = np.linspace(0.03, 0.42, 14)
    rough, fine = (nga.simulate(scene, q0, v0, t_end=0.42, rtol=rtol, t_eval=times) for rtol in (1e-3, 1e-5))
    for run in (rough, fine):
        assert run.success
        assert run.t[1:] == pytest.approx(times, abs=1e-15)
        assert {"captured"} <= set(run.solver_path[1:]) <= {"captured", "smooth"}
        assert run.audit().ok, str(run.audit())
        assert len([event for event in run.events if event.kind == "impact"]) >= 2
    assert np.abs(rough.q - fine.q).max() < 1e-2
    free, _ = references.free_body(fine.t[:8], q0, v0, np.diag(scene.model.inertias[1].inertia))
    assert np.abs(fine.q[:8] - free).max() < 1e-4


def test_normals_of_features_are_kept_in_the_state():
    scene, q0, v0 = falling(coal.Box(0.4, 0.4, 0.4), 2, mu=0.3)
    whole = nga.simulate(scene, q0, v0, t_end=0.34, dt=5e-3)
    first = nga.simulate(scene, q0, v0, t_end=0.32, dt=5e-3)
    second = nga.simulate(scene, state=first.final_state, t_end=0.34)
    assert whole.P_N.any()
    assert np.array_equal(second.q[-1], whole.q[-1])
    assert np.abs(np.linalg.norm(whole.final_state.slots[:, 1:][:, NORMAL], axis=1) - 1).max() < 1e-12


def test_heights_of_a_disc_nearly_across_the_direction_are_exact():
    rng = np.random.default_rng(4)
    for tilt in [0.0, *10.0 ** rng.uniform(-18, -1, size=200)]:
        R = pin.exp3(rng.normal(size=3))
        cylinder = solid(pin.GeometryObject("c", 0, pin.SE3(R, np.zeros(3)), coal.Cylinder(0.2, 0.5)))
        m = R @ pin.exp3(np.array([tilt, 0.0, 0.0])) @ np.array([0.0, 0.0, 1.0])
        assert abs(m @ cylinder.native.support(m) - (0.25 * np.cos(tilt) + 0.2 * np.sin(tilt))) < 1e-15
