"""The derivative of one step against differences of steps."""

import numpy as np
import pytest
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin.errors import SceneError

DT = 1e-2


def test_a_step_through_an_impact_by_motion_and_force():
    scene = balls(1, mu=0.3, e_N=0.5)
    simulator = nga.Simulator(scene, DT)
    tau = np.array([0.5, -0.2, 0.3])
    q0, v0 = np.array([0.0, 0.0, 0.104]), np.array([1.0, 0.3, -1.0])
    state = simulator.initial_state(q0, v0)
    lin = nga.linearise(scene, state, DT, tau, parameters=["e_N", "mu"])
    assert lin.status is nga.Status.IMPACT and lin.contacts == ("g0/ground",)
    assert lin.approach == pytest.approx(1.03, abs=0.02)
    after = simulator.step(state, tau)
    np.testing.assert_array_equal(lin.state.q, after.q)
    np.testing.assert_array_equal(lin.state.v, after.v)

    def end(x):
        found = simulator.step(simulator.initial_state(x[:3], x[3:6]), x[6:])
        return np.concatenate((found.q, found.v))

    x, h = np.concatenate((q0, v0, tau)), 1e-6
    columns = [(end(x + e) - end(x - e)) / (2 * h) for e in h * np.eye(9)]
    np.testing.assert_allclose(np.concatenate((lin.A_qv, lin.B_qv), axis=1), np.array(columns).T, atol=2e-9)
    assert lin.names == ("e_N", "mu") and lin.P_qv.shape == (6, 2)
    # the speed at the moment of the impact, within the step
    fall = float(np.sqrt(1.0 + 2.0 * (9.81 - 0.3) * 0.004))
    np.testing.assert_allclose(lin.P_qv[5, 0], fall, rtol=1e-9)


def test_the_maps_of_steps_multiply_to_that_of_both():
    scene, q0, v0 = nga.robots.load("quadruped", height=0.0)
    simulator = nga.Simulator(scene, 2e-3)
    state = simulator.initial_state(q0, v0)
    first = nga.linearise(scene, state, 2e-3)
    second = nga.linearise(scene, first.state, 2e-3)
    assert first.A.shape[0] == second.A.shape[1]
    run = nga.simulate(scene, q0, v0, t_end=4e-3, dt=2e-3, sensitivities=nga.Sensitivities(v0=True))
    np.testing.assert_array_equal(run.q[-1], second.state.q)
    assert np.abs((second.A @ first.A)[:36, 18:36]).max() > 0.0


def test_scenes_without_derivatives_are_refused():
    scene = balls(1, mu=0.3, adhesion=1.0)
    state = nga.Simulator(scene, DT).initial_state(np.array([0.0, 0.0, 0.3]))
    with pytest.raises(SceneError, match="adhesion"):
        nga.linearise(scene, state, DT)
    with pytest.raises(SceneError, match="dt"):
        nga.linearise(balls(1), state, -1.0)
