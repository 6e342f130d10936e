"""The figure: no text lies over another one, legends stand beside the curves, a notebook shows it once."""

import subprocess
import sys
from itertools import combinations

import numpy as np
import pinocchio as pin
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import ngalpha_pin as nga
from ngalpha_pin import robots, viz
from ngalpha_pin.viz.figure import MAX_CURVES, MAX_NAME, SYMBOLS, short

ALL = tuple(SYMBOLS)


def boxes(figure):
    """Text and bounding box of everything that is written, after drawing [pixels]."""
    FigureCanvasAgg(figure)
    figure.canvas.draw()
    found = []
    for ax in figure.axes:
        (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
        found += [ax.title, ax._left_title, ax.xaxis.label, ax.yaxis.label]
        found += ax.get_legend().get_texts()
        found += [label for label in ax.get_xticklabels() if x0 <= label.get_position()[0] <= x1]
        found += [label for label in ax.get_yticklabels() if y0 <= label.get_position()[1] <= y1]
    return [(x.get_text(), x.get_window_extent()) for x in found if x.get_visible() and x.get_text()]


def chain(n=20):
    """A chain of n bodies with long names."""
    model, joint = pin.Model(), 0
    for k in range(n):
        joint = model.addJoint(
            joint, pin.JointModelRX(), pin.SE3(np.eye(3), np.array([0, 0.1, 0])), f"left_arm_of_the_upper_chain_{k}"
        )
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(0.1, 0.02), pin.SE3.Identity())
    return nga.simulate(nga.Scene(model), np.zeros(n), np.ones(n), t_end=0.02, dt=1e-3)


def talos():
    """All shapes of Talos above the ground."""
    example_robot_data = pytest.importorskip("example_robot_data")
    robot = example_robot_data.load("talos")
    scene = nga.Scene(robot.model, robot.collision_model)
    scene.add_plane("ground")
    scene.add_contact("*", "ground", mu=0.8)
    return scene, scene.place_on("ground", robot.q0, clearance=1e-5), None


# what falls touches by then
RUNS = {
    "go2": (lambda: robots.load("go2", height=1e-3), 0.03, 2e-3),
    "talos": (talos, 0.004, 1e-3),
    "balls_in_box": (lambda: robots.load("balls_in_box"), 0.105, 1e-3),
    "64 balls": (lambda: robots.load("balls_in_box", side=4, layers=4), 0.106, 2e-3),
    "hopper": (lambda: robots.load("hopper"), 0.14, 2e-3),
    "arm": (lambda: robots.load("arm"), 0.2, 1e-2),
}


@pytest.fixture(scope="module")
def runs():
    """Runs by name, made when they are asked for."""
    found = {"chain": chain()}

    def run(name):
        if name not in found:
            load, t_end, dt = RUNS[name]
            found[name] = nga.simulate(*load(), t_end=t_end, dt=dt)
        return found[name]

    return run


QUICK = ("go2", "balls_in_box", "chain", "arm")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.long) for name in ("chain", *RUNS)]
)
@pytest.mark.filterwarnings("ignore:contact takes the convex hull")  # of Talos
def test_no_text_overlaps_and_legends_stand_outside(runs, name, tmp_path):
    figure = viz.plot(runs(name), tmp_path / "run.png", show=ALL)
    written = boxes(figure)
    assert len(written) > 10
    for (a, box), (b, other) in combinations(written, 2):
        assert not _overlap(box, other), f"{a!r} and {b!r} lie over each other"
    inside = figure.bbox
    for text, box in written:
        assert inside.x0 - 1 <= box.x0 and box.x1 <= inside.x1 + 1, f"{text!r} is cut off"
        assert inside.y0 - 1 <= box.y0 and box.y1 <= inside.y1 + 1, f"{text!r} is cut off"
    for ax in figure.axes:
        assert ax.get_legend().get_window_extent().x0 >= ax.get_window_extent().x1 - 1
        assert len(ax.get_legend().get_texts()) <= MAX_CURVES


def _overlap(a, b):
    return min(a.x1, b.x1) - max(a.x0, b.x0) > 1 and min(a.y1, b.y1) - max(a.y0, b.y0) > 1


def test_a_panel_of_many_curves_says_how_many_there_are(runs, tmp_path):
    (ax,) = viz.plot(runs("chain"), tmp_path / "a.png", show=("angle",)).axes
    assert ax.get_title("left") == "Joint angles: the 8 of 20 that vary most"


def test_long_names_keep_their_ends():
    assert short("a" * MAX_NAME) == "a" * MAX_NAME
    name = short("left_sole_of_the_upper_robot/ground_of_the_hall")
    assert len(name) <= MAX_NAME
    assert name.startswith("left_sole")
    assert name.endswith("hall")


CELLS = {"viz.plot(run)": 1, "figure = viz.plot(run)": 1, "figure": 1, "viz.plot(run); viz.plot(run)": 2, "1 + 1": 0}


def test_a_notebook_shows_a_figure_once(tmp_path):
    pytest.importorskip("IPython")
    pytest.importorskip("matplotlib_inline")
    script = tmp_path / "cells.py"
    script.write_text(
        "from IPython.core.interactiveshell import InteractiveShell\n"
        "from IPython.utils.capture import capture_output\n"
        "shell = InteractiveShell.instance()\n"
        "shell.enable_gui = lambda gui=None: None\n"
        "shell.run_line_magic('matplotlib', 'inline')\n"
        "shell.run_cell('from ngalpha_pin import robots, viz; import ngalpha_pin as nga')\n"
        "shell.run_cell(\"run = nga.simulate(*robots.load('arm'), t_end=0.01, dt=0.01)\")\n"
        "results = []\n"
        "shell.displayhook.write_format_data = lambda data, md=None: results.append('image/png' in data)\n"
        f"for cell in {list(CELLS)!r}:\n"
        "    results.clear()\n"
        "    with capture_output() as out:\n"
        "        result = shell.run_cell(cell)\n"
        "    assert result.success, result\n"
        "    print('pictures', sum(results) + sum('image/png' in o.data for o in out.outputs))\n"
    )
    run = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    pictures = [int(line.split()[1]) for line in run.stdout.splitlines() if line.startswith("pictures")]
    assert pictures == list(CELLS.values()), run.stdout + run.stderr
