"""The paper's figures in their quick form: every curve against what the paper prints or a closed form says."""

import importlib
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder of the figures, and the figures."""
    pytest.importorskip("matplotlib")
    folder = tmp_path_factory.mktemp("figures")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(EXAMPLES))
        figures = importlib.import_module("paper_figures").main(["--quick", "--out", str(folder), "--format", "png"])
    return folder, figures


def curves(written, number, ax=1):
    return [line.get_xydata().T for line in written[1][number].axes[ax].lines]


def test_every_figure_is_written_with_named_axes(written):
    folder, figures = written
    assert sorted(figures) == [1, 2, 3, 4, 5, 6, 7]
    for number, figure in figures.items():
        assert (folder / f"figure_{number}.png").stat().st_size > 10_000
        right = figure.axes[1]
        assert right.get_xlabel().endswith("]")
        assert (right.get_ylabel() or figure.axes[0].get_ylabel()) != ""


def test_bounces_lose_their_height(written):
    ((t, y),) = curves(written, 1)
    assert y[0] == 1.0
    # closed form: impacts at t1, then flights of v1, v1 / 2, ... in which the speed is halved each time
    speed = np.sqrt(2 * 9.81 * 0.9)
    first, second = speed / 9.81, speed / 9.81 * (1 + 2 * 0.5)
    between = (t > first + 0.02) & (t < second - 0.02)
    assert y[between].max() == pytest.approx(0.1 + 0.9 / 4, rel=2e-2)
    assert y[-1] == pytest.approx(0.1, abs=1e-6)  # at rest after the accumulation point


def test_friction_at_the_impact_and_after_it(written):
    impact = np.sqrt(2 * 9.81 * 0.9)
    (t, impulsive), (_, force) = curves(written, 2, ax=0)
    assert np.abs(impulsive).max() == pytest.approx(0.2 * impact, rel=1e-2)  # the paper: 0.84
    assert np.abs(force).max() == pytest.approx(0.2 * 9.81, rel=1e-6)  # the paper: 1.96
    assert force[-1] == pytest.approx(0.0, abs=1e-9)
    (_, impulsive), (_, force) = curves(written, 2, ax=1)
    assert np.abs(impulsive).max() == pytest.approx(2 / 7 * 0.1 * 10, rel=2e-2)  # the paper: 0.29
    assert np.abs(force).max() < 1e-6


def test_ball_rests_in_the_corner(written):
    for t, gap in curves(written, 3):
        assert gap.min() > -1e-9
        assert gap[t > 1.4].max() < 1e-6


def test_centre_stays_on_its_circle_but_not_with_moreau(written):
    moreau, ours = (np.hypot(x, y - 1) for x, y in curves(written, 4))
    np.testing.assert_allclose(ours, 0.9, atol=1e-8)
    assert moreau.max() > 0.92


def test_rod_is_thrown_off(written):
    ((t, rate),) = curves(written, 5)
    jump = np.abs(np.diff(rate))
    assert t[np.argmax(jump)] == pytest.approx(0.8145497, abs=3e-3)


def test_top_turns_over_as_with_moreau(written):
    (t0, moreau), (t1, ours) = curves(written, 7)
    assert ours[0] == pytest.approx(0.1)
    assert ours[-1] > 0.5
    np.testing.assert_allclose(ours, np.interp(t1, t0, moreau), atol=0.05)
