"""Runs of the six systems of the paper: the package's step against the oracle."""

import numpy as np
import pytest
from oracle_twin import Twin

STEPS = 100
AGREE = 1e-9
"""Of every quantity, in SI units or in parts of the largest value of the run."""
SECOND, PAPER = "second-order", "paper"

CASES = {
    # falls, meets the plane, slips, sticks; sticks at once; bounces ever lower
    "ball that slips": ("rotating_ball", {}, 1e-2, 0.5, 0, (SECOND, PAPER)),
    "ball that sticks": ("rotating_ball", {"omega": 10.0}, 1e-2, 0.5, 0, (SECOND, PAPER)),
    "ball that bounces": ("rotating_ball", {"omega": 5.0, "e_N": 0.5, "e_F": 0.3}, 1.9e-2, 0.5, 0, (SECOND, PAPER)),
    # left and right plane in turn, with lift-offs
    "ball in corner": ("ball_in_corner", {}, 1e-2, 0.5, 0, (SECOND, PAPER)),
    # slips in changing directions, sticks, rolls
    "ball in cylinder": ("ball_in_cylinder", {}, 1e-2, 0.5, 0, (SECOND, PAPER)),
    # slides until the forces grow tenfold; through the catastrophe, off the ground and down again
    "rod that slides": ("painleve_rod", {}, 8e-3, 0.9, 0, (SECOND, PAPER)),
    "rod that is thrown off": ("painleve_rod", {}, 8e-3, 0.9, 25, (SECOND, PAPER)),
    # impact of the foot, which slips and sticks, with the waves that it sends through the beam
    "hopper": ("hopper", {"height": 0.2007, "fall": 0.5}, 5e-5, 0.0, 0, (SECOND, PAPER)),
    # impact in the first step, slip and drilling friction all the time; impact of the stick
    "tippe top": ("tippe_top", {}, 1e-3, 0.5, 0, (SECOND, PAPER)),
    "tippe top on its stick": ("tippe_top", {}, 1e-3, 0.5, 1320, (SECOND, PAPER)),
}
# bounces are shorter than a step from there on: the package locates them, the oracle captures them
SHORTER = {("ball that bounces", SECOND): 66}


# of the beam the step that is the default, and of both laws what takes less time
LONG = (("hopper", PAPER), ("tippe top on its stick", PAPER))
RUNS = [
    pytest.param(case, laws, marks=[pytest.mark.long] * ((case, laws) in LONG))
    for case in CASES
    for laws in CASES[case][-1]
]


@pytest.mark.parametrize(("case", "laws"), RUNS)
def test_runs_agree(case, laws, monkeypatch):
    # the oracle divides its steps at impacts, and not at ends of slip
    monkeypatch.setattr("ngalpha_pin.integrators.division.ending_slips", lambda *args: None)
    name, parameters, dt, rho_inf, first, _ = CASES[case]
    twin = Twin(name, **parameters)
    steps = SHORTER.get((case, laws), STEPS)
    ours, theirs = twin.run(steps, dt, rho_inf, laws, first)
    assert len(ours.t) == len(theirs.t) == steps + 1
    found = twin.differences(ours, theirs)
    assert (theirs.P_N > 0.0).any() and (np.abs(theirs.P_F) > 0.0).any()
    for quantity, errors in found.items():
        assert min(errors) <= AGREE, (quantity, found)
