"""What two scenes have in common goes from one to the other by name."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.initialization.transfer import places, places_of
from ngalpha_pin.system.system import System


def balls(*names, **radii):
    scene = nga.Scene()
    scene.add_plane("ground")
    for name in names:
        scene.add_body(name, coal.Sphere(radii.get(name, 0.1)), mass=1.0)
        scene.add_contact(name, "ground", mu=0.3)
    return scene


def test_rows_of_one_name_keep_their_order():
    assert places_of(("a", "b", "a", "c"), ("a", "a", "b")).tolist() == [0, 2, 1, -1]


def test_a_body_more_and_another_order():
    a, b = balls("x", "y"), balls("new", "y", "x")
    rng = np.random.default_rng(0)
    q = np.concatenate([[i, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0] for i in (1.0, 2.0)])
    v = rng.normal(size=12)
    run = nga.simulate(a, q, v, t_end=0.05, dt=1e-3)
    state = run.final_state
    b.model.jointPlacements[1] = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5]))  # where the new one is
    found = nga.transfer(state, a, b)
    assert found.t == state.t
    assert np.array_equal(found.q, np.concatenate((pin.neutral(b.model)[:7], state.q[7:], state.q[:7])))
    assert np.array_equal(found.v, np.concatenate((np.zeros(6), state.v[6:], state.v[:6])))
    assert found.a[2] == pytest.approx(-9.81)
    rest = nga.simulate(b, state=found, t_end=0.1, dt=1e-3)
    alone = nga.simulate(a, state=state, t_end=0.1, dt=1e-3)
    assert rest.q[-1, 14:] == pytest.approx(alone.q[-1, :7], abs=1e-6)


def test_another_ground_lets_it_go_on():
    """The robot steps onto a plane with less friction: what it has is carried over, forces are those of the new law."""
    scene, q0, v0 = robots.load("quadruped", height=0.0)
    slippery, _, _ = robots.load("quadruped", height=0.0, mu=0.05)
    state = nga.simulate(scene, q0, v0, t_end=0.1, dt=2e-3).final_state
    found = nga.transfer(state, scene, slippery)
    assert np.array_equal(found.q, state.q) and np.array_equal(found.v, state.v)
    assert nga.simulate(slippery, state=found, t_end=0.2, dt=2e-3).audit().ok


def test_sampled_controls_and_beams():
    scene, q0, _ = robots.load("cantilever")
    state = nga.simulate(scene, q0, t_end=1e-3, dt=1e-4).final_state
    found = nga.transfer(state, scene, robots.load("cantilever", gravity=0.0)[0])
    assert np.array_equal(found.q, state.q) and not np.array_equal(found.a, state.a)

    def held(law):
        model = pin.Model()
        joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        scene = nga.Scene(model)
        scene.add_force(nga.SampledControl(law, rate=10.0))
        return scene

    a, b = held(lambda t, q, v, forces: np.ones(1)), held(lambda t, q, v, forces: 2.0 * np.ones(1))
    state = nga.simulate(a, np.zeros(1), t_end=0.05, dt=1e-2).final_state
    found = nga.transfer(state, a, b)
    assert np.array_equal(found.sampled, state.sampled)
    assert nga.simulate(b, state=found, t_end=0.2, dt=1e-2).tau[-1] == pytest.approx(2.0)


def test_what_cannot_be_carried_over():
    a, b = balls("x"), nga.Scene(pin.Model())
    state = nga.simulate(a, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], t_end=0.01, dt=1e-3).final_state
    b.model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "x")
    b.model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    with pytest.raises(nga.SceneError, match="'x' has other coordinates in the two scenes"):
        nga.transfer(state, a, b)
    with pytest.raises(
        nga.SceneError, match="does not belong to scene_a: the state has joint 'x'; the scene has joint 'y'"
    ):
        nga.transfer(state, balls("y"), a)
    with pytest.raises(nga.SceneError, match="expected a State"):
        nga.transfer(None, a, b)
    with pytest.raises(nga.Penetration):
        nga.transfer(state, a, balls("x", x=2.0))


def test_places_of_features():
    def stack(*names):
        scene = nga.Scene()
        for name in names:
            scene.add_body(name, coal.Box(1.0, 1.0, 1.0), mass=1.0)
        for one, other in zip(names, names[1:], strict=False):
            scene.add_contact(other, one)
        return System(scene)

    found = places(stack("a", "b", "c"), stack("x", "b", "c")).slots
    assert (found[:12] == -1).all() and found[12:].tolist() == list(range(12, 24))
