"""Random scenes, thousands of them: what became of each, as a table, and a small script of every kind of failure.

    python benchmarks/fuzz.py --seeds 10000 --processes 2 --scripts out_fuzz

Each scene is made from its number (`ngalpha_pin.report.stability.random_scenes`), runs 100 steps in one second of
processor time, and is judged: energy that rises, an audit that finds fault, no convergence, no end, an error that is
none of the package. One that ends the interpreter is a crash. With --scripts the first failures of each kind are made
smaller, with fewer bodies, walls, speeds, as long as they fail alike, and written as programs.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

from tables import add_table_option, publish

from ngalpha_pin.common.files import write_text
from ngalpha_pin.report.stability.random_scenes import Outcome, outcome, random_recipe, script, shrunk

BLOCK = 50  # seeds in one process
CRASH = Outcome("crash", False, "the interpreter ended", 0.0)
FAILURES = ("crash", "raw error", "energy rises", "audit", "not converged", "unfinished")
CONTEXT = get_context("spawn")
KEPT = 3  # scripts of each kind


def one(seed: int) -> Outcome:
    """What becomes of the scene of a number."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return outcome(random_recipe(seed))


def block(seeds: list[int]) -> list[tuple[int, Outcome]]:
    """Several of them in one process."""
    return [(seed, one(seed)) for seed in seeds]


def all_of(seeds: range, processes: int) -> Iterator[tuple[int, Outcome]]:
    """Every seed with its outcome."""
    blocks, lost = [list(seeds[i : i + BLOCK]) for i in range(0, len(seeds), BLOCK)], []
    with ProcessPoolExecutor(processes, CONTEXT) as pool:
        for part, future in [(part, pool.submit(block, part)) for part in blocks]:
            try:
                yield from future.result()
            except BrokenProcessPool:  # so are all behind the one that has crashed
                lost.append(part)
    for part in lost:
        yield from in_own_process(part)


def in_own_process(seeds: list[int]) -> list[tuple[int, Outcome]]:
    """Some of them in a process of their own; where it crashes, each in one."""
    with ProcessPoolExecutor(1, CONTEXT) as pool:
        try:
            return pool.submit(block, seeds).result()
        except BrokenProcessPool:
            if len(seeds) == 1:
                return [(seeds[0], CRASH)]
    return [found for seed in seeds for found in in_own_process([seed])]


def table(found: dict[int, Outcome]) -> list[str]:
    """The table of what became of the scenes."""
    counts = Counter(o.verdict for o in found.values())
    silent = sum(o.verdict == "energy rises" and o.audit_ok for o in found.values())
    lines = ["| what | scenes | part | the first of them |", "| --- | --- | --- | --- |"]
    for verdict in ("well", *FAILURES, "refused"):
        seeds = [seed for seed, o in found.items() if o.verdict == verdict]
        listed = ", ".join(map(str, seeds[:5])) if verdict != "well" else ""
        lines.append(f"| {verdict} | {counts[verdict]} | {100 * counts[verdict] / len(found):.2f} % | {listed} |")
    lines.append(f"| energy rises and the audit is content | {silent} | {100 * silent / len(found):.2f} % | |")
    return lines


def main() -> int:
    """Run the scenes; exit code 1 where one crashed or raised an error that is none of the package."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1000, metavar="N", help="number of scenes (1000)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="number of the first one (0)")
    parser.add_argument("--processes", type=int, default=1, metavar="N")
    parser.add_argument("--scripts", type=Path, metavar="FOLDER", help="write small scripts of failures there")
    add_table_option(parser)
    args = parser.parse_args()
    found: dict[int, Outcome] = {}
    for seed, result in all_of(range(args.first, args.first + args.seeds), args.processes):
        found[seed] = result
        if result.verdict in FAILURES:
            print(f"{seed}: {result.verdict} {result.said}"[:200], file=sys.stderr, flush=True)
    publish(table(found), args.table)
    if args.scripts is not None:
        args.scripts.mkdir(parents=True, exist_ok=True)
        for verdict in FAILURES[1:]:
            for seed in [seed for seed, o in found.items() if o.verdict == verdict][:KEPT]:
                small = shrunk(random_recipe(seed), verdict)
                write_text(args.scripts / f"{verdict.replace(' ', '_')}_{seed}.py", script(small))
    return int(any(o.verdict in ("crash", "raw error") for o in found.values()))


if __name__ == "__main__":
    sys.exit(main())
