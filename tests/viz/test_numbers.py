"""Numbers behind the drawings: planes, grids, thinned curves, panels."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.viz.curves import panels, thinned
from ngalpha_pin.viz.planes import cut, grid_segments, nice, planes


def test_planes_are_cut_where_another_begins():
    scene = nga.Scene(robots.load("rotating_ball")[0].model)
    scene.add_plane("left", normal=(1, 0, 1))
    scene.add_plane("right", normal=(-1, 0, 1))
    low, high = np.array([-1.0, -1, 0]), np.array([1.0, 1, 2])
    left, right = planes(scene, low, high)
    for piece, own, other in ((left, [1, 0, 1], [-1, 0, 1]), (right, [-1, 0, 1], [1, 0, 1])):
        assert np.abs(piece.polygon @ own).max() < 1e-9
        assert (piece.polygon @ other).min() > -1e-9
        lines = grid_segments(piece)
        assert len(lines) > 10
        assert np.abs(lines @ own).max() < 1e-9
        assert (lines @ other).min() > -1e-9
    square = np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    assert len(cut(square, np.array([2.0, 0, 0]), np.array([1.0, 0, 0]))) == 0
    np.testing.assert_array_equal(cut(square, np.array([-2.0, 0, 0]), np.array([1.0, 0, 0])), square)


@pytest.mark.parametrize(("value", "expected"), [(1.0, 1.0), (4.9, 2.0), (0.05, 0.05), (999.0, 500.0), (3e-7, 2e-7)])
def test_nice_numbers(value, expected):
    assert nice(value) == pytest.approx(expected)


def test_thinning_keeps_a_single_peak():
    t = np.linspace(0, 1, 100_001)
    y = np.sin(t)
    y[77_777] = 50.0
    t1, y1 = thinned(t, y, 1000)
    assert len(t1) <= 1002
    assert y1.max() == 50.0
    assert (np.diff(t1) > 0).all()


def test_panels_show_angles_of_every_joint_type():
    model = pin.Model()
    parent = 0
    kinds = (
        pin.JointModelRX(),
        pin.JointModelRUBY(),
        pin.JointModelPZ(),
        pin.JointModelSpherical(),
        pin.JointModelPlanar(),
    )
    for n, kind in enumerate(kinds):
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), f"j{n}")
        model.appendBodyToJoint(parent, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    run = nga.simulate(nga.Scene(model), pin.neutral(model), np.zeros(model.nv), t_end=0.01, dt=5e-3)
    labels = {panel.key: [curve.label for curve in panel.curves] for panel in panels(run)}
    assert labels["angle"] == ["j0", "j1", "j3 tilt", "j4"]
    assert labels["position"] == ["j2", "j4 x", "j4 y"]
    assert labels["rate"] == ["j0", "j1", "j3 x", "j3 y", "j3 z", "j4 z"]
    assert labels["speed"] == ["j2", "j4 x", "j4 y"]
