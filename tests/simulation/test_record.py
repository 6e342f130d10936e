"""What is stepped by hand is a trajectory: the one of simulate, with torques, saved, judged, joined."""

from types import SimpleNamespace

import numpy as np
import pytest
from box_scenes import stack

import ngalpha_pin as nga
from ngalpha_pin import robots, viz

ARRAYS = ("t", "q", "v", "a", "P_N", "la_N", "La_N", "P_F", "la_F", "La_F", "tau_f", "P_f", "n_iter", "solver_path")


def same_bits(a, b, names=ARRAYS):
    return [name for name in names if not np.array_equal(getattr(a, name), getattr(b, name))] == []


def by_hand(name, n, dt=2e-3, tau=None, **parameters):
    scene, q0, v0 = robots.load(name, **parameters)
    simulator = nga.Simulator(scene, dt, record=True)
    state = simulator.initial_state(q0, v0)
    states = [state]
    for i in range(n):
        state = simulator.step(state, None if tau is None else tau(i))
        states.append(state)
    return simulator, states


def test_it_is_the_trajectory_of_simulate(tmp_path):
    simulator, _ = by_hand("quadruped", 60, height=0.02)
    run = simulator.trajectory()
    scene, q0, v0 = robots.load("quadruped", height=0.02)
    whole = nga.simulate(scene, q0, v0, t_end=0.12, dt=2e-3)
    assert same_bits(run, whole) and same_bits(run.impacts, whole.impacts, ("t", "step", "v_after", "P_N"))
    assert run.audit().ok and run.events == whole.events
    run.save(tmp_path / "run.npz")
    assert same_bits(nga.Trajectory.load(tmp_path / "run.npz"), whole)
    viz.save_html(run, tmp_path / "run.html")
    assert (tmp_path / "run.html").stat().st_size > 100_000
    assert run.message == "stepped by hand"


def test_torques_that_come_and_go_are_in_the_audit():
    """A torque is held in some steps and not in others; its work is known."""
    weight = np.linspace(1.0, -1.0, 7)
    simulator, _ = by_hand("arm", 100, dt=1e-3, tau=lambda i: 3.0 * weight if 20 <= i < 60 else None)
    run = simulator.trajectory()
    assert run.tau.shape == (101, 7) and run.tau[30] == pytest.approx(3.0 * weight)
    assert not run.tau_step[20].any() and run.tau_step[21] == pytest.approx(3.0 * weight)
    assert run.tau[20] == pytest.approx(3.0 * weight) and not run.tau[60].any()
    assert run.audit().ok, str(run.audit())


def test_a_step_from_an_earlier_state_takes_back_what_came_after_it():
    simulator, states = by_hand("quadruped", 30, height=0.02)
    first = simulator.trajectory()
    simulator.step(states[10])
    assert same_bits(simulator.trajectory(), _cut(first, 12))
    # of elsewhere: it begins anew
    other = nga.Simulator(simulator.scene, 2e-3)
    scene_state = other.step(states[20])
    simulator.step(scene_state)
    assert simulator.trajectory().t == pytest.approx([0.042, 0.044])


def _cut(run, n):
    return SimpleNamespace(**{name: getattr(run, name)[:n] for name in ARRAYS})


def test_errors_say_what_to_do():
    scene, q0, v0 = robots.load("arm")
    with pytest.raises(nga.SceneError, match="record=True"):
        nga.Simulator(scene, 1e-3).trajectory()
    with pytest.raises(nga.SceneError, match="nothing was recorded"):
        nga.Simulator(scene, 1e-3, record=True).trajectory()
    with pytest.raises(nga.SceneError, match="record = 3: expected True or False"):
        nga.Simulator(scene, 1e-3, record=3)


def test_names_are_public():
    scene, q0, v0 = robots.load("quadruped")
    names = nga.Simulator(scene, 1e-3).names
    assert "FL_knee" in names["joints"] and "FL_foot_0/ground" in names["pairs"]
    assert "FL_knee lower limit" in names["contacts"] and names["forces"] == ("JointPD",)


def test_chunks_join_to_the_whole_run(tmp_path):
    scene, q0, v0 = robots.load("quadruped", height=0.02)
    whole = nga.simulate(scene, q0, v0, t_end=0.12, dt=2e-3)
    nga.simulate(scene, q0, v0, t_end=0.12, dt=2e-3, save_to=tmp_path / "run", every=25)
    chunks = nga.Chunks(tmp_path / "run")
    run = chunks.join()
    assert len(chunks) == 3 and same_bits(run, whole)
    assert same_bits(run.impacts, whole.impacts, whole.impacts._fields) and run.impacts.t.size > 0
    assert run.audit().penetration == whole.audit().penetration
    assert run.energy.total == pytest.approx(whole.energy.total, abs=1e-12)
    joined = nga.Trajectory.join([chunks[0], chunks[1]])
    assert len(joined.t) == 51 and joined.final_state.t == pytest.approx(0.1)
    with pytest.raises(nga.SceneError, match="run 1 begins at t = 0.1 s where run 0 has not ended"):
        nga.Trajectory.join([chunks[0], chunks[2]])
    with pytest.raises(nga.SceneError, match="run 1 = 2: expected a Trajectory"):
        nga.Trajectory.join([chunks[0], 2])


def test_joined_runs_of_boxes_keep_their_features():
    """Shapes whose touching features change: their places in the run."""
    scene, q0 = stack(2)
    whole = nga.simulate(scene, q0, t_end=0.04, dt=2e-3)
    first = nga.simulate(scene, q0, t_end=0.02, dt=2e-3)
    second = nga.simulate(scene, state=first.final_state, t_end=0.04, dt=2e-3)
    run = nga.Trajectory.join([first, second])
    assert same_bits(run, whole, ("t", "q", "v", "la_N", "slots", "slot_ends"))
    assert run.g_N == pytest.approx(whole.g_N, abs=1e-15)
