"""Time of a step beside that of other simulators, on the same scenes, in turn, in one process, and what each misses.

    python benchmarks/peers.py [--scene NAME ...] [--repeat N] [--table PATH]

Every line is built from the same `Scene`; those that are not installed, or cannot represent a scene, say so. A time is
the median over the repetitions of the time per step of the stepping loop alone, on one thread. Penetrations are the
deepest ones at the steps of each run, both measured by this package.
"""
# ruff: noqa: E402  (threads are limited before numpy is imported)

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
import warnings
from collections.abc import Callable
from typing import NamedTuple

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when numpy is imported

import coal
import numpy as np
import pinocchio as pin
from tables import add_table_option, publish

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators.breakpoints import steps_ahead
from ngalpha_pin.report.lines import Line, March, Start, installed_simulators
from ngalpha_pin.results.recorder import Recorder
from ngalpha_pin.simulation.simulate import AHEAD
from ngalpha_pin.system.contact_search import smallest_gap
from ngalpha_pin.system.system import System

WAIT = 0.1  # seconds a robot stands before its steps are timed [s]
NO_BREAKPOINTS = np.zeros(0)
SAMPLES = 100  # steps whose penetration is measured


class Case(NamedTuple):
    """A scene, how many steps are timed, and the time of the peer's step that a step may take.

    Attributes:
        make: gives scene, q0 and v0.
        dt: step [s].
        n: steps that are timed.
        before: steps before them, by this package.
        peer: name of the simulator that the target is of.
        target: at most so many times its time.
    """

    make: Callable[[], tuple[nga.Scene, np.ndarray, np.ndarray | None]]
    dt: float
    n: int
    before: int
    peer: str
    target: float


def robot(name: str, kp: float, kd: float, height: float = 1e-4) -> tuple[nga.Scene, np.ndarray, None]:
    """A robot with all of its own shapes on the ground, held in its standing posture."""
    import example_robot_data

    found = example_robot_data.load(name)
    scene = nga.Scene(found.model, found.collision_model)
    scene.add_plane("ground")
    scene.add_contact("*", "ground", mu=0.8)
    scene.add_force(nga.JointPD(found.q0, kp=kp, kd=kd))
    return scene, scene.place_on("ground", found.q0, clearance=height), None


def panda() -> tuple[nga.Scene, np.ndarray, None]:
    """The arm falls, without contact."""
    import example_robot_data

    found = example_robot_data.load("panda")
    scene = nga.Scene(found.model)
    scene.joints = nga.JointLaws(limits=False)
    return scene, found.q0, None


def boxes(columns: int, rows: int) -> tuple[nga.Scene, np.ndarray, None]:
    """Columns of boxes that stand on a plane, beside each other."""
    scene, q = nga.Scene(), []
    scene.add_plane("ground")
    for i in range(columns):
        for j in range(rows):
            name = f"box_{i}_{j}"
            place = pin.SE3(np.eye(3), np.array([0.0, 0.21 * i, 0.1 + 0.2 * j]))
            scene.add_body(name, coal.Box(0.2, 0.2, 0.2), mass=1.0, placement=place)
            q += [*place.translation, 0.0, 0.0, 0.0, 1.0]
            below = "ground" if j == 0 else f"box_{i}_{j - 1}"
            scene.add_contact(name, below, mu=0.5)
    return scene, scene.q_ref, None


CASES = {
    "rotating ball": Case(lambda: robots.load("rotating_ball", omega=50.0), 1e-3, 10000, 0, "MuJoCo", 2.0),
    "ANYmal stands": Case(lambda: robot("anymal", 300.0, 10.0), 1e-3, 400, 300, "MuJoCo", 4.0),
    "Solo12 stands": Case(lambda: robot("solo12", 100.0, 3.0), 1e-3, 400, 300, "MuJoCo", 4.0),
    "Go2 stands": Case(lambda: robot("go2", 300.0, 10.0), 1e-3, 400, 300, "MuJoCo", 4.0),
    "Talos falls": Case(lambda: robot("talos", 300.0, 10.0, 0.03), 1e-3, 150, 0, "MuJoCo", 5.0),
    "stack of 10": Case(lambda: boxes(1, 10), 1e-3, 100, 0, "MuJoCo", 3.0),
    "columns, 5 x 5": Case(lambda: boxes(5, 5), 1e-3, 30, 0, "MuJoCo", 3.0),
    "64 balls": Case(lambda: robots.load("balls_in_box"), 1e-3, 200, 0, "MuJoCo", 4.0),
    "four-bar": Case(lambda: robots.load("four_bar"), 1e-3, 1000, 0, "Exudyn", 1.5),
    "Panda free": Case(panda, 1e-3, 1000, 0, "MuJoCo", 4.0),
}


def own(start: Start) -> March:
    """The steps of this package, as `simulate` makes and records them."""
    begin = time.perf_counter()
    system, method = System(start.scene), nga.GeneralizedAlpha()
    recorder = Recorder(system, initial_state(system, start.q0, start.v0))
    setup = time.perf_counter() - begin
    begin = time.perf_counter()
    while len(recorder) < start.n:
        room = min(start.n - len(recorder), AHEAD)
        recorder.extend(steps_ahead(method, system, recorder.state, start.dt, room, NO_BREAKPOINTS))
    run = recorder.trajectory(start.scene, "", start.dt, True, "")
    return March(run.q, time.perf_counter() - begin, setup, n_iter=float(run.n_iter[1:].mean()))


def penetration(system: System, q: np.ndarray) -> float:
    """The deepest one at some of the steps [m]."""
    deepest = 0.0
    for x in q[:: max(1, len(q) // SAMPLES)]:
        system.place(x)
        deepest = max(deepest, -smallest_gap(system, x) * system.contacts.length)
    return deepest if system.contacts.n else 0.0


def measured(case: Case, lines: list[Line], repeat: int) -> dict[str, tuple[float, float, float] | str]:
    """Microseconds per step, penetration and iterations of every line, or why there are none."""
    scene, q0, v0 = case.make()
    if case.before:
        state = nga.simulate(scene, q0, v0, t_end=case.before * case.dt, dt=case.dt).final_state
        q0, v0 = state.q, state.v
    v0 = np.zeros(scene.model.nv) if v0 is None else v0
    system, start = System(scene), Start(scene, q0, v0, 0.0, case.dt, case.n)
    times: dict[str, list[float]] = {}
    found: dict[str, tuple[float, float, float] | str] = {}
    for _ in range(repeat):
        for line in lines:
            if isinstance(found.get(line.label), str):
                continue
            try:
                march = line.run(start)
            except Exception as error:  # of any library: a line that cannot run says why
                found[line.label] = " ".join(f"{type(error).__name__}: {error}".split())[:90]
                continue
            if march.message:
                found[line.label] = march.message[:70]
                continue
            times.setdefault(line.label, []).append(1e6 * march.seconds / case.n)
            if line.label not in found:
                found[line.label] = 0.0, penetration(system, march.q), march.n_iter
    median = {label: statistics.median(values) for label, values in times.items()}
    return {x: y if isinstance(y, str) else (median[x], *y[1:]) for x, y in found.items()}


def rows_of(name: str, case: Case, found: dict[str, tuple[float, float, float] | str]) -> list[list[str]]:
    """Lines of the table of one scene."""
    rows, mine = [], found["this package"]
    for label, result in found.items():
        if isinstance(result, str) or isinstance(mine, str):
            rows.append([name, label, "-", "-", "-", str(result)])
            continue
        ratio = "" if label == "this package" else f"{mine[0] / result[0]:.3g}"
        verdict = "ok" if mine[0] <= case.target * result[0] else "NO"
        verdict = f"at most {case.target:g}: {verdict}" if label == case.peer else ""
        rows.append([name, label, f"{result[0]:.0f}", f"{result[1]:.1e}", ratio, verdict])
    return rows


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", action="append", choices=list(CASES), help="only these; all by default")
    parser.add_argument("--repeat", type=int, default=3)
    add_table_option(parser)
    options = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    simulators, absent = installed_simulators()
    for name, why in absent.items():
        print(f"{name}: {why}", file=sys.stderr)
    lines = [Line("this package", own), *simulators]
    head = ["scene", "line", "us a step", "penetration [m]", "this package / line", "target"]
    table = [f"| {' | '.join(head)} |", "|" + " --- |" * len(head)]
    for name in options.scene or CASES:
        for row in rows_of(name, CASES[name], measured(CASES[name], lines, options.repeat)):
            table.append(f"| {' | '.join(row)} |")
            print(table[-1], flush=True, file=sys.stderr)
    publish(table, options.table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
