"""A round of contacts of many bodies: it solves a step that is linear, and agrees with the one of dense matrices."""

import numpy as np
import pytest
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.step.contact_history import memory
from ngalpha_pin.step.crowd import CrowdEquations
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.linearised_round import prox_round
from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.system.system import System

N, DT = 20, 1e-3
SPEEDS = {"rest": (0.0, 0.0), "slip": (2.0, 0.0), "impact": (0.5, -2.0)}
LAWS = {"second-order": LawOptions(paper=False), "captured": LawOptions(paper=True, displaces=False)}


def equations_of(kind, speed):
    """Balls without rotation in a row on a plane, all of them in contact."""
    system, method = System(balls(N, mu=0.3)), nga.GeneralizedAlpha()
    q0 = np.array([[0.3 * i, 0.0, 0.1] for i in range(N)]).ravel()
    state = initial_state(system, q0, np.tile([speed[0], 0.0, speed[1]], N))
    contacts = np.flatnonzero(system.gaps(system.contacts.subset(np.arange(system.contacts.n)), q0) <= 1e-9)
    sub = system.contacts.subset(contacts)
    assert sub.k == N
    return kind(system, method.parameters, state, DT, sub, memory(system, state, contacts))


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("name", SPEEDS)
def test_one_round_solves_a_linear_step(name, laws):
    equations = equations_of(CrowdEquations, SPEEDS[name])
    x, sets = prox_round(equations, equations.evaluate(equations.start(), LAWS[laws]))
    assert sets.A.all() and sets.B.all()
    assert sets.stick.all() == (name != "slip")
    assert equations.evaluate(x, LAWS[laws]).error <= 1.0


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("name", SPEEDS)
def test_the_same_as_with_dense_matrices(name, laws):
    found = []
    for kind in (CrowdEquations, StepEquations):
        equations = equations_of(kind, SPEEDS[name])
        found.append(prox_round(equations, equations.evaluate(equations.start(), LAWS[laws])))
    (x, sets), (wanted, wanted_sets) = found
    assert x == pytest.approx(wanted, abs=1e-8 * np.abs(wanted).max())
    for ours, theirs in zip(sets, wanted_sets, strict=True):
        assert np.array_equal(ours, theirs)
