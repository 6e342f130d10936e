"""What turns by a large part of a turn, or by several, in one step does not pass through what is in its way."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

import ngalpha_pin as nga
from ngalpha_pin.integrators import division

ARM, RADIUS, LENGTH = 0.4, 0.05, 1.0
PLACES = slice(0, 3), slice(3, 6)


def blade_and_ball(away=0.0):
    """A blade about z and a ball on a slide along x, beside its circle."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "blade")
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, LENGTH, 0.05, 0.02), pin.SE3.Identity())
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3(np.eye(3), np.array([0.0, ARM + away, 0.0])), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, RADIUS), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry("blade", coal.Box(LENGTH, 0.05, 0.02), "blade")
    scene.add_geometry("ball", coal.Sphere(RADIUS), "ball")
    scene.add_contact("blade", "ball")
    return scene


@pytest.mark.parametrize("degrees", [90, 180, 360, 720])
def test_a_blade_does_not_pass_through_a_ball(degrees):
    dt = 1e-3
    scene, v0 = blade_and_ball(), np.array([np.radians(degrees) / dt, 0.0])
    run = nga.simulate(scene, np.array([0.3, 0.0]), v0, t_end=3 * dt, dt=dt)
    # angular momentum goes over without restitution: energy falls by the ball's part of the inertia about the axis
    assert run.v[-1, 1] < -0.2 * v0[0] * ARM
    inertia = scene.model.inertias[1].inertia[2, 2]
    assert run.energy.kinetic[-1] / run.energy.kinetic[0] == pytest.approx(inertia / (inertia + ARM**2), rel=0.15)


def test_what_it_does_not_reach_costs_nothing():
    """The ball is beyond the tip of the blade: steps stay whole, and the blade keeps its speed."""
    dt = 1e-3
    run = nga.simulate(blade_and_ball(0.2), np.array([0.3, 0.0]), np.array([2 * np.pi / dt, 0.0]), t_end=5 * dt, dt=dt)
    assert set(run.solver_path[1:]) == {"newton"} and not run.P_N.any()
    assert run.v[-1].tolist() == [2 * np.pi / dt, 0.0]


def test_what_no_halving_shows_to_stay_apart_is_an_error(monkeypatch):
    dt = 1e-3
    monkeypatch.setattr(division, "meet_on_the_way", lambda *_: True)
    with pytest.raises(nga.NotConverged, match="try a smaller dt"):
        nga.simulate(blade_and_ball(), np.array([0.3, 0.0]), np.array([2 * np.pi / dt, 0.0]), t_end=dt, dt=dt)


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
@pytest.mark.parametrize("seed", range(3))
def test_boxes_that_come_from_afar_meet_with_the_features_that_they_have_there(seed, dt):
    """Turned at random, 2000 m/s: edges that are nearest from afar pass each other without a gap that vanishes."""
    model, rng, half = pin.Model(), np.random.default_rng(seed), np.array([0.05, 0.04, 0.03])
    model.gravity.linear = np.zeros(3)
    scene = nga.Scene(model)
    for name in "ab":
        joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, RADIUS), pin.SE3.Identity())
        model.addJointFrame(joint)
    for name in "ab":
        turned = pin.SE3(pin.exp3(rng.normal(size=3)), np.zeros(3))
        scene.add_geometry(f"box {name}", coal.Box(*(2 * half)), name, turned)
    scene.add_contact("box a", "box b", e_N=1.0)
    towards = rng.normal(size=3)
    towards /= np.linalg.norm(towards)
    q0, v0 = np.r_[-0.4 * towards, 0.4 * towards], 1e3 * np.r_[towards, -towards]

    def distance(t):
        shapes = [scene.geometry(f"box {name}") for name in "ab"]
        at = [coal.Transform3s(s.placement.rotation, (q0 + t * v0)[p]) for s, p in zip(shapes, PLACES, strict=True)]
        return coal.distance(shapes[0].geometry, at[0], shapes[1].geometry, at[1], coal.DistanceRequest(),
                             coal.DistanceResult())  # fmt: skip

    run = nga.simulate(scene, q0, v0, t_end=2 * dt, dt=dt)
    assert run.impacts.t[0] == pytest.approx(brentq(distance, 0.0, 4e-4), rel=1e-6)
    assert set(run.solver_path.tolist()) <= {"start", "impact", "newton"} and len(run.impacts.t) == 1
    assert run.audit().ok, str(run.audit())


@pytest.mark.parametrize("other", ["cone", "box"])
@pytest.mark.parametrize("options", [{"rtol": 1e-3}, {"dt": 1e-2}])
def test_rims_do_not_pass_what_they_meet(other, options):
    """A cone and a box, or another cone, fly head-on: rims run around, and steps with fixed points see nothing."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    shapes = {"cone": coal.Cone(RADIUS, 0.1), "box": coal.Box(0.1, 0.1, 0.1)}
    for name in "ab":
        joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, RADIUS), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry("left", shapes["cone"], "a")
    scene.add_geometry("right", shapes[other], "b")
    scene.add_contact("left", "right", e_N=1.0)
    q, v = np.array([-0.5, 0.0, 0.0, 0.5, 0.003, 0.002]), 30.0 * np.array([1.0, 0, 0, -1.0, 0, 0])
    run = nga.simulate(scene, q, v, t_end=0.04, **options)
    # momentum and energy are kept: the impulse is along the slope of the cone, 1 : 2, or around its axis
    assert run.v[-1, 0] < 0.0 < run.v[-1, 3]
    assert run.v[-1, :3] + run.v[-1, 3:] == pytest.approx(np.zeros(3), abs=1e-9)
    assert run.energy.kinetic[-1] == pytest.approx(run.energy.kinetic[0], rel=1e-3)


@pytest.mark.parametrize("shape", [coal.Box(0.1, 0.2, 0.3), coal.Ellipsoid(0.1, 0.2, 0.3)])
def test_planes_that_have_turned_away_meet_nothing(shape):
    """A body turns far in every step beside a ball that it is nowhere near: planes of its start sweep over the ball."""
    scene, dt = nga.Scene(), 1e-2
    scene.add_body("turns", shape, mass=1.0)
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    scene.add_contact("turns", "ball", mu=0.5, e_N=0.9)
    v0 = np.concatenate((np.zeros(3), np.array([100.0, 200.0, 400.0]), np.zeros(6)))
    q0 = np.array([0, 0, 0, 0, 0, 0, 1.0, 0.8, 0, 0, 0, 0, 0, 1.0])
    run = nga.simulate(scene, q0, v0, t_end=60 * dt, dt=dt)
    assert not run.P_N.any() and set(run.solver_path[1:]) == {"newton"}
    assert run.n_iter.max() <= 8
