"""What is kept of the features of pairs from step to step."""

import numpy as np

import ngalpha_pin as nga
from ngalpha_pin import robots


def test_nothing_is_looked_at_again_in_a_stack_at_rest():
    scene, q0, v0 = robots.load("wall", rows=3, columns=1)
    simulator = nga.Simulator(scene, 1e-3)
    state = simulator.initial_state(q0, v0)
    places = simulator.system.slots.native
    before = places.looks
    for _ in range(20):
        state = simulator.step(state)
    # a quiver of 1e-17 m may go over a line of the grid now and then
    assert 0 < before and places.looks - before <= 20 and np.abs(state.v).max() < 1e-12


def test_features_are_those_of_a_state_whatever_was_looked_at_before():
    scene, q0, v0 = robots.load("wall", rows=2, columns=1, speed=1.0)
    first, second = (nga.Simulator(scene, 1e-3) for _ in range(2))
    state = first.initial_state(q0, v0)
    for _ in range(5):
        state = first.step(state)
    goes_on, anew = first.step(state), second.step(state)
    assert goes_on.q.tobytes() == anew.q.tobytes() and goes_on.slots.tobytes() == anew.slots.tobytes()
