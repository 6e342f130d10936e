"""What a step costs, in units of one LAPACK solve of size 20, and where its time goes.

The unit is the time of `scipy.linalg.lapack.dgesv` for a matrix of 20 x 20 in the same process, so that numbers of
different machines compare. Only the stepping loop is timed, on one thread and in processor time, which other programs
disturb least. Every run is made with the compiled engine, which makes plain steps without Python in between, and with
its numpy twin; a time of both is split over what Pinocchio, the contacts and the linear algebra take, as far as Python
calls them, and the rest.

    python benchmarks/step_cost.py [--repeat N]
"""
# ruff: noqa: E402  (threads are limited before numpy is imported)

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple
from unittest import mock

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when numpy is imported

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators.breakpoints import steps_ahead
from ngalpha_pin.report.machine import solve_time
from ngalpha_pin.report.parts import GROUPS, shares
from ngalpha_pin.simulation.simulate import AHEAD
from ngalpha_pin.system.state import State
from ngalpha_pin.system.stretch import Stretch
from ngalpha_pin.system.system import System

METHOD = nga.GeneralizedAlpha(rho_inf=0.5)
NO_BREAKPOINTS = np.zeros(0)
STANDING = 1.2  # by then Solo12 has landed [s]
LIMITS_MAY_COST = 1.05  # of a step of Solo12, in parts of one without joint limits
FAR = 50  # contact pairs of the arm that never close


class Case(NamedTuple):
    """A run of `n` steps from `state`, and what a step may cost."""

    name: str
    system: System
    state: State
    n: int
    dt: float
    target: float | None


def cases() -> Iterator[Case]:
    """The runs that are timed."""
    yield _from_start("rotating ball", *robots.load("rotating_ball", omega=50.0), 1.5, 2e-3, 30)
    yield _from_start("tippe top", *robots.load("tippe_top"), 1.3, 1e-3, 60)

    scene, q0, v0 = robots.load("solo12")
    landed = nga.simulate(scene, q0, v0, t_end=STANDING, dt=1e-3, method=METHOD).final_state
    yield Case("Solo12, standing", System(scene), landed, 300, 1e-3, 100)

    yield _from_start("four-bar linkage", *robots.load("four_bar"), 1.0, 1e-3, 30)
    yield _from_start("arm", *robots.load("arm"), 1.0, 1e-3, None)
    yield _from_start(f"arm, {FAR} far spheres", *_arm_with_spheres(declared=False), 1.0, 1e-3, None)
    yield _from_start(f"arm, {FAR} far contacts", *_arm_with_spheres(declared=True), 1.0, 1e-3, None)


def _from_start(
    name: str, scene: nga.Scene, q0: np.ndarray, v0: np.ndarray, t_end: float, dt: float, target: float | None
) -> Case:
    system = System(scene)
    return Case(name, system, initial_state(system, q0, v0), round(t_end / dt), dt, target)


def _arm_with_spheres(declared: bool) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """The arm with a ball in its hand and spheres around it that it cannot reach, with or without contact declared."""
    scene, q0, v0 = robots.load("arm")
    scene.add_geometry("ball", coal.Sphere(0.05), parent=scene.model.names[scene.model.njoints - 1])
    for i, angle in enumerate(np.linspace(0.0, 2 * np.pi, FAR, endpoint=False)):
        at = pin.SE3(np.eye(3), 10.0 * np.array([np.cos(angle), np.sin(angle), 0.0]))
        scene.add_geometry(f"far{i}", coal.Sphere(0.1), placement=at)
    if declared:
        scene.add_contact("ball", "far*", mu=0.5)
    return scene, q0, v0


def standing_with_and_without_limits() -> tuple[Case, Case]:
    """Solo12 on its feet with its joint laws, and without the joint limits, which are far away."""
    found = []
    for limits in (True, False):
        scene, q0, v0 = robots.load("solo12", height=0.0)
        scene.joints = nga.JointLaws(limits=limits)
        landed = nga.simulate(scene, q0, v0, t_end=0.1, dt=1e-3, method=METHOD).final_state
        found.append(Case(f"limits={limits}", System(scene), landed, 50, 1e-3, None))
    return found[0], found[1]


def cost_of_limits(repeat: int) -> float:
    """Step cost with limits in parts of that without, runs of both in turn, the fastest of each counts [-]."""
    pair = standing_with_and_without_limits()
    times = [[run(case)[0] for case in pair] for _ in range(repeat)]
    with_limits, without = np.min(times, axis=0)
    return float(with_limits / without)


def run(case: Case) -> tuple[float, float]:
    """Time per step [s] and iterations per step of one run."""
    state, iterations, left = case.state, 0, case.n
    begin = time.process_time()
    while left > 0:
        results = steps_ahead(METHOD, case.system, state, case.dt, min(left, AHEAD), NO_BREAKPOINTS)
        state = results[-1].state
        iterations += int(results.n_iter.sum()) if isinstance(results, Stretch) else results[0].n_iter
        left -= len(results)
    return (time.process_time() - begin) / case.n, iterations / case.n


class Cost(NamedTuple):
    """Median of several runs: time per step [s], iterations per step, and cost of a step in the unit."""

    seconds: float
    iterations: float
    cost: float


def measure(case: Case, repeat: int) -> Cost:
    """What the steps of a run cost."""
    run(case)
    times, costs = [], []
    for _ in range(repeat):
        # the unit is taken before and after, so that a machine that changes its speed changes both
        before = solve_time()[0]
        seconds, iterations = run(case)
        times.append(seconds)
        costs.append(2 * seconds / (before + solve_time()[0]))
    return Cost(statistics.median(times), iterations, statistics.median(costs))


def line(name: str, cost: Cost, verdict: str, case: Case) -> str:
    """One line of the table."""
    parts = "".join(f"{share:>11.0%}" for share in shares(partial(run, case)).values())
    return f"{name:<24}{1e6 * cost.seconds:>8.1f}{cost.iterations:>6.2f}{cost.cost:>7.1f}{verdict:>12}  {parts}"


def main(argv: list[str] | None = None) -> int:
    """Print the table; the exit code is 1 where a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeat", type=int, default=7, metavar="N", help="runs of each case; the median counts (7)")
    repeat = parser.parse_args(argv).repeat
    names = "".join(f"{group:>11}" for group in GROUPS)
    print(f"{'':<24}{'us/step':>8}{'iter':>6}{'cost':>7}{'target':>12}  {names}", flush=True)
    missed = False
    for case in cases():
        cost = measure(case, repeat)
        missed |= case.target is not None and cost.cost > case.target
        verdict = "" if case.target is None else f"{case.target:g} {'ok' if cost.cost <= case.target else 'NO'}"
        print(line(case.name, cost, verdict, case), flush=True)
        if kernel.library is not None:
            with mock.patch.object(kernel, "library", None):
                twin = measure(case, repeat)
                print(line("  numpy twin", twin, f"{twin.cost / cost.cost:.1f} x", case), flush=True)
    ratio = cost_of_limits(repeat)
    missed |= ratio > LIMITS_MAY_COST
    verdict = "ok" if ratio <= LIMITS_MAY_COST else "NO"
    print(f"Solo12 with joint limits far away / without them: {ratio:.3f}, at most {LIMITS_MAY_COST} {verdict}")
    print(f"cost: time of a step / time of dgesv of size 20, which is {1e6 * solve_time()[0]:.2f} us here")
    print(f"engine: {kernel.origin}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
