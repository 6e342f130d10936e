"""Drops of ANYmal on a dask cluster of this machine, one worker of which is killed on the way.

    python benchmarks/sweep.py --runs 200 --workers 2

Prints whether all runs are there, whether their bits are those of runs one after the other, and how the time compares
with that of the runs alone, divided by the number of workers.
"""

from __future__ import annotations

import argparse
import os
import signal
import tempfile
import time
from pathlib import Path

import numpy as np

import ngalpha_pin as nga
from ngalpha_pin import robots


def robot() -> tuple[nga.Scene, np.ndarray]:
    """ANYmal above the ground, made once per worker."""
    scene, q0, _ = robots.load("anymal", height=0.2)
    return scene, q0


def drop(start: tuple[nga.Scene, np.ndarray], seed: int, folder: str) -> dict[str, object]:
    """A fall with a spin by chance; that of one seed is killed at its first try, where a folder is given."""
    scene, q0 = start
    v0 = np.zeros(scene.model.nv)
    v0[:6] = np.random.default_rng(seed).normal(size=6)
    if folder and seed == 7 and not (Path(folder) / "killed").exists():
        (Path(folder) / "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    run = nga.simulate(scene, q0, v0, t_end=0.6, dt=2e-3, on_failure="stop")
    return {"q": run.q[-1], "v": run.v[-1], "impacts": len(run.impacts.t), "end": run.message}


def main() -> None:
    """Sweep, then run one after the other, and compare."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    from dask.distributed import Client, LocalCluster

    grid = {"scene": robot, "seed": range(options.runs)}
    with (
        tempfile.TemporaryDirectory() as folder,
        LocalCluster(n_workers=options.workers, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        begin = time.perf_counter()
        found = nga.sweep(drop, executor=client.get_executor(), folder=folder, **grid)
        took = time.perf_counter() - begin
        killed = (Path(folder) / "killed").exists()
    begin = time.perf_counter()
    serial = nga.sweep(drop, executor=0, folder="", **grid)
    alone = time.perf_counter() - begin
    numbers = found.drop_vars(["seconds", "folder"]).identical(serial.drop_vars(["seconds", "folder"]))
    print(f"{options.runs} drops on {options.workers} workers, one killed: {killed}")
    print(f"without a result: {int((found['error'] != '').sum())}; same bits as one after the other: {numbers}")
    print(f"{took:.1f} s; one after the other {alone:.1f} s, of which the runs {float(serial['seconds'].sum()):.1f} s")
    print(f"time / (runs alone / workers) = {took * options.workers / float(serial['seconds'].sum()):.2f}")


if __name__ == "__main__":
    main()
