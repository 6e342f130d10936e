"""Derivatives of whole runs of ready systems against central differences at two steps that agree with each other."""

import numpy as np
import pytest
from central_differences import EXACT, agreed, by_start, end, random_directions

import ngalpha_pin as nga
from ngalpha_pin.system.system import System

# system: length of the run and step; a straight change of q0 leaves round surfaces, so that those are given one of v0
RUNS = {
    "arm": (0.2, 5e-3),
    "cradle": (0.3, 2e-3),
    "painleve_rod": (0.1, 2e-3),
    "ball_in_corner": (0.4, 5e-3),
}
LONG = {
    "andrews": (0.01, 2e-4),
    "belt": (0.05, 2e-3),
    "bricard": (0.1, 2e-3),
    "governor": (0.1, 2e-3),
    "n_four_bar": (0.05, 1e-3),
    "rocking_block": (0.3, 2e-3),
    "rolling_disc": (0.1, 2e-3),
    "slider_crank": (0.05, 1e-3),
}
VELOCITIES = {
    "ball_in_cylinder": (0.5, 5e-3),
    "tippe_top": (0.05, 1e-3),
    "turntable": (0.1, 2e-3),
    "wheel_in_shell": (0.1, 2e-3),
}


def same_as_differences(name, t_end, dt, only_v=False, tolerance=1e-6, turn=None, **given):
    scene, q0, v0 = nga.robots.load(name, **given)
    if turn is not None:
        way = np.zeros(scene.model.nv)
        way[3:6] = turn
        q0 = System(scene).integrate(q0, way)
    how = {"t_end": t_end, "dt": dt, "method": EXACT}
    dq, dv = random_directions(scene, q0, v0, 1, only_v=only_v)
    run = nga.simulate(scene, q0, v0, sensitivities=nga.Sensitivities(q0=dq, v0=dv), **how)
    expected, allowed = agreed(lambda h: by_start(scene, q0, v0, dq, dv, h, **how), tolerance)
    np.testing.assert_allclose(end(run)[:, :1] + end(run)[:, 1:], expected, rtol=0, atol=allowed)
    return run


@pytest.mark.parametrize("name", RUNS)
@pytest.mark.filterwarnings("ignore:no derivative")
def test_ready_systems(name):
    t_end, dt = RUNS[name]
    same_as_differences(name, t_end, dt)


@pytest.mark.long
@pytest.mark.parametrize("name", LONG)
@pytest.mark.filterwarnings("ignore:no derivative")
def test_more_ready_systems(name):
    t_end, dt = LONG[name]
    same_as_differences(name, t_end, dt)


@pytest.mark.long
@pytest.mark.parametrize("name", VELOCITIES)
def test_ready_systems_on_round_surfaces(name):
    t_end, dt = VELOCITIES[name]
    same_as_differences(name, t_end, dt, only_v=True)


@pytest.mark.long
def test_a_robot_lands_tilted():
    run = same_as_differences("quadruped", 0.3, 2e-3, turn=(0.05, 0.12, 0.03))
    assert "impact" in run.derivatives.status


@pytest.mark.long
def test_a_robot_lands_on_the_edges_of_its_feet():
    pytest.importorskip("example_robot_data")
    run = same_as_differences("solo12", 0.13, 2e-3, turn=(0.05, 0.12, 0.03), tolerance=1e-5)
    assert "impact" in run.derivatives.status
