"""No contact is missed with rtol: head-on flights, grazes, contacts that approach at the start, a thrown cube."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga

G = 9.81


def bodies(joints, gravity=0.0):
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    for i, joint in enumerate(joints):
        j = model.addJoint(0, joint, pin.SE3.Identity(), f"b{i}")
        model.appendBodyToJoint(j, pin.Inertia.FromSphere(1.0, 0.05), pin.SE3.Identity())
        model.addJointFrame(j)
    return nga.Scene(model)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("speed", [1.0, 30.0, 1000.0])
def test_spheres_on_collision_course_exchange_their_velocities(speed, rtol):
    scene, R = bodies([pin.JointModelFreeFlyer(), pin.JointModelFreeFlyer()]), 0.05
    for i in range(2):
        scene.add_geometry(f"s{i}", coal.Sphere(R), f"b{i}")
    scene.add_contact("s0", "s1", e_N=1.0)
    q = np.array([-0.5, 0, 0, 0, 0, 0, 1.0, 0.5, 0, 0, 0, 0, 0, 1.0])
    v = speed * np.array([1.0, 0, 0, 0, 0, 0, -1.0, 0, 0, 0, 0, 0])
    run = nga.simulate(scene, q, v, t_end=1.2 / speed, rtol=rtol)
    assert run.impacts.t == pytest.approx([0.45 / speed], rel=1e-9)
    assert run.q[-1, [0, 7]] == pytest.approx([-0.8, 0.8], abs=10 * rtol)
    assert run.v[-1, [0, 6]] == pytest.approx([-speed, speed], rel=10 * rtol)


@pytest.mark.parametrize("seed", range(12))
def test_random_flights_hit(seed):
    """A spinning box or ball of random size flies at a random point near the middle of a sphere or past a cylinder."""
    rng = np.random.default_rng(seed)
    size, target, speed = 10.0 ** rng.uniform(-2, 0), 10.0 ** rng.uniform(-2, 0), 10.0 ** rng.uniform(0, 3)
    scene = bodies([pin.JointModelFreeFlyer()])
    scene.add_geometry("s", coal.Sphere(size), "b0")
    scene.add_geometry("t", coal.Sphere(target) if seed % 2 else nga.Hollow(coal.Sphere(size + 10 * target)))
    scene.add_contact("s", "t", e_N=0.5)
    away = rng.normal(size=3)
    away /= np.linalg.norm(away)
    side = np.cross(away, rng.normal(size=3))
    side *= rng.uniform(0.0, 0.9) * (size + target if seed % 2 else 10 * target) / np.linalg.norm(side)
    start = side + away * (5.0 * (size + target) if seed % 2 else 0.0)
    v = np.r_[-speed * away, rng.normal(size=3) * 10.0]
    # in the axes of the body, which stands straight at the start
    run = nga.simulate(scene, np.r_[start, 0, 0, 0, 1.0], v, t_end=20.0 * (size + target) / speed, rtol=1e-4)
    reach = size + target if seed % 2 else 10 * target
    along, b = start @ away, np.linalg.norm(side)
    hits = (along - np.sqrt(reach**2 - b**2) if seed % 2 else np.sqrt(reach**2 - b**2)) / speed
    assert run.impacts.t[0] == pytest.approx(hits, rel=1e-6)


def test_graze_that_is_shallow_is_an_impact_and_a_miss_is_none():
    for depth, n in ((1e-6, 1), (-1e-6, 0)):
        scene = bodies([pin.JointModelTranslation()])
        scene.add_geometry("s", coal.Sphere(0.05), "b0")
        scene.add_geometry("t", coal.Sphere(0.1))
        scene.add_contact("s", "t", e_N=1.0)
        start = np.array([-3.0, 0.15 - depth, 0.0])
        run = nga.simulate(scene, start, np.array([10.0, 0.0, 0.0]), t_end=1.0, rtol=1e-5)
        assert len(run.impacts.t) == n
        if n:
            assert run.impacts.t[0] == pytest.approx((3.0 - np.sqrt(0.15**2 - start[1] ** 2)) / 10.0, rel=1e-9)


@pytest.mark.parametrize("e_N", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("gap", [0.0, 1e-16, 1e-12, 1e-9])
def test_contact_that_approaches_at_the_start_rebounds_there(gap, e_N):
    scene = bodies([pin.JointModelPZ()], G)
    scene.add_plane("ground")
    scene.add_geometry("s", coal.Sphere(0.1), "b0")
    scene.add_contact("s", "ground", e_N=e_N)
    run = nga.simulate(scene, np.array([0.1 + gap]), np.array([-1.0]), t_end=0.05, rtol=1e-8)
    right = 0.1 + max(e_N * 0.05 - G / 2 * 0.05**2, 0.0)
    assert run.q[-1, 0] == pytest.approx(right, abs=1e-7)
    assert run.impacts.t == pytest.approx([0.0], abs=2e-9)
    assert run.audit().ok, str(run.audit())


def test_thrown_cube_has_one_limit():
    """It bounces, slides and turns flat on the ground, where its four normal forces are not unique: both modes take
    those nearest to the first ones, and low bounces end with the friction that they would have had."""
    scene, edge = bodies([pin.JointModelFreeFlyer()], G), 0.1048
    scene.model.inertias[1] = pin.Inertia(0.37, np.zeros(3), 8.1e-4 * np.eye(3))
    scene.add_plane("ground")
    scene.add_geometry("box", coal.Box(edge, edge, edge), "b0")
    scene.add_contact("box", "ground", mu=0.18, e_N=0.125)
    q0 = np.array([-0.00806, -0.21816, 0.138477, 0.2948, 0.8608, 0.4136, -0.0333])
    q0[3:] /= np.linalg.norm(q0[3:])
    v0 = np.array([0.34733, 0.533817, 1.153969, 4.464016, -1.258367, -1.744228])
    fixed = nga.simulate(scene, q0, v0, t_end=0.4, dt=0.4 / 1600)
    for rtol in (1e-5, 1e-7):
        run = nga.simulate(scene, q0, v0, t_end=0.4, rtol=rtol)
        assert np.abs(run.q[-1] - fixed.q[-1]).max() <= 10 * rtol + 3e-5


def test_a_cube_that_rocks_to_rest_keeps_the_tolerance():
    """It falls flat on the ground from corner to corner: each of them ends to bounce within the tolerance."""
    scene, edge = bodies([pin.JointModelFreeFlyer()], G), 0.1048
    scene.model.inertias[1] = pin.Inertia(0.37, np.zeros(3), 8.1e-4 * np.eye(3))
    scene.add_plane("ground")
    scene.add_geometry("box", coal.Box(edge, edge, edge), "b0")
    scene.add_contact("box", "ground", mu=0.18, e_N=0.125)
    q0 = np.array([-0.0442042, -0.278036, 0.163804, 0.0408228, 0.746378, 0.660429, -0.0713195])
    q0[3:] /= np.linalg.norm(q0[3:])
    v0 = np.array([-0.307236, 0.0732217, 1.09616, 4.96131, 0.048426, -0.357646])
    exact = nga.simulate(scene, q0, v0, t_end=0.41, rtol=1e-9)
    for rtol in (1e-6, 5e-7):
        run = nga.simulate(scene, q0, v0, t_end=0.41, rtol=rtol)
        assert np.abs(run.q[-1] - exact.q[-1]).max() <= 10 * rtol
