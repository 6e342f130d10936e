"""Many balls fall into a box and come to rest: penetration, rest, rungs, and the cost of a step by its closed contacts.

    python benchmarks/crowd.py [--side N] [--layers N] [--gap R] [--t-end S] [--dt S] [--table PATH]

The table is Markdown. A step costs so many microseconds of processor time on one thread; beside it stands the time of a
LAPACK solve of size 20 in the same process, so that numbers of different machines compare.
"""
# ruff: noqa: E402  (threads are limited before numpy is imported)

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when numpy is imported

import numpy as np
import pinocchio as pin
from tables import add_table_option, publish

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.report.machine import solve_time
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

BINS = (0, 1, 25, 50, 75, 100, 125, 150, 200, 300)
REPORT_EVERY = 100  # steps
PENETRATION = 1e-8  # [m]
AT_REST = 1e-6  # largest velocity of a ball [m/s]
# of the residual of a step: gaps of closed contacts hold to 1e-13 m with it, velocities to 1e-10 m/s
TOL = 1e-8


class Run:
    """The steps of a run and what they cost.

    Args:
        system: compiled scene.
        state: start.
        dt: step [s].
    """

    def __init__(self, system: System, state: State, dt: float):
        self.system, self.state, self.dt = system, state, dt
        self.method = nga.GeneralizedAlpha(tol=TOL)
        self.rungs: Counter[str] = Counter()
        self.failed = 0
        self.deepest = 0.0
        self.steps: list[tuple[int, float, int]] = []  # closed contacts, seconds, iterations
        self._every = system.contacts.subset(np.arange(system.contacts.n))

    def step(self) -> bool:
        """One step; false where it has not converged."""
        begin = time.process_time()
        result = self.method.step(self.system, self.state, self.dt)
        seconds = time.process_time() - begin
        self.rungs[result.solved_by.value] += 1
        self.failed += not result.converged
        if not result.converged:
            return False
        self.state = result.state
        self.steps.append((len(self.state.contacts), seconds, result.n_iter))
        self.system.place(self.state.q)
        self.deepest = min(self.deepest, float(self.system.gaps(self._every, self.state.q).min()))
        return True

    @property
    def speed(self) -> float:
        """Largest velocity of a body [m/s]; of balls, or of whatever has free flyers."""
        return float(np.linalg.norm(self.state.v.reshape(-1, 6)[:, :3], axis=1).max())

    @property
    def kinetic_energy(self) -> float:
        """Of all bodies [J]."""
        return float(pin.computeKineticEnergy(self.system.model, self.system.data, self.state.q, self.state.v))

    def table(self) -> list[str]:
        """Lines of a Markdown table of the cost by closed contacts."""
        k, seconds, n_iter = (np.array(x) for x in zip(*self.steps, strict=True))
        unit = solve_time()[0]
        lines = [
            "| closed contacts | steps | iterations | us / step | median us / step | in LAPACK solves of size 20 |",
            "| --- | --- | --- | --- | --- | --- |",
        ]
        for low, high in zip(BINS, (*BINS[1:], 10**9), strict=True):
            here = (k >= low) & (k < high)
            if here.any():
                name = f"{low}" if high == low + 1 else f"{low} to {high - 1}" if high < 10**9 else f"{low} and more"
                mean, median = float(seconds[here].mean()), float(np.median(seconds[here]))
                lines.append(
                    f"| {name} | {here.sum()} | {n_iter[here].mean():.1f} | {1e6 * mean:.0f} | {1e6 * median:.0f} | "
                    f"{mean / unit:.0f} |"
                )
        return lines


def main(argv: list[str] | None = None) -> int:
    """Run, print the table; the exit code is 1 where a step has not converged, a ball penetrates or does not rest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--side", type=int, default=4, metavar="N", help="balls along each side of the box (4)")
    parser.add_argument("--layers", type=int, default=4, metavar="N", help="layers of balls (4)")
    parser.add_argument(
        "--gap",
        type=float,
        default=0.002,
        metavar="R",
        help="between balls at the start, in parts of the radius (0.002)",
    )
    parser.add_argument("--t-end", type=float, default=2.0, metavar="S", help="length of the run (2.0 s)")
    parser.add_argument("--dt", type=float, default=1e-3, metavar="S", help="length of a step (0.001 s)")
    add_table_option(parser)
    args = parser.parse_args(argv)
    scene, q0, v0 = robots.load("balls_in_box", side=args.side, layers=args.layers, gap=args.gap)
    system = System(scene)
    run = Run(system, initial_state(system, q0, v0), args.dt)
    n, begin = round(args.t_end / args.dt), time.process_time()
    for i in range(n):
        if not run.step():
            break
        if (i + 1) % REPORT_EVERY == 0:
            print(
                f"t = {run.state.t:.2f} s: {len(run.state.contacts)} contacts closed, "
                f"fastest ball {run.speed:.2e} m/s, kinetic energy {run.kinetic_energy:.1e} J, "
                f"penetration {-run.deepest:.1e} m, "
                f"{time.process_time() - begin:.0f} s of computing",
                flush=True,
            )
    rungs = ", ".join(f"{name} {count}" for name, count in run.rungs.most_common())
    lines = [
        f"{args.side**2 * args.layers} balls, {system.contacts.n} declared pairs, {len(run.steps)} of {n} steps of "
        f"{args.dt:g} s, {run.failed} of them not converged ({rungs}).",
        f"At t = {run.state.t:.3f} s {len(run.state.contacts)} contacts are closed and the fastest ball has "
        f"{run.speed:.1e} m/s; the kinetic energy is {run.kinetic_energy:.1e} J. "
        f"Largest penetration {-run.deepest:.1e} m. {time.process_time() - begin:.0f} s of processor time.",
        "",
        *run.table(),
    ]
    publish(lines, args.table)
    return int(run.failed > 0 or run.deepest < -PENETRATION or run.speed > AT_REST)


if __name__ == "__main__":
    sys.exit(main())
