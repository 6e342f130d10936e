"""A sample of the table that benchmarks/all_robots.py writes, through the landing."""

import sys
from pathlib import Path

import coal
import pytest

import ngalpha_pin as nga

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import all_robots
import robot_defaults

sys.path.pop(0)
SAMPLE = (
    "allegro_left_hand bolt bravo7_no_ee double_pendulum_simple finger_edu hector hyq iris quadruped simple_humanoid "
    "talos_arm"
).split()


@pytest.mark.parametrize("name", SAMPLE)
def test_robot_lands_with_contact_of_its_own_bodies(name):
    row = all_robots.run_robot(name, t_end=0.12)
    assert row["good"], row["remark"]
    if name in ("bolt", "hector", "hyq", "iris", "quadruped", "simple_humanoid"):  # their bases fall
        assert row["most closed"] > 0


def test_robots_that_cannot_be_simulated_say_why():
    with pytest.raises(nga.SceneError, match="no collision shapes"):
        all_robots.run_robot("simple_humanoid_classical")


def test_summary_counts_what_the_table_says():
    good = {"good": True, "penetration [m]": 2e-16, "us / step": 3000.0, "remark": ""}
    remarks = ["not simulated: no collision shapes", "not simulated", "not done after 45 s", "not done after 45 s"]
    summary = all_robots._summary([good, good | {"good": False}, *({"remark": remark} for remark in remarks)])
    assert summary.startswith("Of 6 robots 1 have no collision shapes, 1 could not be simulated for the reason given")
    assert "and 2 took too long" in summary
    assert "1 of the other 2 reach the end" in summary and "at most 2e-16 m" in summary and "takes 3 ms" in summary


@pytest.mark.parametrize("shape", [coal.Sphere(0.1), coal.Cylinder(0.1, 0.2)], ids=["one place", "several places"])
def test_a_body_on_the_ground_is_said_to_be_there_whatever_its_contacts_are_called(shape):
    scene = nga.Scene()
    scene.add_body("body", shape, mass=1.0)
    scene.add_plane("ground")
    scene.add_contact("body", "ground", mu=0.5)
    q0 = scene.place_on("ground", scene.reference())
    trajectory = nga.simulate(scene, q0, t_end=0.01, dt=1e-3)
    assert any("[" in name for name in trajectory.contact_names) == isinstance(shape, coal.Cylinder)
    assert robot_defaults.ending(trajectory) == "on the ground, upright, at rest"
