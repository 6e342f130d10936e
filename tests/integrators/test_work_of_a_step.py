"""What a step may do, in counts: for every scene whose speed README, docs/speed.md and benchmarks/step_cost.py name.

A time cannot be asserted on any machine; what is computed in it can. A change that sends one of these scenes to
another path, or makes its steps dearer, has to change a number here and say why.
"""

import sys
from types import CodeType

import example_robot_data
import numpy as np
import pytest
from work import work_of

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators import plain_steps
from ngalpha_pin.system.state import SolvedBy
from ngalpha_pin.system.system import System

METHOD = nga.GeneralizedAlpha(rho_inf=0.5)
# options of the scene, steps before, steps counted and their length [s], part of them that the engine makes; then at
# most per step: evaluations, factorisations, calls of Pinocchio from Python, calls of functions of the package
SCENES = {
    "rotating_ball": ({"omega": 50.0}, 0, 750, 2e-3, 0.98, (1.05, 0.05, 0.1, 48)),
    "tippe_top": ({}, 0, 200, 1e-3, 0.97, (3.8, 2.8, 0.4, 52)),
    "solo12": ({"height": 0.0}, 100, 50, 1e-3, 0.9, (3.0, 2.0, 1.0, 114)),
    "go2": ({"height": 0.0}, 100, 50, 1e-3, 0.9, (3.0, 2.0, 1.0, 98)),
    "anymal": ({"height": 0.0}, 100, 50, 1e-3, 1.0, (3.0, 2.0, 0.0, 60)),
    "arm": ({}, 0, 50, 1e-3, 0.96, (2.4, 1.4, 0.2, 48)),
    "four_bar": ({}, 0, 200, 1e-3, 0.99, (3.1, 2.1, 0.1, 47)),
}


@pytest.mark.skipif(kernel.library is None, reason=f"no compiled kernel: {kernel.origin}")
@pytest.mark.parametrize("name", SCENES)
def test_work_of_a_step(name):
    options, before, steps, dt, share, most = SCENES[name]
    scene, q0, v0 = robots.load(name, **options)
    system = System(scene)
    state = initial_state(system, q0, v0)
    for _ in range(before):
        state = METHOD.step(system, state, dt).state
    work = work_of(system, state, dt, steps, METHOD)
    assert not {"numpy", "crowd"} & set(work.counts)
    assert work.counts["plain"] >= share * steps
    assert set(work.solved_by) <= {SolvedBy.NEWTON, SolvedBy.IMPACT, SolvedBy.SLIP}
    done = (work.counts["evaluations"], work.counts["factorisations"], work.pinocchio, work.python)
    assert [n / steps <= bound for n, bound in zip(done, most, strict=True)] == 4 * [True], [n / steps for n in done]
    # a robot that stands has its feet as unknowns from the beginning: no equations are set up twice
    if before:
        assert work.counts["plain"] + work.counts["attempts"] == steps and not work.counts["compiled"]
        assert work.solved_by[SolvedBy.NEWTON] == steps


@pytest.mark.skipif(kernel.library is None, reason=f"no compiled kernel: {kernel.origin}")
def test_work_of_an_arm_that_falls():
    """The Panda of docs/speed.md, without contact: the engine makes every step but the first, in one correction."""
    robot = example_robot_data.load("panda")
    scene = nga.Scene(robot.model)
    scene.joints = nga.JointLaws(limits=False)
    system = System(scene)
    work = work_of(system, initial_state(system, robot.q0, np.zeros(system.nv)), 1e-3, 100, METHOD)
    assert work.counts["plain"] == 99 and work.counts["solved"] == 1
    assert work.counts["evaluations"] <= 210 and work.counts["factorisations"] <= 110
    assert work.pinocchio <= 1 and work.python <= 4_800


def test_feet_are_points_whatever_their_mesh():
    """The feet of Solo12 have some 670 corners each; all of them are points, which the kernel knows."""
    system = System(robots.load("solo12")[0])
    assert system.slots.n == 0
    assert system.contacts.n_fixed == system.contacts.n_points > 4 * 300


def feet(name):
    scene, q0, v0 = robots.load(name, height=0.002)
    system = System(scene)
    return system, initial_state(system, q0, v0)


def all_shapes(name):
    """It falls by 5 mm, any of its shapes may touch the ground."""
    robot = example_robot_data.load(name)
    scene = nga.Scene(robot.model, robot.collision_model)
    scene.add_plane("ground")
    scene.add_contact("*", "ground", mu=0.8)
    scene.add_force(nga.JointPD(robot.q0, kp=300.0, kd=10.0))
    q0 = robot.q0.copy()
    q0[2] += 0.005
    if name != "talos":
        q0 = scene.place_on("ground", q0, 2e-3)
    system = System(scene)
    return system, initial_state(system, q0, np.zeros(system.nv))


def pushed(name):
    """Random torques push its joints about, as those of an untrained policy."""
    scene, q0, _ = robots.load(name, height=0.0, kp=40.0, kd=1.0)
    simulator, tau = nga.Simulator(scene, 1e-3), np.zeros(18)
    tau[6:] = np.random.default_rng(0).uniform(-5.0, 5.0, 12)
    return simulator.system, simulator.step(simulator.initial_state(scene.place_on("ground", q0, 1e-3)), tau)


# steps, parts of them that the engine makes alone; of the attempts at others the part that it solves at least; and at
# most: sets of equations that are set up outside of it, and calls of functions of the package
EVENTS = {
    (feet, "go2"): (60, 0.93, 1.0, 8, 9_500),
    (feet, "anymal"): (60, 0.93, 1.0, 0, 5_500),
    (all_shapes, "solo12"): (60, 0.88, 0.95, 28, 21_500),
    (pushed, "quadruped"): (60, 0.8, 0.85, 9, 12_500),
}


@pytest.mark.filterwarnings("ignore::UserWarning")  # pairs of the file that overlap are left out
@pytest.mark.skipif(kernel.library is None, reason=f"no compiled kernel: {kernel.origin}")
@pytest.mark.parametrize("scene, name", EVENTS)
def test_work_of_steps_in_which_contacts_close_and_slip(scene, name):
    steps, share, native, outside, calls = EVENTS[scene, name]
    system, state = scene(name)
    work = work_of(system, state, 1e-3, steps, METHOD)
    assert not {"numpy", "crowd"} & set(work.counts)
    assert work.counts["plain"] >= share * steps
    assert work.counts["compiled"] <= outside and work.python <= calls
    assert work.counts["solved"] >= native * work.counts["attempts"] > 0


@pytest.mark.filterwarnings("ignore::UserWarning")  # pairs of the file that overlap are left out
def test_work_of_a_landing_on_feet_of_many_corners():
    """Talos lands with all of its shapes: an impact may be followed by others, and slips of corners end behind them."""
    robot = example_robot_data.load("talos")
    scene = nga.Scene(robot.model, robot.collision_model)
    scene.add_plane("ground")
    scene.add_contact("*", "ground", mu=0.8)
    q0 = robot.q0.copy()
    q0[2] += 0.005
    scene.add_force(nga.JointPD(q0, kp=300.0, kd=10.0))
    run = nga.simulate(scene, q0, t_end=0.045, dt=1e-3)
    assert run.success and len(run.impacts.t) > 4
    assert run.n_iter.sum() <= 250


class Watched(plain_steps.Plain):
    """Notes the calls from `simulate` down to where the engine takes steps, which calls Pinocchio."""

    paths: set[tuple[CodeType, ...]] = set()

    def __getattribute__(self, name):
        if name == "engine":
            path, frame = [], sys._getframe(1)
            while frame is not None and frame.f_code.co_name != "simulate":
                path, frame = [frame.f_code, *path], frame.f_back
            if frame is not None and path and path[-1].co_name == "plain_steps":
                self.paths.add((frame.f_code, *path))
        return super().__getattribute__(name)


@pytest.mark.skipif(kernel.library is None, reason=f"no compiled kernel: {kernel.origin}")
@pytest.mark.parametrize("name", ["rotating_ball", "four_bar"])
def test_calls_from_simulate_to_the_engine(name, monkeypatch):
    """At most six, through five files; the one that follows is the engine's, which makes many steps in it."""
    monkeypatch.setattr(plain_steps, "Plain", Watched)
    monkeypatch.setattr(Watched, "paths", set())
    run = nga.simulate(*robots.load(name), t_end=0.1, dt=2e-3)
    assert run.success and len(Watched.paths) >= 1
    quickest = min(Watched.paths, key=len)
    assert len(quickest) <= 6 and len({code.co_filename for code in quickest}) <= 5
