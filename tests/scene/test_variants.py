"""A scene as another one: what differs is what was asked for, and the first stays as it was."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.scene.variants import copied


@pytest.fixture
def scene():
    return robots.load("quadruped")[0]


def test_coefficients_of_all_contacts_and_by_pattern(scene):
    one = scene.varied(mu=0.1, e_N={"FL*": 0.5}, e_F=0.2)
    assert [pair.law.mu for pair in one.contacts] == 4 * [0.1]
    assert [pair.law.e_N for pair in one.contacts] == [0.5 * ("FL" in p.geometry_a) for p in one.contacts]
    assert {pair.law.e_F for pair in one.contacts} == {0.2}
    assert [pair.law.mu for pair in scene.contacts] == 4 * [0.8]


def test_mass_scales_the_whole_inertia(scene):
    one = scene.varied(mass={"root_joint": 24.0})
    before, after = scene.model.inertias[1], one.model.inertias[1]
    assert after.mass == 24.0
    assert np.allclose(after.inertia, before.inertia * 24.0 / before.mass, rtol=1e-15)
    assert np.array_equal(after.lever, before.lever)
    assert before.mass < 24.0


def test_twice_the_mass_on_a_spring_has_the_period_of_it():
    model = pin.Model()
    model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.gravity.linear = np.zeros(3)
    scene = nga.Scene(model)
    scene.add_force(nga.JointPD(np.zeros(1), kp=100.0, kd=0.0))
    run = nga.simulate(scene.varied(mass={"slide": 2.0}, kp=50.0), np.ones(1), t_end=1.0, dt=1e-3)
    assert run.q[-1, 0] == pytest.approx(np.cos(5.0), abs=5e-5)
    run = nga.simulate(scene, np.ones(1), t_end=1.0, dt=1e-3)
    assert run.q[-1, 0] == pytest.approx(np.cos(10.0), abs=5e-4)


def test_gains_and_forces(scene):
    push = nga.Control(lambda t, q, v: np.zeros(18))
    one = scene.varied(kp=7.0, forces=[push])
    assert one.forces[0].kp[6:].tolist() == 12 * [7.0] and one.forces[0].kp[:6].tolist() == 6 * [0.0]
    assert np.array_equal(one.forces[0].kd, scene.forces[0].kd)
    assert one.forces[1] is push and len(scene.forces) == 1


def test_what_is_added_to_a_copy_is_not_in_the_first(scene):
    one = copied(scene)
    one.add_geometry("box", coal.Box(1.0, 1.0, 1.0))
    one.add_contact("box", "FL*", mu=0.1)
    assert not scene.collision_model.existGeometryName("box")
    assert len(scene.contacts) == 4 and "box" not in scene.added


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"mu": -1.0}, "mu"),
        ({"e_N": 2.0}, "e_N"),
        ({"mu": {"tail": 0.1}}, "no geometry with contacts named 'tail'"),
        ({"mass": {"tail": 1.0}}, "no body or joint named 'tail'"),
        ({"mass": {"root_joint": 0.0}}, "mass of 'root_joint'"),
        ({"mass": {"universe": 1.0}}, "fixed to the world"),
        ({"kp": -1.0}, "kp"),
        ({"kp": np.ones(3)}, "kp has shape"),
        ({"forces": [3.0]}, "force"),
    ],
)
def test_bad_input(scene, given, message):
    with pytest.raises(nga.SceneError, match=message):
        scene.varied(**given)


def test_gains_need_a_law_and_coefficients_a_contact():
    scene = robots.load("four_bar")[0]
    with pytest.raises(nga.SceneError, match="kp: the scene has no JointPD"):
        scene.varied(kp=1.0)
    with pytest.raises(nga.SceneError, match="mu: the scene has no contacts"):
        scene.varied(mu=1.0)
