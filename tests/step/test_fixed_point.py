"""Steps whose percussions do all of the work: what counts as closed there, and what they solve."""

import numpy as np
import pytest
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.step.contact_history import memory
from ngalpha_pin.step.fixed_point import by_percussions, fixed_point
from ngalpha_pin.step.kinds import step_equations
from ngalpha_pin.system.system import System

N, DT = 40, 1e-3


def equations_of(height, speed):
    """Balls in a row, so many that nothing but contacts couples, at a height above the plane."""
    scene = balls(N, mu=0.3)
    q0 = np.array([[0.3 * i, 0.0, 0.1 + height] for i in range(N)]).ravel()
    v0 = np.tile([0.5, 0.0, speed], N)
    system, method = System(scene), nga.GeneralizedAlpha()
    state = initial_state(system, q0, v0)
    floor = np.arange(system.contacts.n)
    sub = system.contacts.subset(floor)
    return step_equations(system, method.parameters, state, DT, sub, memory(system, state, floor))


def test_impact_of_many_by_percussions():
    """Each ball stops falling with the percussion m (u + g dt) and slows down by mu times that."""
    equations = equations_of(1e-3, -2.0)
    assert equations.sub.k == N
    evaluation, converged, _ = by_percussions(equations, None)
    assert converged
    P = 2.0 + 9.81 * DT
    v = evaluation.v.reshape(N, 3)
    assert v == pytest.approx(np.tile([max(0.5 - 0.3 * P, 0.0), 0.0, 0.0], (N, 1)), abs=1e-9)
    assert evaluation.z[N : 2 * N] == pytest.approx(P, rel=1e-9)


def test_closed_is_closed_to_a_few_tolerances():
    """The laws are continuous where a contact touches, by a slack of a few tolerances of its gap and no more: what is
    taken as closed would stand open by hundreds of them with a large one."""
    equations = equations_of(1e-3, -2.0)
    evaluation, converged, _ = by_percussions(equations, None)
    open_by = evaluation.options.slack / equations.r[:N]  # [m]
    assert converged and (np.abs(open_by) <= 10 * equations.gap_tolerance).all()
    assert (np.abs(open_by) >= equations.gap_tolerance).all()  # and no less than what a step leaves
    assert np.abs(evaluation.y[:N]).max() <= 10 * np.max(equations.gap_tolerance)


def test_fixed_point_agrees_with_newton():
    method = {name: nga.GeneralizedAlpha(solver=name) for name in ("fixed_point", "newton")}
    scene = balls(2, mu=0.3)
    q0, v0 = np.array([0.0, 0.0, 0.1, 1.0, 0.0, 0.1]), np.array([1.0, 0.0, 0.0, 0.0, 0.2, 0.0])
    runs = [nga.simulate(scene, q0, v0, t_end=0.1, dt=1e-3, method=m) for m in method.values()]
    np.testing.assert_allclose(runs[0].q, runs[1].q, atol=1e-10)
    np.testing.assert_allclose(runs[0].P_F, runs[1].P_F, atol=1e-9)
    assert fixed_point.__doc__
