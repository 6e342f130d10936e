"""Restitution as it is declared: numbers, functions and laws, files, and what is refused."""

import json

import coal
import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin.scene.restitution import Restitution, restitution_from_plain, restitution_to_plain


def scene_with(**law):
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    scene.add_contact("ball", "ground", **law)
    return scene


@pytest.mark.parametrize(
    "e_N, said",
    [
        (1.1, "e_N"),
        (nga.Restitution, "e_N"),
        (lambda v: 1.5 - v, "e_N: got 1.5 at an approach of 0 m/s"),
        (lambda v: 1.0 - v, "must be in"),
        (lambda v: float("nan"), "e_N: got nan"),
        (lambda: 0.5, "e_N: the function failed"),
    ],
)
def test_what_is_refused(e_N, said):
    with pytest.raises(nga.SceneError, match=said):
        scene_with(e_N=e_N)


def test_laws_that_are_refused():
    with pytest.raises(nga.SceneError, match="Restitution: law"):
        nga.Restitution(0.5, "hertz")
    with pytest.raises(nga.SceneError, match="e_N"):
        nga.Restitution(-0.1, "stronge")
    with pytest.raises(nga.SceneError, match="e_F belongs to Newton's law"):
        scene_with(e_N=nga.Restitution(0.5, "poisson"), e_F=0.3)


def test_a_number_is_newtons_law():
    assert scene_with(e_N=nga.Restitution(0.5)).contacts == scene_with(e_N=0.5).contacts
    law = scene_with(e_N=nga.Restitution(0.5, "stronge")).varied(e_N=0.2).contacts[0].law
    assert law.restitution == nga.Restitution(0.2, "stronge")
    assert scene_with(e_N=lambda v: 0.5).varied(e_N=0.2).contacts[0].law.restitution is None


def test_functions_and_laws_in_files(tmp_path):
    falls = Restitution(lambda v: 0.9 / (1 + 0.3 * v), "poisson")
    plain = json.loads(json.dumps(restitution_to_plain(falls, False)))
    speeds = np.array([0.0, 1e-3, 0.37, 2.0, 45.0])
    assert restitution_from_plain(plain)(speeds) == pytest.approx(falls(speeds), abs=1e-5)
    scene = scene_with(e_N=falls)
    q0 = scene.q_ref.copy()
    q0[2] = 0.3
    run = nga.simulate(scene, q0, t_end=0.3, dt=5e-3)
    run.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    assert loaded.audit().ok
    before, after = -run.impacts.v_before[0, 2:3], loaded.impacts.v_after[0, 2:3]
    assert after == pytest.approx(falls(before) * before)
