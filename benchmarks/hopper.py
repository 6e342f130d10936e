"""What of the hopper converges with dt: its landing, against steps that resolve the axial waves of its leg.

    python benchmarks/hopper.py [--end SECONDS] [--finest SECONDS] [--rho-inf RHO] [--table PATH]

The leg of the paper, a beam of 0.2 m without damping, swings along its axis with a first period of 4 L sqrt(rho A / EA)
= 0.16 ms and meets the ground with each swing; with a retardation time of 0.1 ms it does not swing. Both land from
0.31 m, from one state at 0.12 s on. Errors are against the finest step: of the height of the hip, of the impulse that
the ground gives, and the largest impulse of one impact with the number of impacts.
"""
# ruff: noqa: E402  (threads are limited before numpy is imported)

from __future__ import annotations

import argparse
import os
from typing import NamedTuple

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when numpy is imported

from tables import add_table_option, publish

import ngalpha_pin as nga
from ngalpha_pin import robots

START, FALL = 0.12, 1.25e-4  # [s]
SIZES = (1e-3, 5e-4, 2.5e-4, 1.25e-4, 5e-5, 2.5e-5)
LEGS = (("without damping", 0.0), ("retardation time 0.1 ms", 1e-4))


class Landing(NamedTuple):
    """What is compared: the height at the end [m], the impulse of the ground and the largest of an impact [N s]."""

    height: float
    impulse: float
    largest: float
    impacts: int


def landing(before: nga.Trajectory, dt: float, end: float, method: nga.GeneralizedAlpha) -> Landing:
    """The hopper from just before its first landing."""
    run = nga.simulate(before.scene, state=before.final_state, t_end=end, dt=dt, method=method)
    largest = float(run.impacts.P_N.max(initial=0.0))
    return Landing(float(run.q[-1, 0]), float(run.P_N.sum()), largest, len(run.impacts.t))


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--end", type=float, default=0.2, metavar="SECONDS")
    parser.add_argument(
        "--finest", type=float, default=1e-5, metavar="SECONDS", help="step that the others are held to"
    )
    parser.add_argument("--rho-inf", type=float, default=0.5, metavar="RHO")
    add_table_option(parser)
    options = parser.parse_args()
    method = nga.GeneralizedAlpha(rho_inf=options.rho_inf)
    lines = [
        "| leg | dt [s] | height at the end [m] | error [m] | impulse [N s] | error | largest impact [N s] | impacts |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for leg, damping in LEGS:
        scene, q0, v0 = robots.load("hopper", damping=damping)
        before = nga.simulate(scene, q0, v0, t_end=START, dt=FALL, method=method)
        fine = landing(before, options.finest, options.end, method)
        for dt in (*SIZES, options.finest):
            found = fine if dt == options.finest else landing(before, dt, options.end, method)
            numbers = (
                f"{found.height:.6f}", f"{abs(found.height - fine.height):.1e}", f"{found.impulse:.4f}",
                f"{abs(found.impulse - fine.impulse) / fine.impulse:.1e}", f"{found.largest:.3f}", str(found.impacts),
            )  # fmt: skip
            lines.append(f"| {leg} | {dt:g} | " + " | ".join(numbers) + " |")
    publish(lines, options.table)


if __name__ == "__main__":
    main()
