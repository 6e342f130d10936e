"""Where a step is divided, and that what is put together from its parts is the step: moments from closed forms."""

from dataclasses import replace
from types import SimpleNamespace

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators import division
from ngalpha_pin.integrators.attempt import attempt
from ngalpha_pin.integrators.division import divided, first_cut
from ngalpha_pin.integrators.joining import SHORT, behind, joined, straight, straight_rest
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.system.state import SolvedBy
from ngalpha_pin.system.system import System

G, R = 9.81, 0.1
PARAMETERS = nga.GeneralizedAlpha().parameters


def piece(scene, q0, v0, dt):
    system = System(scene)
    return Piece(PARAMETERS, system, initial_state(system, q0, v0), dt)


def ball(normal=(0.0, 0.0, 1.0), load=None, **law):
    """A ball of 1 kg without rotation at a plane."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, R), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_plane("wall", normal=normal)
    scene.add_geometry("ball", coal.Sphere(R), parent="ball")
    scene.add_contact("ball", "wall", **law)
    if load:
        scene.add_force(nga.Control(lambda t, q, v: np.array([0.0, 0.0, -load * t])))
    return scene


HEIGHT, SPEED = 5e-4, 1.0
# a ball that falls, one that slides to rest, one that a growing load tears off a ceiling, and one that flies
CASES = {
    "falls": (
        lambda: piece(ball(e_N=0.5), np.array([0, 0, R + HEIGHT]), np.array([0, 0, -SPEED]), 1e-3),
        SolvedBy.IMPACT,
        (-SPEED + np.sqrt(SPEED**2 + 2 * G * HEIGHT)) / G,
    ),
    "slides": (
        lambda: piece(ball(mu=0.3), np.array([0, 0, R]), np.array([0.02, 0, 0]), 1e-2),
        SolvedBy.SLIP,
        0.02 / (0.3 * G),
    ),
    "is torn off": (
        lambda: piece(ball((0.0, 0.0, -1.0), 2e3, adhesion=20.0), np.array([0, 0, -R]), np.zeros(3), 1e-2),
        SolvedBy.RELEASE,
        (20.0 - G) / 2e3,
    ),
    "flies": (lambda: piece(ball(), np.array([0, 0, 1.0]), np.zeros(3), 1e-2), None, np.nan),
}


@pytest.mark.parametrize("name", CASES)
def test_what_happens_in_a_step_is_found_with_its_moment(name):
    build, kind, moment = CASES[name]
    step = build()
    whole = attempt(step, until_closing=True)
    cut = first_cut(step, whole)
    if kind is None:
        assert cut is None
        return
    assert cut.kind is kind and cut.h == pytest.approx(moment, rel=1e-6)
    assert (cut.hit is not None) == (kind is SolvedBy.IMPACT)
    assert cut.before.t == pytest.approx(step.state.t + cut.h) and cut.n_iter >= whole.n_iter
    after = behind(step.system, cut)
    assert after.q == pytest.approx(cut.before.q, abs=1e-15) and after.dt == 0.0
    bounce = -0.5 * cut.before.v if kind is SolvedBy.IMPACT else cut.before.v
    assert after.v == pytest.approx(bounce, abs=1e-12)
    rest = divided(step._replace(state=after, dt=step.dt - cut.h), 0, 1)
    end = joined(step, cut, after, rest)
    assert end.state.t == step.state.t + step.dt and end.solved_by is kind and len(end.parts) >= 1
    if kind is not SolvedBy.RELEASE:  # what the parts have exerted is the change of momentum, of a ball of 1 kg
        gained = end.state.v[2] - step.state.v[2] + G * step.dt
        assert end.state.P_N.sum() == pytest.approx(gained, abs=1e-9)


def test_behind_an_impact_ends_of_slip_are_not_located():
    step = CASES["slides"][0]()
    assert first_cut(step, attempt(step, until_closing=True), struck=True) is None


def test_a_rest_that_is_next_to_nothing_is_a_straight_line():
    step = CASES["falls"][0]()
    cut = first_cut(step, attempt(step, until_closing=True))
    after = behind(step.system, cut)
    assert straight_rest(step, cut, after) is None
    short = step._replace(dt=cut.h * (1 + 0.5 * SHORT))
    rest = straight_rest(short, cut, after)
    end = straight(step.system, after, short.dt - cut.h)
    assert rest.converged and np.array_equal(rest.state.q, end.q) and np.array_equal(rest.state.v, end.v)


def test_a_step_that_fails_is_two_halves(monkeypatch):
    """Solved where it is half as long: the same as two such steps, with the percussions of both."""
    scene, q0, v0 = robots.load("slider_crank")
    system = System(scene)
    step = Piece(PARAMETERS, system, initial_state(system, q0, v0), 1e-4)
    first = divided(step._replace(dt=5e-5), 0, 0)
    second = divided(step._replace(state=first.state, dt=5e-5), 0, 0)

    def fails_where_it_is_long(piece, **options):
        return replace(attempt(piece, **options), converged=piece.dt < 1e-4)

    monkeypatch.setattr(division, "attempt", fails_where_it_is_long)
    assert not divided(step, 0, 0).converged
    whole = divided(step, 1, 0)
    assert whole.converged and whole.solved_by is SolvedBy.HALVED
    assert np.array_equal(whole.state.q, second.state.q) and np.array_equal(whole.state.v, second.state.v)
    assert whole.state.La_b == pytest.approx(first.state.La_b + second.state.La_b)
    assert len(whole.impacts) == 1 and whole.impacts[0].t == first.state.t and not len(whole.impacts[0].contacts)


@pytest.mark.parametrize("solver", ["auto", "newton"])
def test_how_often_a_step_is_halved(solver, monkeypatch):
    """Down to a sixteenth of it, where the method may: a step that needs less is found, one that needs more is not."""
    scene, q0, v0 = robots.load("slider_crank")
    system, dt = System(scene), 1.6e-3
    state, method = initial_state(system, q0, v0), nga.GeneralizedAlpha(solver=solver)
    monkeypatch.setattr("ngalpha_pin.integrators.generalized_alpha.plain_steps", lambda piece, n: None)

    def solved(parts):
        def fails_where_it_is_long(piece, **options):
            return replace(attempt(piece, **options), converged=piece.dt < 1.01 * dt / parts)

        monkeypatch.setattr(division, "attempt", fails_where_it_is_long)
        return method.step(system, state, dt).converged

    assert [solved(parts) for parts in (1, 16, 32)] == [True, solver == "auto", False]


def test_how_many_contacts_divide_a_step():
    """Among many of them impacts are captured where nothing but contacts couples the bodies."""
    few = CASES["flies"][0]()
    crowd = few._replace(state=replace(few.state, contacts=np.arange(13)))
    bodies, tree = SimpleNamespace(many_trees=True), SimpleNamespace(many_trees=False)
    assert few.divides and not crowd.divides
    assert not crowd._replace(system=tree).captures
    assert crowd._replace(system=bodies).captures and not few._replace(system=bodies).captures
