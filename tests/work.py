"""Counts what steps do, so that a step that becomes dearer is noticed on any machine."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import ngalpha_pin as nga
from ngalpha_pin.cli.call_counter import counted_calls
from ngalpha_pin.step.compiled import CompiledEquations, CompiledEvaluation
from ngalpha_pin.step.crowd import CrowdEquations
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.system.state import SolvedBy, State
from ngalpha_pin.system.system import System

HOME = str(Path(nga.__file__).parent)
# functions by the names of what their calls are counted as
COUNTED = {
    CompiledEquations.__init__: "compiled",
    StepEquations.__init__: "numpy",
    CrowdEquations._prepare: "crowd",
    CrowdEquations._next: "factorisations",
    CompiledEvaluation.__init__: "evaluations",
    CompiledEquations._next: "factorisations",
    CompiledEquations.linearise: "factorisations",
}


class Work(NamedTuple):
    """What some steps have done.

    Attributes:
        counts: of steps in the engine ("plain"), of other ones that it was asked to solve in one piece ("attempts", of
            which it has "solved" some), of
            equations set up outside of it ("compiled", of which "crowd" are of many trees, and "numpy"), and of
            "evaluations" and "factorisations" of all of them.
        python: calls of functions of the package.
        pinocchio: calls of Pinocchio's functions from Python; the engine calls two an evaluation, and one a
            factorisation where some coordinate is no plain number.
        solved_by: rungs of the cascade, by the number of steps.
    """

    counts: Counter[str]
    python: int
    pinocchio: int
    solved_by: Counter[SolvedBy]


def work_of(system: System, state: State, dt: float, steps: int, method: nga.GeneralizedAlpha) -> Work:
    """Run the same steps twice: for the calls of the package, and for those of Pinocchio."""
    counts: Counter[str] = Counter()
    names = {function.__code__: name for function, name in COUNTED.items()}  # type: ignore[attr-defined]
    calls = 0

    def count(frame: FrameType, event: str, argument: Any) -> None:
        nonlocal calls
        if event == "call":
            code = frame.f_code
            calls += code.co_filename.startswith(HOME)
            if code in names:
                counts[names[code]] += 1

    before: Callable[..., Any] | None = sys.getprofile()
    in_engine = _of_engine(system)
    sys.setprofile(count)
    try:
        solved_by = _run(system, state, dt, steps, method)
    finally:
        sys.setprofile(before)
    counts += _of_engine(system) - in_engine
    with counted_calls() as of_libraries:
        _run(system, state, dt, steps, method)
    pinocchio = sum(n for name, n in of_libraries.items() if name.startswith("pin."))
    return Work(counts, calls, pinocchio, solved_by)


def _of_engine(system: System) -> Counter[str]:
    """What the engine has done for a system."""
    if not system.plain:
        return Counter()
    engine = system.plain.engine
    names = {"plain": "steps", "evaluations": "evaluations", "factorisations": "corrections"}
    names |= {name: name for name in ("attempts", "solved")}
    return Counter({name: getattr(engine, count) for name, count in names.items()})


def _run(system: System, state: State, dt: float, steps: int, method: nga.GeneralizedAlpha) -> Counter[SolvedBy]:
    solved_by: Counter[SolvedBy] = Counter()
    for _ in range(steps):
        result = method.step(system, state, dt)
        assert result.converged
        state = result.state
        solved_by[result.solved_by] += 1
    return solved_by
