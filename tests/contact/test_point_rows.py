"""Gaps, slip velocities and their accelerations against finite differences of positions, for every pair of shapes."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import ARRANGEMENTS, PAIRS, all_rows, free_flyers, pair_scene, random_state
from motions import STEP, along, bodies, carried, central, same

import ngalpha_pin as nga
from ngalpha_pin.system.system import System

DRILL = 3 * np.pi / 16 * 0.2
CASES = [(pair, arrangement, seed) for pair in PAIRS for arrangement in ARRANGEMENTS for seed in range(3)]


@pytest.fixture(params=CASES, ids=lambda c: f"{c[0]} {c[1]} {c[2]}")
def case(request):
    pair, arrangement, seed = request.param
    system = System(pair_scene(pair, arrangement))
    return system, *random_state(system.model, seed)


def test_gap_rate_is_the_derivative_of_the_gap(case):
    system, q, v, a = case
    rows = all_rows(system, q, v, a)
    k = len(rows.g_N)
    found = central(lambda s: all_rows(system, pin.integrate(system.model, q, s * v), v, a).g_N)
    assert same(rows.rate[:k], found)
    assert rows.W @ v == pytest.approx(rows.rate, abs=1e-12)


def test_normals_and_tangents_are_a_right_handed_frame(case):
    system, q, v, a = case
    rows = all_rows(system, q, v, a)
    k = len(rows.g_N)
    assert rows.W.shape == (4 * k, system.model.nv)
    for i in range(k):
        t_1, t_2, drill = rows.directions[k + 3 * i : k + 3 * i + 3]
        frame = np.array([t_1, t_2, rows.normals[i]])
        assert np.abs(frame @ frame.T - np.eye(3)).max() < 1e-14
        assert np.linalg.det(frame) == pytest.approx(1.0)
        assert not drill.any()


def test_slip_velocity_is_that_of_the_material_point(case):
    """The point of body B that touches, followed in the frame of body A; drilling is the turning about the normal."""
    system, q, v, a = case
    rows = all_rows(system, q, v, a)
    k, radius = len(rows.g_N), system.contacts.radius
    A, B = bodies(system, q)

    def relative(s):
        A_s, B_s = bodies(system, pin.integrate(system.model, q, s * v))
        return A_s.actInv(B_s)

    ahead, behind = relative(STEP), relative(-STEP)
    omega = A.rotation @ pin.log3(ahead.rotation @ behind.rotation.T) / (2 * STEP)
    for i in range(k):
        touching = B.actInv(rows.c[i] - radius[i] * rows.normals[i])
        velocity = A.rotation @ (ahead.act(touching) - behind.act(touching)) / (2 * STEP)
        t = rows.directions[k + 3 * i : k + 3 * i + 2]
        found = [*(t @ velocity), DRILL * rows.normals[i] @ omega]
        assert same(rows.rate[k + 3 * i : k + 3 * i + 3], found)


def test_accelerations_are_the_derivatives_of_the_rates(case):
    system, q, v, a = case
    rows = all_rows(system, q, v, a)
    at = rows, next(iter(bodies(system, q)))
    found = central(lambda s: carried(system, *along(system.model, q, v, a, s), at))
    assert same(rows.acceleration, found)


def test_derivative_of_the_rates_by_the_configuration(case):
    system, q, v, a = case
    rows = all_rows(system, q, v, a)
    at, X = (rows, next(iter(bodies(system, q)))), rows.derivatives(system.motion(v, a))[0]
    every = np.eye(system.model.nv)
    found = [central(lambda s, e=e: carried(system, pin.integrate(system.model, q, s * e), v, at)) for e in every]
    assert same(X, np.array(found).T)


def test_derivative_of_the_accelerations_by_the_velocity(case):
    system, q, v, a = case
    rows = all_rows(system, q, v, a)
    Y = rows.derivatives(system.motion(v, a))[1]
    every = np.eye(system.model.nv)
    found = [central(lambda s, e=e: all_rows(system, q, v + s * e, a).acceleration) for e in every]
    assert same(Y, np.array(found).T)


@pytest.mark.parametrize("pair", [p for p in PAIRS if "hollow" not in p])
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_gap_is_the_distance_that_coal_finds(pair, arrangement):
    scene = pair_scene(pair, arrangement)
    system, request = System(scene), coal.DistanceRequest()
    request.gjk_tolerance = request.epa_tolerance = 1e-10
    a, b = scene.geometry("a"), scene.geometry("b")
    for seed in range(20):
        q, v, acceleration = random_state(scene.model, seed)
        pose_a, pose_b = (pose * g.placement for pose, g in zip(bodies(system, q), (a, b), strict=True))
        placed = [coal.Transform3s(p.rotation, p.translation) for p in (pose_b, pose_a)]
        found = coal.distance(b.geometry, placed[0], a.geometry, placed[1], request, coal.DistanceResult())
        if found > 0:
            assert all_rows(system, q, v, acceleration).g_N.min() == pytest.approx(found, abs=1e-9)


@pytest.mark.parametrize("shape", [coal.Box(0.4, 0.6, 0.8), coal.Capsule(0.2, 0.9)])
@pytest.mark.parametrize("swept", [0.0, 0.05])
def test_lowest_point_of_a_shape_is_its_distance_from_the_plane(shape, swept):
    shape = type(shape)(shape)
    shape.setSweptSphereRadius(swept)
    scene = nga.Scene(free_flyers(1))
    scene.add_plane("ground", point=(0.1, 0.2, 0.3), normal=(0.3, -0.4, 2.0))
    scene.add_geometry("body", shape, parent="body_0")
    scene.add_contact("body", "ground")
    system, ground, request = System(scene), scene.geometry("ground"), coal.DistanceRequest()
    for seed in range(10):
        q, v, a = random_state(scene.model, seed)
        q[2] += 4.0
        placed = [coal.Transform3s(p.rotation, p.translation) for p in (pin.XYZQUATToSE3(q), ground.placement)]
        found = coal.distance(shape, placed[0], ground.geometry, placed[1], request, coal.DistanceResult())
        gap = all_rows(system, q, v, a).g_N.min()
        assert gap == pytest.approx(found, abs=1e-9)


def test_inside_of_a_hollow_shape_by_hand():
    scene = nga.Scene(free_flyers(1))
    scene.add_geometry("tube", nga.Hollow(coal.Cylinder(2.0, 10.0)))
    scene.add_geometry("shell", nga.Hollow(coal.Sphere(3.0)))
    scene.add_geometry("ball", coal.Sphere(0.25), parent="body_0")
    scene.add_contact("ball", "tube")
    scene.add_contact("ball", "shell")
    q = pin.neutral(scene.model)
    q[:3] = [0.6, -0.8, 1.5]
    rows = all_rows(System(scene), q, np.zeros(6), np.zeros(6))
    assert rows.g_N == pytest.approx([2.0 - 1.0 - 0.25, 3.0 - np.sqrt(1 + 1.5**2) - 0.25])
    assert rows.normals[0] == pytest.approx([-0.6, 0.8, 0.0])
    assert rows.normals[1] == pytest.approx(-q[:3] / np.sqrt(3.25))


def test_contact_ends_where_a_hollow_cylinder_ends():
    scene = nga.Scene(free_flyers(1))
    scene.add_geometry("post", nga.Hollow(coal.Cylinder(1.0, 2.0)))
    scene.add_geometry("ball", coal.Sphere(0.25), parent="body_0")
    scene.add_contact("ball", "post")
    system, q = System(scene), pin.neutral(scene.model)
    # at rho = 0.9 the ball penetrates the wall
    for z, touches in ((0.0, True), (0.99, True), (1.01, False), (3.0, False), (-1.01, False)):
        q[:3] = [0.9, 0.0, z]
        assert (all_rows(system, q, np.zeros(6), np.zeros(6)).g_N[0] < 0) == touches


def test_ball_at_the_centre_of_a_hollow_shape_has_a_finite_gap():
    scene = nga.Scene(free_flyers(1))
    scene.add_geometry("shell", nga.Hollow(coal.Sphere(3.0)))
    scene.add_geometry("ball", coal.Sphere(0.25), parent="body_0")
    scene.add_contact("ball", "shell", mu=0.3)
    assert all_rows(System(scene), pin.neutral(scene.model), np.zeros(6), np.zeros(6)).g_N[0] == pytest.approx(2.75)


def test_contact_of_a_model_with_one_coordinate():
    model = pin.Model()
    rail = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "rail")
    model.appendBodyToJoint(rail, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    model.addBodyFrame("body", rail, pin.SE3.Identity(), 0)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="body")
    scene.add_contact("ball", "ground", mu=0.3)
    run = nga.simulate(scene, np.array([0.15]), np.zeros(1), t_end=0.2, dt=1e-2)
    assert run.q[-1, 0] == pytest.approx(0.1, abs=1e-12)
    assert run.la_N[-1, 0] == pytest.approx(2.0 * 9.81)
