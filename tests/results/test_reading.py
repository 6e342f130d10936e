"""The sensors at a state of a Simulator: those of the trajectory with the same states."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.results.sensors.sensors import Sensors


@pytest.mark.parametrize("method", [nga.GeneralizedAlpha(), nga.MoreauJean()], ids=lambda m: type(m).__name__)
def test_states_read_as_the_trajectory(method):
    scene, q0, v0 = robots.load("quadruped", height=0.002)
    dt, n = 2e-3, 25
    run = nga.simulate(scene, q0, v0, t_end=n * dt, dt=dt, method=method)
    simulator = nga.Simulator(scene, dt, method)
    state = simulator.initial_state(q0, v0)
    for _ in range(n):
        state = simulator.step(state)
        reading = simulator.sensors(state)
        assert isinstance(reading, Sensors)
        force = reading.contact_force("FL_foot")
    assert np.array_equal(state.q, run.q[-1])  # reading does not disturb
    expected = run.contact_force("FL_foot")
    assert force.force.shape == (3,) and force.force[2] > 1.0
    for shown, whole in (
        (force, expected),
        (reading.contact_force("FL_foot", mean=True), run.contact_force("FL_foot", mean=True)),
        (reading.joint_reaction("FL_knee"), run.joint_reaction("FL_knee")),
        (reading.frame("FL_foot"), run.frame("FL_foot")),
        (reading.imu("FL_foot"), run.imu("FL_foot")),
        (reading.centre_of_mass(), run.centre_of_mass()),
    ):
        for one, all_of_them in zip(shown, whole, strict=True):
            assert one == pytest.approx(all_of_them[-1], abs=1e-9 * max(1.0, np.abs(all_of_them[-1]).max()))
    assert reading.zmp() == pytest.approx(run.zmp()[-1], abs=1e-9)
    assert reading.contact_point("FL_foot") == pytest.approx(run.contact_point("FL_foot")[-1], abs=1e-12)
