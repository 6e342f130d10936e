"""One way down: how often the state of a step moves from one package to another, and back up, before it is solved."""

import sys
from itertools import groupby, pairwise
from pathlib import Path
from types import FrameType

import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.integrators.piece import Cut, Piece
from ngalpha_pin.system.state import State

HOME = Path(nga.__file__).parent
# packages that a state comes to, from below, as the import contract of pyproject.toml has them
FLOORS = ("contact", "constraints", "system", "initialization", "step", "integrators")
MOVES, CLIMBS = 12, 2
# options, steps, their length [s], and what happens in one of them at least
SYSTEMS = {
    "rotating_ball": ({}, 120, 5e-3, "impact"),
    "ball_in_corner": ({}, 120, 1e-2, "impact"),
    "ball_in_cylinder": ({}, 200, 5e-3, "slip"),
    "painleve_rod": ({}, 60, 8e-3, "newton"),
    "hopper": ({}, 20, 5e-4, "newton"),
    "tippe_top": ({}, 60, 1e-3, "impact"),
    "four_bar": ({}, 60, 2e-3, "newton"),
    "box_on_incline": ({}, 60, 1e-2, "slip"),
    "go2": ({"height": 0.002}, 60, 1e-3, "impact"),
}


def carries(value: object) -> bool:
    """A state, alone or with what a step hands on with it."""
    return isinstance(value, (State, Piece, Cut)) or (isinstance(value, tuple) and any(map(carries, value)))


def given(frame: FrameType | None) -> bool:
    """The function has got a state from its caller, other than as the object whose method it is."""
    if frame is None or not frame.f_code.co_filename.startswith(str(HOME)):
        return False
    names = frame.f_code.co_varnames[: frame.f_code.co_argcount + frame.f_code.co_kwonlyargcount]
    return any(carries(frame.f_locals.get(name)) for name in names if name != "self")


class Way:
    """The packages that the state of one step moves through: a module counts when it first gets the state.

    What a function is given of a state that its caller has made itself is no way of the state that came in.
    """

    def __init__(self) -> None:
        self.modules: list[Path] = []

    def __call__(self, frame: FrameType, event: str, argument: object) -> None:
        if event != "call" or not given(frame):
            return
        module = Path(frame.f_code.co_filename).relative_to(HOME)
        if module not in self.modules and (not self.modules or given(frame.f_back)):
            self.modules.append(module)

    @property
    def packages(self) -> list[str]:
        return [package for package, _ in groupby(module.parts[0] for module in self.modules)]

    @property
    def climbs(self) -> int:
        return sum(FLOORS.index(a) < FLOORS.index(b) for a, b in pairwise(self.packages))


@pytest.mark.skipif(kernel.library is None, reason=f"no compiled kernel: {kernel.origin}")
@pytest.mark.parametrize("name", SYSTEMS)
def test_the_state_goes_down(name):
    options, steps, dt, happens = SYSTEMS[name]
    scene, q0, v0 = robots.load(name, **options)
    method, simulator = nga.GeneralizedAlpha(), nga.Simulator(scene, dt)
    state, solved = simulator.initial_state(q0, v0), set()
    before = sys.getprofile()
    for _ in range(steps):
        way = Way()
        sys.setprofile(way)
        try:
            result = method.step(simulator.system, state, dt)
        finally:
            sys.setprofile(before)
        assert result.converged
        state = result.state
        solved.add(result.solved_by.name.lower())
        assert len(way.packages) - 1 <= MOVES and way.climbs <= CLIMBS, [str(module) for module in way.modules]
    assert happens in solved, solved
