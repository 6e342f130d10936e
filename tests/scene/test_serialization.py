"""A scene in a file keeps what decides about contacts: surfaces, excluded pairs, and those left out at the start."""

import json

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.scene.serialization import scene_from_dict, scene_to_dict

SRDF = '<robot name="balls"><disable_collisions link1="body_0" link2="body_2"/></robot>'


@pytest.fixture
def scene():
    """Four balls, three of them in a row and the last one inside the third."""
    model = pin.Model()
    for i in range(4):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"ball_{i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        model.addBodyFrame(f"body_{i}", joint, pin.SE3.Identity(), 0)
    scene = nga.Scene(model)
    for i in range(4):
        scene.add_geometry(f"ball_{i}", coal.Sphere(0.1), parent=f"body_{i}")
    scene.add_plane("ground")
    scene.set_surface("ball_*", mu=0.9, e_N=0.5)
    scene.set_surface("ground", mu=0.4, e_N=0.8, contact_radius=0.01)
    for geometry in scene.collision_model.geometryObjects:
        if geometry.name != "ground":
            geometry.parentFrame = scene.model.getFrameId(f"body_{geometry.name[-1]}")
    return scene


def start(scene):
    q0 = pin.neutral(scene.model)
    for i, x in enumerate((0.0, 0.3, 0.6, 0.65)):
        q0[7 * i : 7 * i + 3] = x, 0.0, 0.1
    return q0


def through_a_file(scene):
    return scene_from_dict(json.loads(json.dumps(scene_to_dict(scene))))


def test_surfaces_and_exclusions_return(scene):
    scene.disable_contacts(SRDF)
    loaded = through_a_file(scene)
    assert loaded.surfaces == scene.surfaces
    assert loaded.disabled == scene.disabled == {frozenset(("ball_0", "ball_2"))}
    for each in (scene, loaded):
        each.add_contact("*", "*")
    assert loaded.contacts == scene.contacts
    laws = {pair.key: pair.law for pair in loaded.contacts}
    assert frozenset(("ball_0", "ball_2")) not in laws
    law = laws[frozenset(("ball_1", "ground"))]  # the combination rule: geometric mean, smaller, larger
    assert law.mu == pytest.approx(0.6)
    assert (law.e_N, law.contact_radius) == (0.5, 0.01)


def test_pairs_left_out_at_the_start_return_with_the_trajectory(scene, tmp_path):
    scene.add_contact("ball_0", "ground", mu=0.2)
    scene.add_contact("*", "*")
    with pytest.warns(UserWarning, match="ball_2/ball_3"):
        run = nga.simulate(scene, start(scene), t_end=0.01, dt=1e-3)
    run.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz").scene
    assert loaded.contacts == scene.contacts
    assert loaded.left_out == scene.left_out
    assert [pair.key for pair in loaded.left_out] == [frozenset(("ball_2", "ball_3"))]
    assert {pair.found for pair in loaded.contacts} == {False, True}


def test_loaded_scene_gives_the_same_bits(scene):
    scene.add_contact("ball_[012]", "ground")
    loaded = through_a_file(scene)
    v0 = np.linspace(-1.0, 1.0, scene.model.nv)
    runs = [nga.simulate(each, start(scene) + 0.0, v0, t_end=0.05, dt=5e-3).q for each in (scene, loaded)]
    assert runs[0].tobytes() == runs[1].tobytes()
