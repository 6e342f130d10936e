"""Cases of a scene of one's own: which ones there are, and what a row says of a run that breaks no law."""

from functools import partial

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.report.stability import made, own

LOAD = partial(robots.load, "rotating_ball")


def test_steps_that_do_not_go_into_the_run_twice_are_left_out():
    names = [case.name for case in own.own_cases("ball", LOAD, 0.05, 0.01)]
    assert names[:4] == [f"ball for 0.05 s with dt = {dt}, rho_inf = 0.5" for dt in ("0.0025", "0.005", "0.01", "0.02")]
    assert names[4:] == [f"ball for 0.05 s with dt = 0.01, rho_inf = {rho}" for rho in ("0", "0.9", "1")]


def test_a_case_is_a_row_and_one_that_cannot_run_says_why():
    (case, *_) = own.own_cases("ball", LOAD, 0.5, 0.01)
    row = made(case)
    assert row.passed
    assert row.penetration == "0e+00" or float(row.penetration) < 1e-9

    def broken():
        raise nga.SceneError("no such scene")

    (case, *_) = own.own_cases("broken", broken, 0.5, 0.01)
    assert made(case).reason == "SceneError: no such scene"


def test_only_small_steps_are_long():
    cases = list(own.own_cases("ball", LOAD, 0.5, 0.01))
    assert [case.long for case in cases] == [True, True, *[False] * (len(cases) - 2)]
