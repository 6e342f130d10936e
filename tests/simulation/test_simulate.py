"""Forces that a control loop holds for a step each: exact recursions, and no state outside of the state."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import expm

import ngalpha_pin as nga

MASS, STIFFNESS = 2.0, 50.0


def slide(stiffness=0.0):
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.appendBodyToJoint(joint, pin.Inertia(MASS, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = nga.Scene(model)
    if stiffness:
        scene.add_force(nga.JointSpring("x", stiffness))
    return scene


@pytest.mark.parametrize("dt", [1e-2, 1e-3])
def test_force_acts_for_the_steps_that_it_is_held(dt):
    """0 N until 0.1 s, then 1 N: v = 0.1 / m and x = 0.1^2 / (2 m) at 0.2 s."""
    simulator = nga.Simulator(slide(), dt)
    state = simulator.initial_state(np.zeros(1))
    for i in range(round(0.2 / dt)):
        state = simulator.step(state, tau=np.array([1.0]) if i * dt > 0.1 - 1e-9 else None)
    assert state.v[0] == pytest.approx(0.1 / MASS, rel=1e-12)
    assert state.q[0] == pytest.approx(0.005 / MASS, rel=1e-12)


def sampled_pd(dt, rate, stiffness=STIFFNESS, end=1.0):
    """Largest error of (x, v) under a PD law that is sampled and held, against the exponential of the held system."""
    simulator = nga.Simulator(slide(stiffness), dt)
    state = simulator.initial_state(np.array([0.1]))
    every, h = round(1 / (rate * dt)), 1 / rate
    A = np.array([[0.0, 1.0, 0.0], [-stiffness / MASS, 0.0, 1.0 / MASS], [0.0, 0.0, 0.0]])
    step, exact, worst, tau = expm(h * A), np.array([0.1, 0.0]), 0.0, None
    for i in range(round(end / dt)):
        if i % every == 0:
            worst = max(worst, float(np.abs(np.concatenate((state.q, state.v)) - exact).max()))
            tau = np.array([-30.0 * state.q[0] - 4.0 * state.v[0]])
            exact = (step @ np.append(exact, -30.0 * exact[0] - 4.0 * exact[1]))[:2]
        state = simulator.step(state, tau)
    return worst


@pytest.mark.parametrize("rate", [100, 1000])
def test_sampled_control_is_of_second_order(rate):
    sizes = [1e-3, 5e-4, 2.5e-4]
    errors = [sampled_pd(dt, rate) for dt in sizes]
    assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 1.9


def test_control_that_jumps_at_every_step_is_of_second_order():
    sizes = [4e-3, 2e-3, 1e-3]
    errors = [sampled_pd(dt, 1 / dt) for dt in sizes]
    assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 1.8


def test_force_that_pushes_a_resting_box_beyond_its_friction():
    """Held at 1.5 times what friction takes, then at half of it: slip with (1.5 - 1) mu g, then mu g / 2 against it."""
    model, mu, g, dt = pin.Model(), 0.4, 9.81, 1e-3
    x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    z = model.addJoint(x, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    model.appendBodyToJoint(z, pin.Inertia(MASS, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="z")
    scene.add_contact("ball", "ground", mu=mu)
    simulator = nga.Simulator(scene, dt)
    state, most = simulator.initial_state(np.array([0.0, 0.1])), mu * MASS * g
    for force, steps in ((0.9, 20), (1.5, 40), (0.5, 30)):
        for _ in range(steps):
            state = simulator.step(state, np.array([force * most, 0.0]))
    assert state.v[0] == pytest.approx(mu * g * (0.5 * 0.04 - 0.5 * 0.03), rel=1e-9)
    assert state.q[1] == pytest.approx(0.1, abs=1e-14)


def test_simulator_remembers_nothing_beside_the_state():
    simulator, ends = nga.Simulator(slide(), 1e-3), []
    for _ in range(2):
        state = simulator.initial_state(np.zeros(1))
        assert state.a[0] == 0.0
        for i in range(20):
            state = simulator.step(state, np.array([1.0 + i]))
        ends.append(state.q[0])
    assert ends[0] == ends[1]


def test_force_that_is_held_is_part_of_the_saved_state(tmp_path):
    """The step after a saved state knows that the force has not jumped."""
    simulator = nga.Simulator(slide(STIFFNESS), 1e-3)
    state = simulator.initial_state(np.array([0.1]))
    for _ in range(5):
        state = simulator.step(state, np.array([3.0]))
    np.savez(tmp_path / "state.npz", **state.to_arrays())
    again = nga.State.from_arrays(dict(np.load(tmp_path / "state.npz")))
    one, two = (simulator.step(s, np.array([3.0])) for s in (state, again))
    assert (one.q == two.q).all() and (one.v == two.v).all() and (one.a == two.a).all()
