"""Moments at which compliant contacts cease to push: where the gap opens, and where a damper would pull."""

import coal
import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin.integrators.kinks import kinks

RADIUS = 0.1


def ball(law):
    """A ball above a plane, and its velocity down."""
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("ball", coal.Sphere(RADIUS), mass=2.0)
    scene.add_contact("ball", "ground", compliance=law)
    return scene, np.array([0.0, 0.0, RADIUS + 0.002, 0.0, 0.0, 0.0, 1.0]), -np.eye(6)[2]


@pytest.mark.parametrize("law, opens", [(nga.HuntCrossley(2e6), True), (nga.KelvinVoigt(2e4, 50.0), False)])
def test_a_step_ends_just_behind_them(law, opens):
    scene, q0, v0 = ball(law)
    run = nga.simulate(scene, q0, v0, t_end=0.04, dt=8e-4)
    solved = [str(x) for x in run.solver_path]
    assert solved.count("impact") == 1 and solved.count("release") == 1
    behind = solved.index("release")
    assert run.la_N[behind + 1, 0] == 0.0
    assert (run.q[behind + 1, 2] > RADIUS) == opens  # a damper lets go before the gap opens
    assert run.audit().ok, str(run.audit())


def test_what_counts_as_one():
    """A contact that pushes at one end of the step alone, but not one that begins to touch."""
    simulator = nga.Simulator(ball(nga.KelvinVoigt(2e4, 50.0))[0], dt=1e-3)

    def at(depth, speed):
        return simulator.initial_state(np.array([0.0, 0.0, RADIUS - depth, 0, 0, 0, 1.0]), speed * np.eye(6)[2])

    pressed, idle, touches, away = at(1e-3, 0.0), at(1e-3, 1.0), at(0.0, -1.0), at(-1e-3, 1.0)
    assert pressed.la_N[0] > 0.0 and idle.la_N[0] == 0.0
    for start, end, found in (
        (pressed, away, 1), (pressed, idle, 1), (idle, pressed, 1),
        (pressed, pressed, 0), (idle, away, 0), (touches, pressed, 0), (away, pressed, 0),
    ):  # fmt: skip
        assert len(kinks(simulator.system, start, end)) == found
