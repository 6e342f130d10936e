"""Runs of chosen accuracy: what they cost and how exact they are, against references and against fixed steps.

    python benchmarks/chosen_accuracy.py tolerances [--systems NAME ...] [--rtol 1e-3 ...]
    python benchmarks/chosen_accuracy.py fixed [--systems NAME ...] [--repeat N]

`tolerances`: the largest error of any coordinate in units of rtol (1 + |coordinate|), which is what is asked for, and
steps, evaluations of the equations of motion and computing time at each rtol.

`fixed`: the computing time of rtol = 1e-3 and 1e-6 in units of that of fixed steps with the same error, on scenes whose
reference is a run with rtol = 1e-11; the time of fixed steps between two of their sizes is interpolated. Errors are
those of material points at common times. Times are processor times of the loop alone, the smallest of the repeats.
"""
# ruff: noqa: E402  (threads are limited before numpy is imported)

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when numpy is imported

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga
from ngalpha_pin import references, robots
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.report.points import MaterialPoints, largest_distance
from ngalpha_pin.system.system import System

Start = tuple[nga.Scene, np.ndarray, np.ndarray]
EXACT, CHECK = 1e-11, 1e-10
ENOUGH = 4.0  # a run is not repeated any more once its repeats have taken so long [s]
SIZES = tuple(1e-2 / 2**i for i in range(9))


class Known(NamedTuple):
    """A system with a reference for its configurations at the times t."""

    start: Callable[[], Start]
    t_end: float
    reference: Callable[[np.ndarray], np.ndarray]


def known(name: str, t_end: float, **parameters: float) -> Known:
    """A system of robots/ with the reference of the same name."""
    return Known(
        partial(robots.load, name, **parameters), t_end, lambda t: getattr(references, name)(t, **parameters)[0]
    )


KNOWN = {
    "ball, omega = 50": known("rotating_ball", 1.5, omega=50.0),
    "ball, omega = 10": known("rotating_ball", 1.5, omega=10.0),
    "ball, e_N = 0.5": known("rotating_ball", 1.6, omega=0.0, e_N=0.5),
    "ball in corner": known("ball_in_corner", 2.0),
    "ball in cylinder": known("ball_in_cylinder", 2.0),
    "rolling disc": known("rolling_disc", 2.0),
    "rocking block": known("rocking_block", 2.0),
    "cradle of 5 with gaps": known("cradle", 2.0),
    "tippe top": known("tippe_top", 4.5),
}


def box_on_its_edge() -> Start:
    """A box of 1 kg that stands on one edge, 5 degrees off balance, and falls on its face."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "box")
    sides = np.array([0.2, 0.3, 0.1])
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, *sides), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("b", coal.Box(*sides), parent="box")
    scene.add_contact("b", "ground", mu=0.5)
    tilt = np.arctan2(sides[0], sides[2]) - np.radians(5.0)
    q0 = pin.neutral(model)
    q0[2] = (sides[0] * np.sin(tilt) + sides[2] * np.cos(tilt)) / 2
    q0[3:] = pin.Quaternion(pin.exp3(np.array([0.0, tilt, 0.0]))).coeffs()
    return scene, q0, np.zeros(6)


UNKNOWN: dict[str, tuple[Callable[[], Start], float]] = {
    "ANYmal landing": (partial(robots.load, "anymal"), 0.6),
    "cradle of 5": (partial(robots.load, "cradle", gap=0.0), 2.0),
    "box on its edge": (box_on_its_edge, 1.0),
}


def tolerances(names: list[str], sizes: list[float]) -> bool:
    """Print the first table; whether every error is within ten times the tolerance."""
    print("system                  rtol    error / tolerance   largest error   steps  evaluations  rejected  seconds")
    good = True
    for name in names:
        case = KNOWN[name]
        for rtol in sizes:
            scene, q0, v0 = case.start()
            begin = time.process_time()
            run = nga.simulate(scene, q0, v0, t_end=case.t_end, rtol=rtol, on_failure="stop")
            seconds = time.process_time() - begin
            q = case.reference(run.t)
            error = np.abs(run.q - q)
            ratio = float((error / (rtol * (1.0 + np.abs(q)))).max())
            good = good and run.success and run.audit().ok and ratio <= 10.0
            assert run.chosen is not None
            print(
                f"{name:22s} {rtol:6.0e} {ratio:12.3g} {error.max():21.2e} {len(run.t) - 1:9d}"
                f" {run.chosen.n_evaluations:11d} {run.chosen.rejected:9d} {seconds:9.2f}"
                + ("" if run.success else f"   {run.message}"),
                flush=True,
            )
    return good


def fixed(names: list[str], repeat: int) -> bool:
    """Print the second table; whether no run of chosen accuracy takes more than 1.2 times as long."""
    print("scene              rtol    largest error [m]   steps   seconds   fixed dt [s]   seconds   ratio")
    good = True
    for name in names:
        build, t_end = UNKNOWN[name]
        scene, q0, v0 = build()
        points, grid = MaterialPoints(scene), np.linspace(0.0, t_end, round(t_end / SIZES[0]) + 1)[1:]

        def sampled(rtol: float, start: Start = (scene, q0, v0), t: np.ndarray = grid) -> np.ndarray:
            return nga.simulate(*start, t_end=float(t[-1]), rtol=rtol, t_eval=t).q[1:]

        exact = points.positions(sampled(EXACT))
        doubt = largest_distance(points.positions(sampled(CHECK)), exact)
        steps = _Fixed(scene, q0, v0, t_end, repeat, lambda q, p=points, e=exact: largest_distance(p.positions(q), e))
        print(f"{name}: the reference is wrong by about {doubt:.1e} m")
        for rtol in (1e-3, 1e-6):
            error = max(largest_distance(points.positions(sampled(rtol)), exact), doubt)
            seconds, n = _timed(scene, q0, v0, t_end, rtol, repeat)
            dt, others, bound = steps.at(error)
            good = good and seconds <= 1.2 * others
            print(
                f"{'':16s} {rtol:6.0e} {error:15.2e} {n:12d} {seconds:9.3f}"
                f"   {'<' if bound else ' '}{dt:11.2e} {'>' if bound else ' '}{others:10.3f}"
                f" {'<' if bound else ' '}{seconds / others:6.2f}",
                flush=True,
            )
    return good


def _timed(scene: nga.Scene, q0: np.ndarray, v0: np.ndarray, t_end: float, rtol: float, repeat: int) -> tuple:
    """Smallest time of the loop [s], and its steps."""
    best, n = np.inf, 0
    for _ in range(repeat):
        begin = time.process_time()
        initial_state(System(scene), q0, v0)
        setup = time.process_time() - begin
        begin = time.process_time()
        run = nga.simulate(scene, q0, v0, t_end=t_end, rtol=rtol)
        best, n = min(best, time.process_time() - begin - setup), len(run.t) - 1
    return best, n


class _Fixed:
    """Errors and times of fixed steps, from coarse to fine, computed when they are needed."""

    def __init__(
        self, scene: nga.Scene, q0: np.ndarray, v0: np.ndarray, t_end: float, repeat: int,
        error: Callable[[np.ndarray], float],
    ):  # fmt: skip
        self._scene, self._start, self._t_end, self._repeat = scene, (q0, v0), t_end, repeat
        self._error, self._rows = error, []

    def _row(self, i: int) -> tuple[float, float, float]:
        """Step, error and seconds of the i-th size."""
        while len(self._rows) <= i:
            dt, best, total, count = SIZES[len(self._rows)], np.inf, 0.0, 0
            n, every = round(self._t_end / dt), round(SIZES[0] / dt)
            while count < self._repeat and total < ENOUGH:
                system, method = System(self._scene), nga.GeneralizedAlpha()
                state = initial_state(system, *self._start)
                found, begin = [], time.process_time()
                for j in range(1, n + 1):
                    state = method.step(system, state, dt).state
                    if j % every == 0:
                        found.append(state.q)
                seconds = time.process_time() - begin
                best, total, count = min(best, seconds), total + seconds, count + 1
            self._rows.append((dt, self._error(np.array(found)), best))
        return self._rows[i]

    def at(self, error: float) -> tuple[float, float, bool]:
        """Step and seconds at which the error is this one, and whether even the finest step is less exact."""
        for i in range(len(SIZES)):
            dt, found, seconds = self._row(i)
            if found <= error:
                if i == 0:
                    return dt, seconds, False
                dt_before, before, seconds_before = self._row(i - 1)
                part = np.log(before / error) / np.log(before / found)
                return (
                    float(dt_before * (dt / dt_before) ** part),
                    float(seconds_before * (seconds / seconds_before) ** part), False,
                )  # fmt: skip
        return dt, seconds, True


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("table", choices=("tolerances", "fixed"))
    parser.add_argument("--systems", nargs="+", metavar="NAME", help="by default all")
    parser.add_argument("--rtol", nargs="+", type=float, default=[10.0**-i for i in range(3, 10)])
    parser.add_argument("--repeat", type=int, default=3, help="of every run that is timed")
    options = parser.parse_args()
    names = list(KNOWN if options.table == "tolerances" else UNKNOWN)
    chosen = options.systems or names
    for name in chosen:
        if name not in names:
            parser.error(f"no system {name!r}; there are {', '.join(map(repr, names))}")
    good = tolerances(chosen, options.rtol) if options.table == "tolerances" else fixed(chosen, options.repeat)
    sys.exit(not good)


if __name__ == "__main__":
    main()
