"""A round of contact problems: it solves a step that is linear, and comes near where one is not."""

import numpy as np
import pytest
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.step.contact_history import memory
from ngalpha_pin.step.kinds import step_equations
from ngalpha_pin.step.linearised_round import prox_round
from ngalpha_pin.system.system import System


@pytest.mark.parametrize("speed, closed, sticks", [(0.0, True, True), (2.0, True, False), (-3.0, True, False)])
def test_balls_on_a_plane(speed, closed, sticks):
    """Masses without rotation on a plane: the step is linear, so that one round is the solution."""
    scene, dt = balls(2, mu=0.3), 1e-3
    system, method = System(scene), nga.GeneralizedAlpha()
    q0 = np.array([0.0, 0.0, 0.1, 1.0, 0.0, 0.1])
    state = initial_state(system, q0, np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]))
    contacts = np.flatnonzero(system.gaps(system.contacts.subset(np.arange(system.contacts.n)), q0) <= 1e-9)
    sub = system.contacts.subset(contacts)
    equations = step_equations(system, method.parameters, state, dt, sub, memory(system, state, contacts))
    x, sets = prox_round(equations, equations.evaluate(equations.start()))
    assert (sets.A[:2] == closed).all() and (sets.B[:2] == closed).all()
    assert bool(sets.stick[0]) == sticks and bool(sets.stick[1])
    assert equations.evaluate(x).error <= 1.0
