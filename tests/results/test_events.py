"""Events of runs whose events are known in closed form."""

import coal
import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import references, robots
from ngalpha_pin.results.events import find_events

G = 9.81


def test_ball_falls_slips_and_rolls():
    run = nga.simulate(*robots.load("rotating_ball", omega=50.0), t_end=2.0, dt=2e-3)
    found = find_events(run)
    assert [event.kind for event in found] == ["impact", "stick"]
    fall = np.sqrt(2 * (1.0 - 0.1) / G)
    assert found[0].t == pytest.approx(fall, abs=1e-12)
    # slip ends where the reference begins to stick; found at the end of a step
    sticks = references.rotating_ball_arcs(omega=50.0)[-1].t
    assert found[1].t == pytest.approx(sticks if np.isscalar(sticks) else sticks[0], abs=2e-3)


def test_every_bounce_is_an_impact():
    run = nga.simulate(*robots.load("rotating_ball", omega=0.0, e_N=0.5), t_end=1.2, dt=2e-3)
    times = [event.t for event in run.events if event.kind == "impact"]
    first = np.sqrt(2 * 0.9 / G)
    exact = first * (1.0 + 2.0 * np.cumsum(0.5 ** np.arange(6)) - 1.0)
    assert times[:4] == pytest.approx([first, *(first + 2 * first * np.cumsum(0.5 ** np.arange(1, 4)))], abs=1e-6)
    assert len(exact) == 6 and run.events == find_events(run)


def test_box_that_starts_to_slip_and_stops():
    run = nga.simulate(*robots.load("box_on_incline"), t_end=1.0, dt=2e-3)
    kinds = {event.kind for event in run.events}
    assert kinds <= {"impact", "closed", "lift-off", "slip", "stick"}
    assert all(a.t <= b.t for a, b in zip(run.events, run.events[1:], strict=False))


def test_a_contact_at_rest_has_no_events():
    """The largest velocity of such a run is rounding, of which nothing slips."""
    scene = nga.Scene()
    scene.add_plane("plane")
    scene.add_body("box", coal.Box(0.2, 0.2, 0.1), mass=1.0)
    scene.add_contact("box", "plane", mu=0.8)
    scene.add_force(nga.Wrench("box", force=lambda t: (3.0 * np.sin(90.0 * t), 2.0 * np.cos(70.0 * t), 0.0)))
    run = nga.simulate(scene, scene.place_on("plane", scene.reference()), t_end=0.1, dt=2e-3)
    assert 0.0 < np.abs(run.gamma_F).max() < 1e-13
    assert not run.events
