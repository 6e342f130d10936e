"""The lines of a report: one method or simulator each, run on the same scene."""

from __future__ import annotations

import importlib
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.integrators.method import Method
from ngalpha_pin.integrators.moreau import MoreauJean
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.simulation.simulate import simulate
from ngalpha_pin.system.system import System

from .bounded import Deadline, OutOfTime, within

SIMULATORS = ("mujoco", "drake", "pybullet", "exudyn", "pinocchio_admm")
"""Modules of `ngalpha_pin.simulators`; the extra `bench` installs what they need, all but Drake."""


OWN = ("generalized-alpha", "laws of the paper")  # how the labels of this package's method begin
GIVEN_UP = "given up"  # how the message of a run begins that took too long
SAMPLES = 64  # times at which a run of chosen accuracy is compared, because samples cost more than its own steps


class Start(NamedTuple):
    """What is run: the scene from q0 and v0 at t0, n steps of dt.

    Attributes:
        limit: a run that computes longer is given up [s].
        for_time: run again for its time alone.
        anywhere: errors can be told at any time, not only at multiples of a step.
    """

    scene: Scene
    q0: np.ndarray
    v0: np.ndarray
    t0: float
    dt: float
    n: int
    limit: float = np.inf
    for_time: bool = False
    anywhere: bool = False


class March(NamedTuple):
    """What one run gives.

    Attributes:
        q: configurations, shape (steps + 1, nq).
        seconds: of the stepping loop alone.
        setup: seconds before it.
        n_iter: iterations per step, or NaN for a simulator that does not tell.
        rungs: how many steps each rung of the solver ladder solved.
        message: why it ended early, or "".
        t: of the configurations where steps are not of dt, shape (steps + 1,) [s]; None where they are.
        v: velocity at the end, shape (nv,); None of a simulator that does not tell.
    """

    q: np.ndarray
    seconds: float
    setup: float
    n_iter: float = np.nan
    rungs: dict[str, int] = {}
    message: str = ""
    t: np.ndarray | None = None
    v: np.ndarray | None = None


class Line(NamedTuple):
    """A line of the report.

    Attributes:
        label: its name.
        run: runs a scene; raises a SceneError where it cannot represent it.
        note: what a reader must know of it.
    """

    label: str
    run: Callable[[Start], March]
    note: str = ""


def own_lines(rho_inf: Sequence[float]) -> list[Line]:
    """Generalized-alpha with both sets of laws, Moreau's scheme, and runs of chosen accuracy.

    Args:
        rho_inf: one line of each set of laws for every value [-].
    """
    lines = []
    for laws, label in zip(("second-order", "paper"), OWN, strict=True):
        for rho in rho_inf:
            name = label if len(rho_inf) == 1 else f"{label}, rho_inf = {rho:g}"
            lines.append(own_line(name, GeneralizedAlpha(rho_inf=rho, laws=laws)))
    accuracy = Line(
        "chosen accuracy",
        march_to_accuracy,
        "rtol = atol = (dt / 1 s)^2; its steps are its own, and a time per step is that per dt",
    )
    return [*lines, own_line("Moreau", MoreauJean()), accuracy]


def own_line(label: str, method: Method) -> Line:
    """The line of a method of this package."""
    return Line(label, lambda start: march(start, method), repr(method))


def installed_simulators() -> tuple[list[Line], dict[str, str]]:
    """Lines of the other simulators that are there, and of those that are not, what to do."""
    lines, absent = [], {}
    for name in SIMULATORS:
        try:
            module = importlib.import_module(f"ngalpha_pin.simulators.{name}")
        except ImportError as error:
            if not isinstance(error, ModuleNotFoundError):  # it is there
                absent[name] = f"it cannot be imported: {error}"
                continue
            extra = "drake" if name == "drake" else "'ngalpha-pin[bench]'"
            absent[name] = f"{error}; pip install {extra} has it"
            continue
        lines.append(module.line())
    return lines, absent


def bounded(line: Line, start: Start) -> March:
    """A run of a line that is given up at the limit of its start, also where a single step takes longer."""
    try:
        return within(1.2 * start.limit, lambda: line.run(start))
    except OutOfTime:
        words = f"{GIVEN_UP} after {start.limit:.2g} s of computing, within a step"
        return March(np.asarray(start.q0)[None], start.limit, 0.0, message=words)


def march_to_accuracy(start: Start) -> March:
    """A run with rtol in the place of dt, timed without the samples that are taken where its own steps do not do."""
    begin = time.perf_counter()
    system = System(start.scene)
    state = initial_state(system, start.q0, start.v0, start.t0)
    setup = time.perf_counter() - begin
    stride = -(-start.n // SAMPLES)
    times = start.t0 + start.dt * np.arange(stride, start.n + 1, stride)
    rtol = min(max(start.dt**2, 1e-11), 1e-2)
    deadline = Deadline(start.limit)

    def gives_up(t: float, q: np.ndarray, v: np.ndarray) -> float:
        if deadline.passed():
            raise SceneError(f"{GIVEN_UP} after {start.limit:g} s of computing")
        return 1.0

    options: dict[str, Any] = {"state": state, "t_end": float(times[-1]), "rtol": rtol, "on_failure": "stop"}
    options["events"] = gives_up
    begin = time.perf_counter()
    run = simulate(start.scene, **options)
    seconds = max(time.perf_counter() - begin - setup, 1e-9)
    t, q, message = run.t, run.q, "" if run.success else run.message
    if not start.for_time and not start.anywhere and not message:
        sampled = simulate(start.scene, **options, t_eval=times)
        t, q, message = sampled.t, sampled.q, "" if sampled.success else sampled.message
    return March(q, seconds, setup, np.nan, dict(Counter(run.solver_path[1:].tolist())), message, t, run.v[-1])


def march(start: Start, method: Method) -> March:
    """Step with a method of this package; only the loop over its steps is timed."""
    begin = time.perf_counter()
    system = System(start.scene)
    state = initial_state(system, start.q0, start.v0, start.t0)
    setup = time.perf_counter() - begin
    states, n_iter, rungs, message = [state], 0, [], ""
    begin, deadline = time.perf_counter(), Deadline(start.limit)
    for _ in range(start.n):
        try:
            result = method.step(system, state, start.dt)
        except np.linalg.LinAlgError as error:
            message = f"the step from t = {state.t:.6g} s failed: {error}"
            break
        if not result.converged:
            message = str(method.not_converged(system, state, start.dt, result))
            break
        state = result.state
        states.append(state)
        n_iter += result.n_iter
        rungs.append(result.solved_by.value)
        if deadline.passed():
            message = f"{GIVEN_UP} after {start.limit:g} s of computing"
            break
    seconds = time.perf_counter() - begin
    q = np.array([state.q for state in states])
    per_step = n_iter / max(len(rungs), 1)
    return March(q, seconds, setup, per_step, dict(Counter(rungs)), message, v=states[-1].v)
