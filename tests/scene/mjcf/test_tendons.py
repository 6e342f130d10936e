"""Spatial tendons between two sites: their length stays in its range, as MuJoCo measures it."""

import numpy as np
import pytest
from mujoco_reference import OWN, Reference

import ngalpha_pin as nga

PATH = next(path for path in OWN if path.stem == "cables")


def test_gaps_are_what_is_left_of_the_range():
    scene, rng = nga.Scene.from_mjcf(PATH), np.random.default_rng(0)
    reference = Reference(PATH, scene.model)
    for _ in range(5):
        q = scene.reference("qpos0")
        q[:3] = [0, 0, 2] + rng.uniform(-0.2, 0.2, 3)  # within the ranges, which are rigid
        q[7] = rng.uniform(-0.5, 0.5)
        reference.place(q, np.zeros(scene.model.nv))
        lengths, run = reference.d.ten_length, nga.simulate(scene, q, t_end=1e-6, dt=1e-6)
        gaps = dict(zip(run.contact_names, run.g_N[0], strict=True))
        assert gaps["cable_end/cable_longest"] == pytest.approx(0.5 - lengths[0], abs=1e-12)
        assert gaps["spacer_end/spacer_longest"] == pytest.approx(0.6 - lengths[1], abs=1e-12)
        assert gaps["spacer_end/spacer_shortest"] == pytest.approx(lengths[1] - 0.2, abs=1e-12)


def test_a_ball_falls_into_its_cable_and_hangs():
    scene = nga.Scene.from_mjcf(PATH)
    q = scene.reference("qpos0")
    run = nga.simulate(scene, q, t_end=0.6, dt=1e-3)
    away = np.linalg.norm(run.q[:, :3] - [0, 0, 2], axis=1)
    assert away[0] == pytest.approx(0.2) and away.max() <= 0.5 + 1e-12
    np.testing.assert_allclose(run.q[-1][:3], [0, 0, 1.5], atol=1e-9)
    fall = next(event for event in run.events if event.kind == "impact" and "cable" in event.contact)
    assert fall.t == pytest.approx(np.sqrt(2 * 0.3 / 9.81), abs=1e-6)
    assert run.audit().ok
