"""Recorded tosses of a real cube, followed by this package and by other simulators at their best parameters.

    python benchmarks/real_cube.py [DATA] [--tosses N] [--rates HZ ...] [--table PATH] [--figure PATH]

DATA is a file of recorded tosses or a folder with tosses.npz in it, see benchmarks/real_cube_tosses.py; by default
shared/data/cube beside the folder of this repository. Every toss
starts from the same state and runs for as long as it was recorded, with steps of 1 / rate. Its path error is the mean
distance of the centre from the recorded one over the whole toss, its rotation error the mean angle; the table has
medians over all tosses. A resting face is right where the same face is up at the end. Penetration is that of the
deepest corner at the recorded times, the largest of all tosses. Times are processor times of the steps of a toss, on
one thread.

This package takes the coefficients that were published for these tosses. The others have no restitution that would take
them, or one that depends on the step: for each rate they get the best of a grid by the median path error. The grid is
searched on every fifth toss, and the best of that on all of them. MuJoCo, Drake and PyBullet take part where they are
installed (pip install mujoco drake pybullet).
"""
# ruff: noqa: E402  (threads are limited before numpy is imported)

from __future__ import annotations

import argparse
import itertools
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when numpy is imported

import numpy as np
import pinocchio as pin
from real_cube_peers import PEERS, Peer
from real_cube_tosses import E_N, MU, corners, cube
from tables import add_table_option, publish

import ngalpha_pin as nga

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "cube"
SEARCHED, SHORTLIST = 5, 8  # the grid is searched on every fifth toss, its best eight on all of them


class Toss(NamedTuple):
    """A start and what was recorded, rows x y z qx qy qz qw at multiples of 1 / rate."""

    q0: np.ndarray
    v0: np.ndarray
    record: np.ndarray


class Score(NamedTuple):
    """What became of one toss: errors [m], [degrees], the face, the depth [m] and the time [s]."""

    path: float
    angle: float
    face: bool
    depth: float
    seconds: float


Run = Callable[[Toss], np.ndarray]
"""Poses at the recorded times, shape (n, 7)."""


def tosses(path: Path, count: int | None) -> tuple[list[Toss], dict[str, float]]:
    """The tosses of a file, and edge, mass, inertia and rate."""
    with np.load(path / "tosses.npz" if path.is_dir() else path) as data:
        ends = data["starts"]
        found = [
            Toss(q0, v0, data["record"][a:b])
            for q0, v0, a, b in zip(data["q0"], data["v0"], ends[:-1], ends[1:], strict=True)
        ]
        return found[:count], {name: float(data[name]) for name in ("edge", "mass", "inertia", "rate")}


def own(body: dict[str, float], every: int, method: Any) -> Run:
    """This package, or Moreau's scheme in it."""
    scene = cube(body["edge"], body["mass"], body["inertia"])
    dt = 1.0 / (body["rate"] * every)

    def run(toss: Toss) -> np.ndarray:
        t_end = (len(toss.record) - 1) / body["rate"]
        return nga.simulate(scene, toss.q0, toss.v0, t_end=t_end, dt=dt, method=method).q[::every]

    return run


def scored(run: Run, toss: Toss, edge: float) -> Score:
    """One toss against its record."""
    begin = time.process_time()
    q = run(toss)
    seconds = time.process_time() - begin
    record = toss.record
    path = float(np.linalg.norm(q[:, :3] - record[:, :3], axis=1).mean())
    cosine = np.abs((q[:, 3:] * record[:, 3:]).sum(axis=1))
    angle = float(np.degrees(2.0 * np.arccos(np.minimum(cosine, 1.0))).mean())
    depth = max(0.0, -float(corners(q, edge)[..., 2].min()))
    return Score(path, angle, face_up(q[-1]) == face_up(record[-1]), depth, seconds)


def face_up(q: np.ndarray) -> tuple[int, bool]:
    """The axis of the cube that is nearest to the vertical, and whether it points up."""
    up = pin.Quaternion(q[3:]).toRotationMatrix()[2]
    axis = int(np.abs(up).argmax())
    return axis, bool(up[axis] > 0.0)


def best_of(peer: Peer, all_tosses: list[Toss], body: dict[str, float], every: int) -> tuple[dict[str, float], Run]:
    """The parameters of a peer with the smallest median path error."""

    def error(parameters: dict[str, float], some: list[Toss]) -> float:
        run = peer.build(body, every, **parameters)
        return float(np.median([scored(run, toss, body["edge"]).path for toss in some]))

    grid = [dict(zip(peer.grid, values, strict=True)) for values in itertools.product(*peer.grid.values())]
    grid.sort(key=lambda parameters: error(parameters, all_tosses[::SEARCHED]))
    best = min(grid[:SHORTLIST], key=lambda parameters: error(parameters, all_tosses))
    return best, peer.build(body, every, **best)


def lines_of(all_tosses: list[Toss], body: dict[str, float], rate: float) -> Iterator[tuple[str, str, Run]]:
    """Name, parameters in words and run of everyone at a rate."""
    every = round(rate / body["rate"])
    published = f"mu = {MU}, e_N = {E_N} (published)"
    yield "this method", published, own(body, every, nga.GeneralizedAlpha())
    yield "Moreau", published, own(body, every, nga.MoreauJean())
    for peer in PEERS:
        if not peer.version():
            print(f"{peer.name} is not installed, and is left out", file=sys.stderr)
            continue
        parameters, run = best_of(peer, all_tosses, body, every)
        words = ", ".join(f"{name} = {value:g}" for name, value in parameters.items())
        yield f"{peer.name} {peer.version()}", words, run


def row(name: str, rate: float, scores: list[Score], words: str) -> str:
    """A line of the table."""
    path, angle = np.median([s.path for s in scores]), np.median([s.angle for s in scores])
    faces, depth = sum(s.face for s in scores), max(s.depth for s in scores)
    ms = 1e3 * np.median([s.seconds for s in scores])
    cells = (name, f"{rate:g}", f"{1e3 * path:.2f}", f"{angle:.2f}", f"{faces} of {len(scores)}", f"{1e3 * depth:.2g}")
    return "| " + " | ".join((*cells, f"{ms:.3g}", words)) + " |"


def draw(scores: dict[str, list[Score]], path: Path) -> None:
    """Which part of the tosses is within an error."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), sharey=True)
    for name, found in scores.items():
        share = np.arange(1, len(found) + 1) / len(found)
        own_line = name == "this method"
        style = {"color": "black", "linewidth": 2.2, "zorder": 5} if own_line else {"linewidth": 1.3}
        axes[0].plot(np.sort([1e3 * s.path for s in found]), share, label=name, **style)
        axes[1].plot(np.sort([s.angle for s in found]), share, label=name, **style)
    axes[0].set(xlabel="mean distance from the record [mm]", ylabel="share of the tosses", xlim=(0, 60), ylim=(0, 1))
    axes[1].set(xlabel="mean angle from the record [degrees]", xlim=(0, 90))
    axes[1].legend(frameon=False, loc="lower right")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, nargs="?", default=DATA, help="tosses.npz, or the folder that has it")
    parser.add_argument("--tosses", type=int, metavar="N", help="by default all")
    parser.add_argument("--rates", type=float, nargs="+", metavar="HZ", help="multiples of the recorded rate, its own")
    parser.add_argument("--figure", type=Path, metavar="PATH", help="draw the errors at the first rate")
    add_table_option(parser)
    options = parser.parse_args()
    if not options.data.exists():
        parser.error(f"there is no {options.data}; docs/real_cube.md says where the tosses come from")
    found, body = tosses(options.data, options.tosses)
    table = [
        "| | steps a second | path [mm] | rotation [deg] | resting face | deepest [mm] | a toss takes [ms] | given |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    rates = options.rates or [body["rate"]]
    for rate in rates:
        scores = {}
        for name, words, run in lines_of(found, body, rate):
            scores[name] = [scored(run, toss, body["edge"]) for toss in found]
            table.append(row(name, rate, scores[name], words))
            print(table[-1], file=sys.stderr, flush=True)
        if options.figure and rate == rates[0]:
            draw(scores, options.figure)
    publish(table, options.table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
