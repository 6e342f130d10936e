"""A run as meshcat's own animation: times, places and turns of its bodies."""

import numpy as np
import pinocchio as pin
import pytest
from viz_scenes import free_ball

import ngalpha_pin as nga
from ngalpha_pin.common.optional import require
from ngalpha_pin.viz.animation import animation
from ngalpha_pin.viz.frames import sample
from ngalpha_pin.viz.objects import Recorder


def test_the_animation_of_meshcat_has_the_poses_of_the_run():
    scene = nga.Scene(free_ball())
    v0 = np.array([1.0, 0, 0, 0, 0, 3.0])
    run = nga.simulate(scene, pin.neutral(scene.model), v0, t_end=0.2, dt=1e-2)
    viewer = require("meshcat", "", "").Visualizer(window=Recorder())
    (clip,) = animation(run, viewer).lower()
    assert clip["path"] == "/meshcat/replay/joint1"
    tracks = {track["name"]: track["keys"] for track in clip["clip"]["tracks"]}
    frames = sample(run)
    assert [key["time"] / clip["clip"]["fps"] for key in tracks[".position"]] == pytest.approx(frames.t)
    np.testing.assert_allclose([key["value"] for key in tracks[".position"]], run.q[frames.index, :3], atol=1e-12)
    np.testing.assert_allclose([key["value"] for key in tracks[".quaternion"]][0], run.q[0, 3:], atol=1e-12)
