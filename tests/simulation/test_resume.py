"""A run that is saved and continued, stepped by hand or repeated gives the same bits."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots

SYSTEMS = {"rotating_ball": 1e-3, "tippe_top": 1e-3, "quadruped": 2e-3, "ball_in_cylinder": 1e-2}
"""Systems with the step [s] of their run of 300 steps, which takes each of them through an impact or a slip."""
STEPS = 300
ARRAYS = ("q", "v", "a", "P_N", "la_N", "La_N", "P_F", "la_F", "La_F")


def scene_of(name):
    parameters = {"rotating_ball": {"height": 0.2}, "quadruped": {"height": 0.02}}
    return robots.load(name, **parameters.get(name, {}))


@pytest.fixture(scope="module", params=SYSTEMS)
def whole(request):
    scene, q0, v0 = scene_of(request.param)
    dt = SYSTEMS[request.param]
    return request.param, dt, nga.simulate(scene, q0, v0, t_end=STEPS * dt, dt=dt)


def same_bits(a, b):
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in (*ARRAYS, "t", "n_iter", "solver_path"))


def test_same_run_twice_gives_the_same_bits(whole):
    name, dt, first = whole
    scene, q0, v0 = scene_of(name)
    assert same_bits(first, nga.simulate(scene, q0, v0, t_end=STEPS * dt, dt=dt))
    assert (first.P_N > 0).any()


@pytest.mark.parametrize("half", [97, 150, 211])
def test_saved_and_continued_run_gives_the_same_bits(whole, half, tmp_path):
    name, dt, first = whole
    scene, q0, v0 = scene_of(name)
    nga.simulate(scene, q0, v0, t_end=half * dt, dt=dt).save(tmp_path / "half.npz")
    state = nga.Trajectory.load(tmp_path / "half.npz").final_state
    rest = nga.simulate(scene_of(name)[0], state=state, t_end=STEPS * dt)
    for array in ARRAYS:
        assert np.array_equal(getattr(rest, array), getattr(first, array)[half:]), array
    assert np.array_equal(rest.t, first.t[half:])
    assert np.array_equal(rest.n_iter[1:], first.n_iter[half + 1 :])


def test_steps_by_hand_give_the_same_bits(whole):
    name, dt, first = whole
    scene, q0, v0 = scene_of(name)
    simulator = nga.Simulator(scene, dt)
    state = simulator.initial_state(q0, v0)
    for i in range(STEPS + 1):
        assert state.t == first.t[i]
        assert np.array_equal(state.q, first.q[i])
        assert np.array_equal(state.v, first.v[i])
        assert np.array_equal(state.la_N, first.la_N[i, state.contacts])
        state = simulator.step(state) if i < STEPS else state


def test_step_does_not_depend_on_what_the_simulator_did_before(whole):
    name, dt, _ = whole
    scene, q0, v0 = scene_of(name)
    simulator = nga.Simulator(scene, dt)
    state = simulator.initial_state(q0, v0)
    for _ in range(20):
        state = simulator.step(state)
    first = simulator.step(state)
    for _ in range(3):
        simulator.step(first, tau=np.ones(scene.model.nv))
    again = simulator.step(state)
    assert np.array_equal(first.q, again.q)
    assert np.array_equal(first.v, again.v)
    assert np.array_equal(first.a, again.a)


def test_torque_that_is_held_is_the_one_of_a_force_law():
    scene, q0, v0 = robots.load("arm")
    tau = np.linspace(1.0, -1.0, 7)
    simulator = nga.Simulator(scene, 1e-3)
    state = simulator.initial_state(q0, v0)
    controlled, _, _ = robots.load("arm")
    controlled.add_force(nga.Control(lambda t, q, v: tau))
    for _ in range(100):
        state = simulator.step(state, tau=tau)
    run = nga.simulate(controlled, q0, v0, t_end=0.1, dt=1e-3)
    assert np.abs(run.q[-1] - state.q).max() < 1e-9


def test_steps_of_another_length_go_on_to_second_order():
    """a_bar belongs to a time that depends on dt; a run that halves its step on the way stays as good."""
    scene, q0, v0 = robots.load("arm")
    fine = nga.simulate(scene, q0, v0, t_end=1.0, dt=1.25e-4).q[-1]
    errors = []
    for dt in (4e-3, 2e-3):
        half = nga.simulate(scene, q0, v0, t_end=0.4, dt=dt).final_state
        third = nga.simulate(scene, state=half, t_end=0.6, dt=dt / 2).final_state
        errors.append(np.abs(nga.simulate(scene, state=third, t_end=1.0, dt=dt).q[-1] - fine).max())
    assert errors[1] < errors[0] / 3.5


@pytest.mark.parametrize("name", SYSTEMS)
def test_everything_comes_back_from_a_file(name, tmp_path):
    scene, q0, v0 = scene_of(name)
    run = nga.simulate(scene, q0, v0, t_end=60 * SYSTEMS[name], dt=SYSTEMS[name])
    run.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    assert same_bits(run, loaded)
    assert (loaded.method, loaded.dt, loaded.success, loaded.message) == (run.method, run.dt, run.success, run.message)
    assert loaded.contact_names == run.contact_names
    assert loaded.friction_rows == run.friction_rows
    # kinematics from the scene of the file
    assert np.array_equal(loaded.g_N, run.g_N)
    assert np.array_equal(loaded.gamma_F, run.gamma_F)
    assert loaded.events == run.events
    for x, y in zip(loaded.contact_frames(30), run.contact_frames(30), strict=True):
        assert np.array_equal(x, y)
    assert [g.name for g in loaded.scene.collision_model.geometryObjects] == [
        g.name for g in scene.collision_model.geometryObjects
    ]
    assert (loaded.scene.added, loaded.scene.hollow) == (scene.added, scene.hollow)


def test_a_state_cannot_be_written_to():
    scene, q0, v0 = robots.load("rotating_ball")
    simulator = nga.Simulator(scene, 1e-3)
    start = simulator.initial_state(q0, v0)
    with pytest.raises(ValueError, match="read-only"):
        start.q[0] = 1.0
    q0[0] = 5.0
    assert start.q[0] == 0.0
