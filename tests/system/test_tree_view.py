"""What forces at frames see of a system with beams: the tree alone."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.system.system import System
from ngalpha_pin.system.tree_view import TreeView


def test_points_of_beams_are_no_frames_of_the_tree():
    system = System(robots.load("hopper")[0])
    view = TreeView(system)
    assert view.nv == system.tree.nv < system.nv
    with pytest.raises(nga.SceneError, match="is a point of a beam"):
        view.frame(system.scene.beam_points[0].name)
    assert view.frame(system.tree.frames[1].name).name == system.tree.frames[1].name


def test_columns_of_the_tree():
    scene, q0, v0 = robots.load("hopper")
    system = System(scene)
    system.dynamics(0.0, q0, v0, np.zeros(system.nv))
    view, n = TreeView(system), system.tree.nv
    motion = view.motion(v0[:n], np.zeros(n))
    assert motion.J.shape == (6, n) and (motion.J == system.data.J[:, :n]).all()
