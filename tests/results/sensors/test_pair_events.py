"""Events by pair: a box lands once, however many of its corners touch."""

import coal
import numpy as np
import pytest
from box_scenes import at, box

import ngalpha_pin as nga

G = 9.81


@pytest.mark.parametrize("how", [{"dt": 3e-3}, {"rtol": 1e-8}], ids=("dt", "rtol"))
def test_box_lands_slides_and_stops(how):
    mu, speed, height = 0.3, 0.5, 0.05
    run = nga.simulate(box(mu), at(0.0, 0.0, 0.1 + height), [speed, 0, 0, 0, 0, 0], t_end=0.4, **how)
    fall = np.sqrt(2 * height / G)
    slip = speed - mu * G * fall  # the landing takes mu times its jump of velocity
    stop = fall + slip / (mu * G)
    kinds = [(event.kind, event.contact) for event in run.pair_events]
    assert kinds == [("lands", "box/ground"), ("sticks", "box/ground")]
    times = [event.t for event in run.pair_events]
    assert times[0] == pytest.approx(fall, abs=1e-9)
    assert times[1] == pytest.approx(stop, abs=4e-3 if "dt" in how else 1e-5)
    assert len(run.events) > len(run.pair_events)


def test_bounces_are_impacts_and_a_push_makes_it_slip_and_leave():
    scene = box(mu=0.3, e_N=0.5)
    run = nga.simulate(scene, at(0.0, 0.0, 0.15), t_end=0.25, dt=1e-3)
    hits = [event.t for event in run.pair_events]
    first = np.sqrt(2 * 0.05 / G)
    assert {event.kind for event in run.pair_events} == {"impact"}
    assert hits[:2] == pytest.approx([first, 2 * first], abs=1e-6)

    def push(t):
        return (10.0 if t > 0.1 else 0.0, 0.0, 40.0 if t > 0.2 else 0.0)

    pushed = box(mu=0.3)
    pushed.add_force(nga.Wrench("box", force=push, breakpoints=(0.1, 0.2)))
    run = nga.simulate(pushed, at(0.0, 0.0, 0.1), t_end=0.3, dt=1e-3)
    assert [event.kind for event in run.pair_events] == ["slips", "leaves"]
    assert [event.t for event in run.pair_events] == pytest.approx([0.1, 0.2], abs=2e-3)


def test_what_rests_has_no_events():
    """Its slip is rounding, and so is the largest velocity of the run."""
    scene = nga.Scene()
    scene.add_plane("ground")
    for name, on in (("lower", "ground"), ("upper", "lower")):
        scene.add_body(name, coal.Box(0.2, 0.2, 0.2), mass=1.0)
        scene.add_contact(name, on, mu=0.5)
    q0 = np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0])
    run = nga.simulate(scene, q0, t_end=0.02, dt=1e-3)
    assert run.pair_events == [] and run.events == []
