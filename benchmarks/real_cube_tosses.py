"""Tosses of a real cube, in both modes: every step converges, the audit accuses none, and both modes have one limit.

    python benchmarks/real_cube_tosses.py DATA [--tosses N] [--first N] [--processes N] [--table PATH]

DATA is a file of recorded tosses, or a folder with tosses.npz in it: q0 (n, 7) and v0 (n, 6) of a free flyer, starts
(n + 1,) rows of the record of each toss, and edge, mass, inertia and rate. The tosses of DAIRLab/contact-nets can be
converted to it.

Every toss runs for as long as it was recorded, with steps of 1/148 and 1/1036 s and with rtol from 1e-3 to 1e-8, with
every step and with the recorded times alone. Errors are largest distances of any corner at the recorded times from a
run with rtol = 1e-10, in units of rtol (1 m + 1 m); the last row holds fixed steps of 1/148/28 s against that run.
Iterations of a step are the sum over all solves of a step that is divided at impacts and ends of slip; those of one
solve are judged. Neither are counted with rtol.

A toss whose error is more than ten tolerances is run again, with rtol = 1e-10, from starts that are one tolerance
higher and lower. Where these runs part by more than ten tolerances, less than the tolerance decides how the toss goes
on, a corner that just strikes or just does not: no run of that tolerance can know it. Such tosses are "undecided", and
counted apart from those that are over.
"""
# ruff: noqa: E402  (threads are limited before numpy is imported)

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when numpy is imported

import coal
import numpy as np
import pinocchio as pin
from tables import add_table_option, publish

import ngalpha_pin as nga
from ngalpha_pin.integrators import attempt
from ngalpha_pin.step.cascade import Solution

MU, E_N = 0.18, 0.125  # published for these tosses
FIXED, CHOSEN = (148, 1036), (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
LIMIT, FINE = 1e-10, 28
MOST = 50  # iterations of one solve


class Toss(NamedTuple):
    """The start of a toss, and the times at which it was recorded."""

    number: int
    scene: nga.Scene
    q0: np.ndarray
    v0: np.ndarray
    t: np.ndarray
    edge: float


class Row(NamedTuple):
    """One run: what its error is [m], the most iterations of a step and of one solve, and what is wrong with it.

    Undecided are errors beyond ten tolerances of tosses whose ways part within one tolerance of the start.
    """

    mode: str
    toss: int
    error: float
    of_step: int
    of_solve: int
    wrong: str
    undecided: bool = False


class Solves:
    """`attempt.solve`, which notes the most iterations that it has taken."""

    def __init__(self) -> None:
        self.most, self._solve, attempt.solve = 0, attempt.solve, self

    def __call__(self, *given: Any) -> Solution:
        """Solve equations of a step."""
        found = self._solve(*given)
        self.most = max(self.most, found.n_iter)
        return found

    def taken(self) -> int:
        """The most since it was last asked."""
        most, self.most = self.most, 0
        return most


SOLVES = Solves()


def cube(edge: float, mass: float, inertia: float) -> nga.Scene:
    """A cube over a plane."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "cube")
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), inertia * np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("box", coal.Box(edge, edge, edge), parent="cube")
    scene.add_contact("box", "ground", mu=MU, e_N=E_N)
    return scene


def toss(path: Path, number: int) -> Toss:
    """One toss of a file."""
    with np.load(path) as data:
        edge, mass, inertia, rate = (float(data[name]) for name in ("edge", "mass", "inertia", "rate"))
        n = int(data["starts"][number + 1] - data["starts"][number])
        return Toss(
            number, cube(edge, mass, inertia), data["q0"][number], data["v0"][number], np.arange(n) / rate, edge
        )


def corners(q: np.ndarray, edge: float) -> np.ndarray:
    """Places of the eight corners, shape (n, 8, 3) [m]."""
    signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    return np.array([x[:3] + edge / 2 * signs @ pin.Quaternion(x[3:]).toRotationMatrix().T for x in q])


def rows_of(path: Path, number: int) -> list[Row]:
    """All runs of a toss."""
    case = toss(path, number)
    limit = corners(_run(case, rtol=LIMIT, t_eval=case.t).q, case.edge)
    rows = []

    def judged(mode: str, run: nga.Trajectory, at: slice | np.ndarray | None) -> None:
        audit = run.audit()
        wrong = "; ".join(f"{row.name}: {row.value}" for row in audit.rows() if row.ok is False)
        error = np.nan if at is None else float(np.abs(corners(run.q[at], case.edge) - limit).max())
        undecided = error > bound(mode) and _parts(case, limit, bound(mode))
        rows.append(Row(mode, number, error, audit.n_iter_max, SOLVES.taken(), wrong, undecided))

    for rate in FIXED:
        every = rate // FIXED[0]
        judged(f"dt = 1/{rate} s", _run(case, dt=1.0 / rate), slice(None, None, every))
    for rtol in CHOSEN:
        judged(f"rtol = {rtol:.0e}", _run(case, rtol=rtol), None)
        judged(f"rtol = {rtol:.0e}, t_eval", _run(case, rtol=rtol, t_eval=case.t), slice(None))
    judged(f"dt = 1/{FIXED[0] * FINE} s", _run(case, dt=1.0 / (FIXED[0] * FINE)), slice(None, None, FINE))
    return rows


def _parts(case: Toss, limit: np.ndarray, most: float) -> bool:
    """Starts one tolerance, a tenth of `most`, higher and lower lead away from the limit by more than `most` [m]."""
    moved = []
    for side in (1.0, -1.0):
        q0 = case.q0 + side * most / 10.0 * np.eye(7)[2]
        run = _run(case._replace(q0=q0), rtol=LIMIT, t_eval=case.t)
        moved.append(float(np.abs(corners(run.q, case.edge) - limit).max()))
    SOLVES.taken()
    return max(moved) > most


def _run(case: Toss, **options: Any) -> nga.Trajectory:
    return nga.simulate(case.scene, case.q0, case.v0, t_end=float(case.t[-1]), on_failure="stop", **options)


def bound(mode: str) -> float:
    """Ten times the tolerance of a mode, whose errors are known [m]."""
    return 10.0 * 2.0 * float(mode.split(",")[0].split("=")[1]) if "t_eval" in mode else np.inf


def table(rows: list[Row]) -> tuple[list[str], bool]:
    """The lines of the table, and whether all of it holds."""
    lines = [
        "| mode | tosses | accused | iterations of a step | of a solve | error, median [m] | largest [m] | over "
        "| undecided |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    good = True
    for mode in dict.fromkeys(row.mode for row in rows):
        of_mode = [row for row in rows if row.mode == mode]
        accused, most = sum(bool(row.wrong) for row in of_mode), max(row.of_solve for row in of_mode)
        step = max(row.of_step for row in of_mode)
        errors, over, undecided = np.array([row.error for row in of_mode]), "", ""
        said = ["", ""] if np.isnan(errors).all() else [f"{np.median(errors):.1e}", f"{errors.max():.1e}"]
        if "t_eval" in mode:
            unknown = sum(row.undecided for row in of_mode)
            over, undecided = str(int((errors > bound(mode)).sum()) - unknown), str(unknown)
        good = good and not accused and most <= MOST and over in ("", "0")
        cells = (mode, str(len(of_mode)), str(accused), str(step), str(most), *said, over, undecided)
        lines.append("| " + " | ".join(cells) + " |")
    return lines, good


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="tosses.npz, or the folder that has it")
    parser.add_argument("--tosses", type=int, metavar="N", help="by default all")
    parser.add_argument("--first", type=int, default=0, metavar="N")
    parser.add_argument("--processes", type=int, default=1)
    add_table_option(parser)
    options = parser.parse_args()
    path = options.data / "tosses.npz" if options.data.is_dir() else options.data
    with np.load(path) as data:
        numbers = range(len(data["q0"]))[options.first :][: options.tosses]
    rows = []
    with ProcessPoolExecutor(options.processes) as pool:
        for found in pool.map(partial(rows_of, path), numbers):
            rows += found
            for row in found:
                if row.wrong or row.of_solve > MOST or row.error > bound(row.mode):
                    said = row.wrong or f"{row.of_solve} iterations of a solve, {row.error:.1e} m"
                    said += ", decided by less than the tolerance" if row.undecided else ""
                    print(f"toss {row.toss}, {row.mode}: {said}", file=sys.stderr, flush=True)
    lines, good = table(rows)
    publish(lines, options.table)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
