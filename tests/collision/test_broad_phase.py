"""Which pairs of solids are looked at: never too few, and few."""

import coal
import numpy as np
import pinocchio as pin
from contact_scenes import chain

import ngalpha_pin as nga
from ngalpha_pin.collision import narrow_phase
from ngalpha_pin.system.system import System


def folded_chain():
    """Eight links with boxes on the way and a ground."""
    scene = chain(8, gap=0.3)
    for i in range(3):
        pose = pin.SE3(pin.exp3(np.array([0.3, 0.2 * i, 0.1])), np.array([0.6 * i, 0.1, -0.9]))
        scene.add_geometry(f"box_{i}", coal.Box(0.3, 0.4, 0.2), placement=pose)
    scene.add_plane("ground", point=(0, 0, -1.5))
    scene.add_contact("*", "*")
    return scene


def test_no_pair_within_reach_is_missed():
    """Along a random walk, with small steps that memory lives on and large ones that it must not trust."""
    system, rng = System(folded_chain()), np.random.default_rng(0)
    near, q = system.slots.proximity, np.zeros(8)
    for i in range(60):
        q = q + rng.normal(size=8) * (0.5 if i % 10 == 0 else 0.01)
        system.place(q)
        data = system.data
        true = np.array([narrow_phase.distance(p, near.pose(data, j)) for j, p in enumerate(near.pairs)])
        for reach in (0.0, 0.02, 0.2):
            assert near.within(data, reach).tolist() == np.flatnonzero(~(true > reach)).tolist()


def test_bounds_of_speeds_hold():
    """No point of B moves faster, seen from A: its support in any direction comes no nearer than that."""
    system, rng, h = System(folded_chain()), np.random.default_rng(1), 1e-6
    near = system.slots.proximity
    for _ in range(20):
        q, v = rng.normal(size=8), rng.normal(size=8)
        system.place_moving(q, v)
        speeds = near.speeds(system.data, np.arange(len(near.pairs)))
        before = [near.pose(system.data, i) for i in range(len(near.pairs))]
        system.place(q + h * v)
        m = rng.normal(size=3)
        for i, pair in enumerate(near.pairs):
            point = pair.solids[1].native.support(m / np.linalg.norm(m))
            way = near.pose(system.data, i).act(point) - before[i].act(point)
            assert np.linalg.norm(way) / h <= speeds[i] * (1 + 1e-4) + 1e-6


def test_slow_motion_costs_no_looks():
    scene = folded_chain()
    simulator = nga.Simulator(scene, 1e-3)
    state = simulator.initial_state(np.zeros(8))
    for _ in range(3):
        state = simulator.step(state)
    system = simulator.system
    near = system.slots.proximity.native
    before = near.looks
    system.slots.proximity.look(system.data, 0)
    assert near.looks == before + 1
    for _ in range(20):
        state = simulator.step(state)
    assert len(system.slots.pairs) > 30
    assert near.looks - before <= 21


def test_a_gap_that_no_motion_changes_is_no_contact():
    """Two fingers on slides along x that touch with their sides: the normal y belongs to no motion."""
    model = pin.Model()
    for i in range(2):
        joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), f"slide_{i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(0.1, 0.1, 0.1, 0.1), pin.SE3.Identity())
        model.addJointFrame(joint)
    scene = nga.Scene(model)
    for i in range(2):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.1 * i, 0.0]))
        scene.add_geometry(f"finger_{i}", coal.Box(0.1, 0.1, 0.1), parent=f"slide_{i}", placement=place)
    scene.add_contact("finger_0", "finger_1", mu=0.5)
    run = nga.simulate(scene, np.zeros(2), np.array([0.3, -0.2]), t_end=0.05, dt=1e-3)
    assert run.audit().ok
    assert not run.P_N.any()
    assert np.abs(run.q[-1] - [0.015, -0.01]).max() < 1e-15
