"""Balls that fly by more than their size in one step do not pass through each other."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.integrators import plain_steps

RADIUS = 0.05


def balls(n=2, e_N=1.0, gravity=0.0):
    """Balls of 1 kg that are free to move, every pair of them in contact."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    for i in range(n):
        joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), f"body_{i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, RADIUS), pin.SE3.Identity())
    scene = nga.Scene(model)
    for i in range(n):
        scene.add_geometry(f"ball_{i}", coal.Sphere(RADIUS), f"body_{i}")
        for j in range(i):
            scene.add_contact(f"ball_{j}", f"ball_{i}", e_N=e_N)
    return scene


def flight(q, v, e_N, t):
    """Where two equal balls are after their first impact: relative motion before it is straight."""
    d, u = q[3:] - q[:3], v[3:] - v[:3]
    b, c = d @ u, d @ d - 4.0 * RADIUS**2
    hit = (-b - np.sqrt(b * b - (u @ u) * c)) / (u @ u)
    at, n = q + hit * v, (d + hit * u) / (2.0 * RADIUS)
    after = v + (1.0 + e_N) / 2.0 * (u @ n) * np.concatenate((n, -n))
    return at + (t - hit) * after, after


@pytest.mark.parametrize("e_N", [0.0, 0.8])
@pytest.mark.parametrize("speed", [30.0, 1000.0])
@pytest.mark.parametrize("options", [{"dt": 1e-2}, {"rtol": 1e-6}])
def test_two_balls_meet_as_their_straight_ways_do(options, speed, e_N):
    random = np.random.default_rng(int(speed))
    for past in (0.0, 0.99):  # by how much the ways miss the centres, in parts of the distance of contact
        across = past * 2.0 * RADIUS * np.array([0.0, *np.array([1.0, 0.3]) / np.hypot(1.0, 0.3)])
        q = np.concatenate(([-0.5, 0.0, 0.0], np.array([0.5 + 0.1 * random.random(), 0.0, 0.0]) + across))
        v = speed * np.array([1.0, 0.0, 0.0, -1.0, 0.0, 0.0])
        t_end = max(1.2 / speed, options.get("dt", 0.0))
        run = nga.simulate(balls(e_N=e_N), q, v, t_end=t_end, **options)
        right_q, right_v = flight(q, v, e_N, run.t[-1])
        assert run.v[-1] == pytest.approx(right_v, abs=1e-5 * speed)
        assert run.q[-1] == pytest.approx(right_q, abs=1e-5 * (1.0 + speed * t_end))


def test_a_row_of_balls_is_hit_one_after_the_other_in_one_step():
    """Equal elastic balls in a row hand the velocity on: the last one flies, the others stand where they were hit."""
    n, speed, dt = 5, 100.0, 1e-2
    q = np.zeros((n, 3))
    q[:, 0] = 0.15 * np.arange(n)
    v = np.zeros((n, 3))
    v[0, 0] = speed
    run = nga.simulate(balls(n), q.ravel(), v.ravel(), t_end=dt, dt=dt)
    expected = q[:, 0] + np.append(np.full(n - 1, 0.15 - 2 * RADIUS), 0.0)
    expected[-1] += speed * (dt - (n - 1) * (0.15 - 2 * RADIUS) / speed)
    assert run.q[-1].reshape(n, 3)[:, 0] == pytest.approx(expected, abs=1e-9)
    assert run.v[-1].reshape(n, 3)[:, 0] == pytest.approx([0.0] * (n - 1) + [speed], abs=1e-9)


def ball_and_fixed_one(place, gravity):
    """A ball that is free to move, and one that is fixed at a place."""
    scene = balls(1, gravity=gravity)
    scene.add_geometry("fixed", coal.Sphere(RADIUS), "universe", pin.SE3(np.eye(3), np.array(place)))
    scene.add_contact("ball_0", "fixed", e_N=0.5)
    return scene


def test_ways_that_bend_are_followed():
    """A ball is thrown over a fixed one, which the top of its parabola goes through, and comes down behind it."""
    scene = ball_and_fixed_one([0.6, 0.0, 0.48], 1000.0)
    q, v = np.zeros(3), np.array([20.0, 0.0, 30.0])
    coarse, fine = (nga.simulate(scene, q, v, t_end=0.06, dt=dt).v[-1] for dt in (0.06, 1e-4))
    assert abs(fine[0] - 20.0) > 1.0
    assert coarse == pytest.approx(fine, abs=1e-2)


def test_what_misses_or_is_slow_costs_nothing(monkeypatch):
    """Ways that pass at a distance stay whole; slow balls are for the engine as before."""
    q, v = np.array([-0.5, 0, 0, 0.5, 0, 2.1 * RADIUS]), 30.0 * np.array([1.0, 0, 0, -1.0, 0, 0])
    run = nga.simulate(balls(), q, v, t_end=4e-2, dt=1e-2)
    assert set(run.solver_path[1:]) == {"newton"} and run.v[-1].tolist() == v.tolist()

    def refused(*_):
        raise AssertionError("the way was looked at")

    monkeypatch.setattr("ngalpha_pin.system.fly_past._relative", refused)
    nga.simulate(balls(), q, v / 100.0, t_end=1e-2, dt=1e-3)


def test_the_engine_gives_fast_steps_back(monkeypatch):
    """A ball falls on a fixed one, in steps that the engine makes ahead until one of them could pass it."""
    steps, slow = [], plain_steps._slow

    def counted(system, near, dt, found):
        kept = slow(system, near, dt, found)
        steps.append(len(found) - len(kept))
        return kept

    monkeypatch.setattr(plain_steps, "_slow", counted)
    height, gravity, speed = 0.29, 500.0, 2.5
    scene = ball_and_fixed_one([0.0, 0.0, 0.0], gravity)
    run = nga.simulate(scene, np.array([0.0, 0.0, height]), np.array([0.0, 0.0, -speed]), t_end=0.03, dt=5e-3)
    rate = np.sqrt(speed**2 + 2.0 * gravity * (height - 2.0 * RADIUS))
    hit = (rate - speed) / gravity
    assert max(steps) > 0
    assert run.v[-1, 2] == pytest.approx(0.5 * rate - gravity * (run.t[-1] - hit), rel=1e-6)
