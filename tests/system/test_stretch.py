"""Steps kept as arrays are the steps that one makes one by one, and a recorder lays both out alike."""

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import coal
import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators.breakpoints import steps_ahead
from ngalpha_pin.results.recorder import Recorder
from ngalpha_pin.step.contact_history import keep_contacts
from ngalpha_pin.system.state import State
from ngalpha_pin.system.stretch import Stretch
from ngalpha_pin.system.system import System

DT = 1e-3
NONE = np.zeros(0)


def ahead(name: str, n: int):
    """A system, the state after its first step, and n steps from there."""
    scene, q0, v0 = robots.load(name)
    system, method = System(scene), nga.GeneralizedAlpha()
    first = method.step(system, initial_state(system, q0, v0), DT).state
    return system, method, first, steps_ahead(method, system, first, DT, n, NONE)


def same(one: State, other: State) -> bool:
    arrays, others = one.to_arrays(), other.to_arrays()
    return arrays.keys() == others.keys() and all(np.array_equal(arrays[name], others[name]) for name in arrays)


@pytest.mark.parametrize("name", ["rotating_ball", "four_bar"])
def test_a_stretch_has_the_steps_that_are_made_one_by_one(name):
    system, method, state, steps = ahead(name, 20)
    assert isinstance(steps, Stretch) and len(steps) == 20
    for result in steps:
        alone = method.step(system, state, DT)
        assert same(alone.state, result.state) and alone.n_iter == result.n_iter
        assert alone.solved_by is result.solved_by and alone.residual == result.residual
        state = result.state
    assert same(steps[-1].state, state) and [x.state.t for x in steps[3:5]] == [steps[3].state.t, steps[4].state.t]
    assert len(steps.head(7)) == 7 and same(steps.head(7)[6].state, steps[6].state)
    with pytest.raises(IndexError):
        steps[20]


def recorded(recorder: Recorder) -> nga.Trajectory:
    return recorder.trajectory(recorder.system.scene, "", DT, True, "")


def test_a_recorder_lays_stretches_and_single_steps_out_alike():
    system, _, first, steps = ahead("four_bar", 12)
    whole, single, mixed = (Recorder(system, first) for _ in range(3))
    whole.extend(steps)
    for i, result in enumerate(steps):
        single.add(result)
        if i == 4:
            mixed.extend(steps.head(5))
        elif i > 4:
            mixed.add(result)
    runs = [recorded(x) for x in (whole, single, mixed)]
    for name in ("t", "q", "v", "a", "la_g", "n_iter", "solver_path", "tau", "slot_ends"):
        assert all(np.array_equal(getattr(runs[0], name), getattr(run, name)) for run in runs[1:]), name
    assert len(whole) == 12 and same(whole.state, single.state) and whole.start is first
    for recorder in (whole, single, mixed):
        recorder.back_to(7)
        recorder.replace_last(steps[6].state)
        assert len(recorder) == 7 and same(recorder.state, steps[6].state)
        assert len(recorded(recorder).t) == 8


def test_contacts_that_have_let_go_are_forgotten_at_the_end_of_a_stretch():
    scene = nga.Scene()
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    scene.add_plane("ground")
    scene.add_contact("ball", "ground", mu=0.3)
    system, method = System(scene), nga.GeneralizedAlpha()
    lies = initial_state(system, np.array([0, 0, 0.1, 0, 0, 0, 1.0]), np.zeros(6))
    first = method.step(system, lies, DT).state
    steps = steps_ahead(method, system, first, DT, 5, NONE)
    assert isinstance(steps, Stretch) and steps.last is None
    steps = replace(steps, last=keep_contacts(system, steps[-1].state, np.array([False])))
    assert not len(steps[-1].state.contacts) and len(steps[-2].state.contacts) == 1
    whole, single = (Recorder(system, first) for _ in range(2))
    whole.extend(steps)
    for result in steps:
        single.add(result)
    runs = [recorded(recorder) for recorder in (whole, single)]
    for name in ("t", "q", "v", "la_N", "la_F", "P_N", "n_iter", "solver_path"):
        assert np.array_equal(*(getattr(run, name) for run in runs)), name
    assert runs[0].la_N[-2, 0] == pytest.approx(9.81) and runs[0].la_N[-1, 0] == 0.0


@pytest.mark.parametrize(("name", "calls", "states"), [("rotating_ball", 7.0, 120), ("four_bar", 4.0, 25)])
def test_a_run_of_plain_steps_makes_no_states_and_few_calls(name, calls, states):
    """A thousand steps; without stretches each makes a state. As measured, 82 and 14, and some room."""
    scene, q0, v0 = robots.load(name)
    made, home, init = Counter(), str(Path(nga.__file__).parent), State.__init__.__code__

    def count(frame, event, argument):
        if event == "call":
            made["calls"] += frame.f_code.co_filename.startswith(home)
            made["states"] += frame.f_code is init

    sys.setprofile(count)
    try:
        run = nga.simulate(scene, q0, v0, t_end=1000 * DT, dt=DT)
    finally:
        sys.setprofile(None)
    assert len(run.t) == 1001 and made["states"] <= states and made["calls"] <= 1000 * calls
