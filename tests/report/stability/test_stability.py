"""The table of stiff and extreme cases: how a row is made, and a quick selection of the cases themselves."""

import dataclasses
import functools
import operator
import os
import re
from collections import Counter

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.cli import main as cli
from ngalpha_pin.report import stability
from ngalpha_pin.report.stability import invariants, loops, row, scenes

QUICK = (
    "spring of 1e+03",
    "spring of 1e+12",
    "spin of 1e+05 rad/s about its axis",
    "hangs at rest",
    "quadruped lands with dt = 0.05",
    "start in their flat position",
    "ball on a ball, 1e+09",
    "inertia 1e-09",
    "lengths times 1e-06",
    "lengths times 1e+06",
    "every second one without mass",
    "slips, rolls with dt = 0.05",
    "mu = 1e+06",
    "mu = 1e-12",
    "wedge",
    "row of 9 balls",
    "plate stands on 16",
    "closed from the start",
    "grazed",
    "noise of 1e-12 in q0 of rotating_ball",
)


@pytest.mark.parametrize("name", QUICK)
def test_quick_selection_passes(name):
    chosen = list(stability.cases(quick=True, only=name))
    assert chosen
    for case in chosen:
        made = stability.made(case)
        assert made.passed, f"{made.case}: {made.reason}"


def test_step_that_ends_in_a_singular_position_says_what_bounds_it():
    between, at_end = (stability.made(case) for case in stability.cases(only="driven parallelogram"))
    assert between.passed
    assert not at_end.passed
    assert "did not converge" in at_end.reason
    assert at_end.reason.endswith(f"bounded by {loops.INFINITE}")


@pytest.fixture(scope="module")
def ball():
    return nga.simulate(*robots.load("rotating_ball"), t_end=0.6, dt=2e-3)


def test_row_says_what_holds_and_what_does_not(ball):
    good = row.judged("ball", ball, [stability.Check("speed", 0.5, 1.0)])
    assert good.passed
    assert good.reason == "speed 5.0e-01"
    bad = row.judged("ball", ball, [stability.Check("speed", 2.0, 1.0)])
    assert not bad.passed
    assert bad.reason == "speed 2.0e+00, allowed 1e+00"
    nan = row.judged("ball", ball, [stability.Check("speed", float("nan"), 1.0)])
    assert not nan.passed


def test_law_that_is_broken_is_a_failure(ball):
    q = ball.q.copy()
    q[-1, 1] -= 1e-3
    broken = row.judged("ball", dataclasses.replace(ball, q=q), [])
    assert not broken.passed
    assert "largest penetration" in broken.reason


def test_energy_from_nowhere_is_a_failure(ball):
    v = ball.v.copy()
    v[-1] += 5.0
    assert "rise of energy" in row.judged("ball", dataclasses.replace(ball, v=v), []).reason


def test_case_that_raises_is_a_row_with_the_reason():
    def raises():
        raise nga.SceneError("no such thing")

    made = stability.made(stability.Case("broken", raises))
    assert not made.passed
    assert made.reason == "SceneError: no such thing"


# run in processes of their own, as every row is, which need not find this module
fails = functools.partial(operator.truediv, 1.0, 0.0)
ends = functools.partial(os._exit, 7)


def test_command_prints_and_writes_every_row(tmp_path, monkeypatch, capsys):
    cases = [*stability.cases(only="mu = 10"), stability.Case("fails", fails), stability.Case("ends", ends)]
    monkeypatch.setattr("ngalpha_pin.report.stability.command.cases", lambda quick, only: cases)
    out = tmp_path / "table.md"
    assert cli.main(["stability", "--out", str(out)]) == 1
    text = out.read_text()
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    # in the order of the table, whichever row was ready first
    assert [line.split(" | ")[0].strip("| ") for line in lines[2:]] == [case.name for case in cases]
    assert len(lines) == len(cases) + 2
    assert len({line.count("|") for line in lines}) == 1
    assert re.search(r"^\| fails \| \*\*fail\*\* .*ZeroDivisionError: float division by zero", text, re.MULTILINE)
    assert re.search(r"^\| ends \| \*\*fail\*\* .*the process of this case was ended", text, re.MULTILINE)
    assert "2 fail" in text
    printed = capsys.readouterr().out
    assert "FAILED  fails" in printed


def test_interrupted_table_is_written(tmp_path, monkeypatch, capsys):
    cases = [*stability.cases(only="grazed"), *stability.cases(only="mu = 0.2")]
    told = []

    def stops(row):
        told.append(row)
        if len(told) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr("ngalpha_pin.report.stability.command.cases", lambda quick, only: cases)
    monkeypatch.setattr("ngalpha_pin.report.stability.command._print", stops)
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    out = tmp_path / "table.md"
    assert cli.main(["stability", "--out", str(out)]) == 130
    assert f"{len(told)} cases, 2 pass" in out.read_text()


def test_unknown_case_is_an_error(capsys):
    assert cli.main(["stability", "--only", "unicorn"]) == 2
    assert "no case has 'unicorn'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "steps"),
    [("tumbles", 15_000), ("swings", 2000), ("goes round", 8000), ("rolls", 2000), ("stands", 2000), ("lies", 2000)],
)
def test_long_runs_in_short(name, steps):
    """Their first tenth must hold a whole tumble, swing or turn."""
    case = next(case for case in invariants.cases(steps) if name in case.name)
    made = stability.made(case)
    assert made.passed, made.reason


def test_drift_is_seen():
    """A long run whose invariant goes on growing, or whose laws are broken, fails."""
    grows = invariants.kept("flight", scenes.free_body(), 200, 1e-2, nga.GeneralizedAlpha(), lambda q, v: q[:1])
    assert not grows.passed
    assert "invariants off by" in grows.reason
    broken = row.stepped("drift", Counter(newton=1), 1, 1, [], "-", np.array([0.0, 1e-3, 0.0]))
    assert not broken.passed
    assert broken.reason == "penetration 1.0e-03, allowed 1e-09"


@pytest.mark.long
@pytest.mark.parametrize("case", [c for c in stability.cases() if c.long], ids=lambda case: case.name)
def test_long_rows(case):
    """Those that are known to fail say what bounds them."""
    made = stability.made(case)
    assert made.passed or case.bound, made.reason
