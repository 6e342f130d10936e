"""Every example runs, with a few steps; those of the paper's impacts run over them and meet their numbers."""

import importlib
import inspect
import re
from pathlib import Path

import numpy as np
import pytest

from ngalpha_pin import viz

EXAMPLES = Path(__file__).parent.parent / "examples"
NAMES = sorted({path.stem for path in EXAMPLES.glob("*.py")} - {"common", "joint_gallery", "paper_figures"})


@pytest.fixture
def example(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return lambda name: importlib.import_module(name)


# examples that declare their scene themselves
OWN_SCENES = (
    "ball_on_beam", "conveyor", "falling_rod", "gripper", "motor", "rolling_ball", "shaken_floor", "sledge",
    "stick_slip", "two_arms", "vacuum_cup",
)  # fmt: skip
# ten steps; this one turns at up to 1,500 rad/s
SHORT = {"andrews": 2e-4}


@pytest.mark.parametrize("name", NAMES)
def test_example_runs(example, name, capsys):
    dt = SHORT.get(name, 2e-3)
    trajectory = example(name).main(["--t-end", str(10 * dt), "--dt", str(dt)])
    assert trajectory.success
    assert trajectory.t[-1] == pytest.approx(10 * dt)
    assert str(trajectory.audit()) in capsys.readouterr().out


def test_example_for_every_system():
    from ngalpha_pin import robots

    assert tuple(name for name in NAMES if name not in OWN_SCENES) == robots.names()


def test_gripper_lifts_by_friction_is_welded_and_lets_go(example, tmp_path):
    gripper = example("gripper")
    run = gripper.main(["--dt", "1e-2", "--html", str(tmp_path / "gripper.html")])
    assert run.audit().ok and len(run.parts) == 3
    assert (tmp_path / "gripper.html").stat().st_size > 100_000
    cube = run.frame("cube")
    height, felt = cube.position[:, 2], 0.4 * (9.81 + cube.acceleration[:, 2])
    lifted, carried, landed = (np.searchsorted(run.t, t) for t in (0.59, 0.99, 1.29))
    by_fingers = run.contact_force("cube", "left").force[:, 2] + run.contact_force("cube", "right").force[:, 2]
    assert height[lifted] > 0.2 and by_fingers[lifted] == pytest.approx(felt[lifted], rel=1e-6)
    assert height[carried] > 0.3 and by_fingers[carried] == 0.0
    assert height[landed] == pytest.approx(0.05, abs=0.01)
    assert [event.kind for event in run.changes] == ["weld", "release"]
    lines = [line for line in inspect.getsource(gripper).splitlines()[1:-2] if line]
    assert len(lines) <= 30  # of all there is, imports included, but the docstring and what starts it


def test_two_arms_in_fifteen_lines_with_a_replay_and_a_good_audit(example, tmp_path):
    two_arms = example("two_arms")
    run = two_arms.main(["--t-end", "0.3", "--html", str(tmp_path / "two_arms.html")])
    assert run.audit().ok
    assert (tmp_path / "two_arms.html").stat().st_size > 100_000
    lines = inspect.getsource(two_arms.bench).splitlines()[1:]
    assert len(lines) + 2 <= 15  # with those that simulate it and write the replay


@pytest.mark.parametrize("name", NAMES)
def test_example_takes_the_options_that_show_it(example, name, capsys):
    with pytest.raises(SystemExit) as end:
        example(name).main(["--help"])
    assert end.value.code == 0
    printed = capsys.readouterr().out
    assert all(option in printed for option in ("--display", "--html PATH", "--plot PATH"))


def test_example_is_displayed(example, monkeypatch):
    shown = []
    monkeypatch.setattr(viz, "play", shown.append)
    trajectory = example("rotating_ball").main(["--t-end", "0.05", "--display"])
    assert shown == [trajectory]


@pytest.mark.parametrize(
    ("name", "arguments", "tolerances"),
    [
        ("rotating_ball", ["--t-end", "0.8"], {"normal percussion": 0.03, "friction percussion": 0.006, "speed": 1e-4}),
        ("ball_in_cylinder", ["--t-end", "1"], {"largest distance": 1e-6}),
        ("conveyor", [], {"way along the belt": 1e-6}),
        ("rolling_ball", ["--dt", "1e-2"], {"way to the rest": 1e-3}),
        ("stick_slip", [], {"period": 1e-5}),
        ("vacuum_cup", [], {"height of the box": 1e-5}),
        ("motor", [], {"speed at the end": 2e-4, "current at the end": 1e-4}),
        ("shaken_floor", [], {"height of the mass": 1e-5}),
        ("painleve_rod", ["--t-end", "0.9"], {"time of the blow-up": 3e-3}),
        ("joint_gallery", ["--t-end", "0.2"], {"rows that are held": 1e-9, "largest violation": 1e-12}),
    ],
)
def test_example_meets_its_numbers(example, name, arguments, tolerances, capsys):
    example(name).main(arguments)
    printed = capsys.readouterr().out
    for quantity, tolerance in tolerances.items():
        difference = re.search(rf"^{quantity}.*difference (\S+)$", printed, re.MULTILINE)
        assert abs(float(difference[1])) < tolerance


def test_arm_keeps_its_energy_and_away_from_its_limits(example):
    trajectory = example("arm").main(["--dt", "0.002"])
    limits = trajectory.scene.model.upperPositionLimit
    assert (np.abs(trajectory.q) < limits).all()
    assert np.ptp(trajectory.energy.total) < 1e-2 * np.ptp(trajectory.energy.kinetic)


@pytest.mark.parametrize("name", ["quadruped", "anymal"])
def test_robot_stands_after_its_landing(example, name):
    trajectory = example(name).main(["--t-end", "1.2", "--dt", "0.004"])
    model, q = trajectory.scene.model, trajectory.q
    assert trajectory.la_N[-1].sum() == pytest.approx(9.81 * sum(i.mass for i in model.inertias), rel=0.05)
    # upright, near the posture that the joints hold
    assert np.abs(q[-1, 3:5]).max() < 0.02
    assert q[0, 2] - q[-1, 2] == pytest.approx(0.1, abs=0.02)


# meshcat imports a module of pyzmq that is deprecated
@pytest.mark.filterwarnings("ignore:zmq.eventloop.ioloop:DeprecationWarning")
def test_example_writes_replay_and_plots(example, tmp_path):
    pytest.importorskip("matplotlib")
    html, plot = tmp_path / "ball.html", tmp_path / "ball.png"
    trajectory = example("rotating_ball").main(["--t-end", "0.05", "--html", str(html), "--plot", str(plot)])
    assert np.isfinite(trajectory.q).all()
    assert html.stat().st_size > 1000
    assert plot.stat().st_size > 1000
