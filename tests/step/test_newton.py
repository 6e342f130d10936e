"""Semi-smooth Newton on the equations of a step: where it converges quadratically, and how it gives up."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.step.contact_history import memory
from ngalpha_pin.step.kinds import step_equations
from ngalpha_pin.step.newton import semi_smooth_newton
from ngalpha_pin.system.system import System


def equations_of(name, dt, **options):
    method = nga.GeneralizedAlpha()
    scene, q0, v0 = robots.load(name, **options)
    system = System(scene)
    state = initial_state(system, q0, v0)
    contacts = state.contacts
    return step_equations(
        system, method.parameters, state, dt, system.contacts.subset(contacts), memory(system, state, contacts)
    )


def test_a_smooth_step_converges_quadratically():
    equations = equations_of("arm", 2e-2)
    errors, evaluation = [], equations.evaluate(equations.start())
    while evaluation.error > 1.0 and len(errors) < 20:
        errors.append(evaluation.error)
        evaluation = equations.corrected(evaluation)[0]
    found, converged, n, dependent = semi_smooth_newton(equations, equations.evaluate(equations.start()), 20)
    assert converged and n == len(errors) <= 5 and not dependent
    np.testing.assert_array_equal(found.x, evaluation.x)


def test_it_gives_up():
    equations = equations_of("arm", 2e-2)
    start = equations.evaluate(equations.start())
    assert start.error > 1.0
    assert semi_smooth_newton(equations, start, 0)[1:] == (False, 0, False)
    nothing = equations.evaluate(np.full_like(start.x, np.nan))
    assert semi_smooth_newton(equations, nothing, 20)[1:] == (False, 0, False)
    # an iterate that is far worse than the first one ends it
    assert semi_smooth_newton(equations, start, 20, growth=1e-30)[2] <= 20


def test_a_solution_needs_no_correction():
    equations = equations_of("rotating_ball", 1e-2)
    found = semi_smooth_newton(equations, equations.evaluate(equations.start()), 20)[0]
    again, converged, n, _ = semi_smooth_newton(equations, found, 20)
    assert again is found and converged and n == 0


@pytest.mark.parametrize("name", ["ball_in_corner", "painleve_rod"])
def test_end_of_a_step_fulfils_the_equations(name):
    scene, q0, v0 = robots.load(name)
    system, method = System(scene), nga.GeneralizedAlpha()
    result = method.step(system, initial_state(system, q0, v0), 1e-3)
    assert result.converged and result.residual <= 1.0
