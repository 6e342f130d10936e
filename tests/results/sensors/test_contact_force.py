"""Contact forces of bodies and pairs: weights, friction of a box that slides, impacts, names."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from box_scenes import at, box
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.results.sensors.bodies import geometries_of, pair_name
from ngalpha_pin.results.sensors.wrench_at import WrenchAt

G = 9.81


@pytest.fixture(scope="module")
def standing():
    """A quadruped that has come to rest."""
    return nga.simulate(*robots.load("quadruped", height=0.0, kd=10.0), t_end=8.0, dt=1e-2)


def test_standing_quadruped_weighs_what_it_weighs(standing):
    mass = pin.computeTotalMass(standing.scene.model)
    total = sum(standing.contact_force(pair).force for pair in standing.contact_pairs)
    assert len(standing.contact_pairs) == 4
    assert total[-1] == pytest.approx([0.0, 0.0, mass * G], abs=1e-9 * mass * G)
    assert standing.contact_force("ground").force[-1] == pytest.approx(-total[-1], abs=1e-12)
    # of a link its own geometries, of a joint all that moves with it
    foot, below_knee = standing.contact_force("FL_foot"), standing.contact_force("FL_knee")
    assert np.array_equal(foot.force, below_knee.force) and foot.force[-1, 2] > 0.1 * mass * G


def test_at_all_times_the_contacts_accelerate_the_centre_of_mass(standing):
    mass = pin.computeTotalMass(standing.scene.model)
    total = standing.contact_force("*_foot_0", "ground").force
    felt = mass * (standing.centre_of_mass().acceleration + np.array([0.0, 0.0, G]))
    assert total == pytest.approx(felt, abs=1e-9 * mass * G)


def test_centre_of_pressure_is_the_zero_moment_point(standing):
    pressed = standing.contact_point("ground")
    assert standing.zmp() == pytest.approx(pressed, abs=1e-9)
    # at rest it is below the centre of mass
    com = standing.centre_of_mass().position[-1]
    assert standing.zmp("ground")[-1] == pytest.approx([com[0], com[1], 0.0], abs=1e-8)


def test_box_that_slides():
    mu, mass = 0.3, 2.0
    run = nga.simulate(box(mu), at(0.0, 0.0, 0.1), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], t_end=0.2, dt=1e-2)
    found = run.contact_force("box/ground")
    weight = mass * G
    assert found.force[1:] == pytest.approx(np.tile([-mu * weight, 0.0, weight], (20, 1)), abs=1e-7 * weight)
    # the normal force moves ahead so that the friction does not tip the box: by mu times the height of its centre
    centre = run.centre_of_mass().position
    ahead = run.contact_point("box")[1:, 0] - centre[1:, 0]
    assert ahead == pytest.approx(mu * 0.1, abs=1e-7)
    assert found.about(centre).moment[1:] == pytest.approx(0.0, abs=1e-7 * weight)
    assert run.contact_force("box", mean=True).force[1:] == pytest.approx(found.force[1:], abs=1e-7 * weight)


def test_of_percussions_alone_the_mean_of_each_step_is_the_force():
    run = nga.simulate(balls(1, mu=0.3), [0.0, 0.0, 0.15], [1.0, 0.0, 0.0], t_end=0.3, dt=1e-2, method=nga.MoreauJean())
    force = run.contact_force("ball_0").force[1:]
    assert force == pytest.approx(np.diff(run.v, axis=0) / 1e-2 + [0.0, 0.0, G], abs=1e-9 * G)
    assert force[-1] == pytest.approx([-0.3 * G, 0.0, G])


def test_an_impact_is_a_percussion_and_part_of_the_mean():
    speed, mass = 1.0, 2.0
    run = nga.simulate(box(), at(0.0, 0.0, 0.105), [0.0, 0.0, -speed, 0.0, 0.0, 0.0], t_end=0.05, dt=1e-2)
    after = np.sqrt(speed**2 + 2 * G * 0.005)
    hits = run.contact_percussion("box")
    assert hits.force[:, 2].sum() == pytest.approx(mass * after, rel=1e-9)
    assert (run.contact_force("box").force[:, 2] < 1.01 * mass * G).all()
    mean = run.contact_force("box", mean=True).force[1:, 2]
    assert 1e-2 * mean.sum() == pytest.approx(mass * (speed + G * 0.05), rel=1e-9)


def test_both_sides_of_a_pair_and_what_lies_between():
    scene = box()
    scene.add_body("top", coal.Box(0.2, 0.2, 0.2), mass=1.0)
    scene.add_contact("top", "box", mu=0.3)
    run = nga.simulate(scene, np.concatenate((at(0.0, 0.0, 0.1), at(0.0, 0.0, 0.3))), t_end=0.05, dt=1e-2)
    assert set(run.contact_pairs) == {"box/ground", "top/box"}
    for name, force in (
        (("top",), 1.0), (("box/top",), -1.0), (("top/box",), 1.0), (("box",), 2.0), (("box", "ground"), 3.0),
        (("world",), -3.0), (("ground", "top"), 0.0), (("*",), 0.0),
    ):  # fmt: skip
        assert run.contact_force(*name).force[-1] == pytest.approx([0.0, 0.0, force * G], abs=1e-7), name


def test_names():
    scene = box()
    with pytest.raises(nga.UnknownName, match="pair, body or geometry named 'bax'; did you mean 'box'"):
        geometries_of(scene, "bax")
    assert geometries_of(scene, "world") == {"ground"}
    assert pair_name("a[1][3]/b", {"a[1]/b": None}) == "a[1]/b"
    run = nga.simulate(scene, at(0.0, 0.0, 0.2), t_end=0.02, dt=1e-2)
    assert not run.contact_force("box").force.any()
    assert np.isnan(run.contact_point("box")).all() and np.isnan(run.zmp()).all()
    with pytest.raises(nga.SceneError, match="is no plane that is fixed"):
        run.zmp("box")


def test_moment_about_another_point():
    wrench = WrenchAt.of_origin(np.array([[0.0, 0.0, 2.0, 1.0, 0.0, 0.0]]))
    assert wrench.about([0.0, 0.5, 0.0]).moment[0] == pytest.approx([0.0, 0.0, 0.0])
    assert wrench.about([0.0, 0.5, 0.0]).about([0.0, 0.0, 0.0]).moment[0] == pytest.approx([1.0, 0.0, 0.0])


def test_the_run_comes_back_from_a_file_with_its_sensors(tmp_path):
    run = nga.simulate(box(), at(0.0, 0.0, 0.1), t_end=0.05, dt=1e-2)
    run.save(tmp_path / "run.npz")
    again = nga.Trajectory.load(tmp_path / "run.npz")
    assert np.array_equal(again.contact_force("box").force, run.contact_force("box").force)
