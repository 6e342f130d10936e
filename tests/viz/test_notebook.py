"""A trajectory in a notebook: what a cell shows, and the replay inside its frame in a real browser."""

import re
import subprocess
import sys

import pytest
from viz_scenes import fixed_shapes

import ngalpha_pin as nga
from ngalpha_pin import robots, viz
from ngalpha_pin.common.optional import MissingPackageError
from ngalpha_pin.viz.browser import Browser, find_browser


@pytest.fixture(scope="module")
def run():
    return nga.simulate(*robots.load("rotating_ball"), t_end=0.6, dt=2e-3)


def cells(text):
    """Texts of the cells of a table, row by row."""
    return [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", text)]


def test_summary_says_what_the_audit_says(run):
    table = {name: (value, mark) for name, value, mark in cells(run._repr_html_())}
    assert table["time"] == ("0 to 0.6 s", "")
    assert table["contacts"] == ("1", "")
    assert table["events"] == ("1 impact", "")
    for name, value, _, ok in run.audit().rows():
        shown, mark = table[name]
        assert mark == {True: "\N{CHECK MARK}", False: "\N{BALLOT X}", None: ""}[ok]
        assert shown.startswith(f"{value:.3g}" if isinstance(value, float) else str(value))


def test_summary_of_a_run_that_stopped_shows_why(run):
    run.message, run.success = "stopped at <t> = 0.1", False
    table = {name: (value, mark) for name, value, mark in cells(run._repr_html_())}
    run.message, run.success = "reached t_end", True
    assert table["end"] == ("stopped at &lt;t&gt; = 0.1", "\N{BALLOT X}")


def test_summary_imports_no_viewer():
    code = (
        "import sys, ngalpha_pin as nga; from ngalpha_pin import robots\n"
        "run = nga.simulate(*robots.load('arm'), t_end=0.01, dt=0.01); assert '<table>' in run._repr_html_()\n"
        "print(*{'meshcat', 'matplotlib', 'IPython'} & set(sys.modules))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == ""


def test_embedded_replay_runs_in_its_frame(tmp_path):
    try:
        program = find_browser()
    except MissingPackageError as error:
        pytest.skip(str(error))
    replay = viz.embed(fixed_shapes(), title="shapes", height=450)
    assert repr(replay) == f"Replay of {len(replay.page) / 1e6:.2f} MB"
    notebook = tmp_path / "notebook.html"
    notebook.write_text(f"<!DOCTYPE html><meta charset='utf-8'><body>{replay._repr_html_()}</body>", encoding="utf-8")
    with Browser(800, 500, path=program) as browser:
        browser.open(notebook, ready="document.querySelector('iframe').contentWindow.replay")
        inside = "document.querySelector('iframe').contentWindow.{}"
        browser.evaluate(inside.format("replay.set_time(0.05)"))
        assert browser.evaluate(inside.format("replay.time()")) == pytest.approx(0.05)
        assert browser.evaluate(inside.format("document.title")) == "shapes"
        assert browser.evaluate(inside.format("innerHeight")) == 450
        assert browser.complaints() == []
        addresses = [url for url in browser.requests() if not url.startswith(("file:", "data:", "blob:", "about:"))]
        assert addresses == []
