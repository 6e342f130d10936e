"""Beams in replays and plots."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots, viz
from ngalpha_pin.viz.frames import sample


@pytest.fixture(scope="module")
def hop():
    scene, q0, v0 = robots.load("hopper", height=0.2)
    return nga.simulate(scene, q0, v0, t_end=0.01, dt=5e-4, method=nga.GeneralizedAlpha(rho_inf=0.0))


def test_replay_has_the_bodies_the_beam_and_its_points(hop, tmp_path):
    frames = sample(hop)
    tube = frames.tubes[0]
    assert tube.name == "shin"
    foot = hop.system.model.getJointId("foot")
    assert frames.pose[:, foot, :3] == pytest.approx(tube.points[:, -1], abs=1e-12)
    knee = hop.system.model.getJointId("knee")
    assert frames.pose[:, knee, :3] == pytest.approx(tube.points[:, 0], abs=1e-12)
    viz.save_html(hop, tmp_path / "hop.html")
    assert "shin" in (tmp_path / "hop.html").read_text()


def test_section_forces_are_plotted_over_time_and_over_the_length(hop, tmp_path):
    figure = viz.plot(hop, tmp_path / "time.png", show=("bending", "axial"))
    assert [len(ax.lines) for ax in figure.axes] == [5, 5]
    forces = hop.section_forces("shin", np.linspace(0, 1, 5))
    for ax, values in zip(figure.axes, (forces.M, forces.N), strict=True):
        assert np.array([line.get_ydata() for line in ax.lines]).T == pytest.approx(values)
    figure = viz.plot_beams(hop, [0.0, 0.01], tmp_path / "length.png")
    assert [len(ax.lines) for ax in figure.axes] == [2, 2]
    assert np.abs(figure.axes[1].lines[1].get_ydata()).max() > 0.1
    with pytest.raises(nga.SceneError, match="times"):
        viz.plot_beams(hop, tmp_path / "in the place of times.png")
    with pytest.raises(nga.SceneError, match="no beam whose section forces"):
        viz.plot_beams(nga.simulate(*robots.load("rotating_ball"), t_end=0.01, dt=5e-3))
