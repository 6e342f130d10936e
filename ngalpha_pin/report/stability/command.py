"""What `ngalpha-pin stability` does: runs the cases, prints the table, writes it as Markdown."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import as_completed
from pathlib import Path

from tqdm import tqdm

import ngalpha_pin
from ngalpha_pin.common import checks
from ngalpha_pin.common.files import write_text
from ngalpha_pin.errors import SceneError
from ngalpha_pin.simulation.sweeps.processes import Processes, WorkerLost

from . import cases, made
from .own import T_END, Loader, own_cases
from .row import Case, Row, not_run

HEADER = (
    "case",
    "result",
    "rise of energy",
    "drift",
    "penetration [m]",
    "outside cone",
    "iterations",
    "solved by",
    "found",
)
CHANGES = ("floating", "ground", "height", "mu", "q0", "v0")
ABOUT = (
    "Every row is a run, judged by the audit and by what is known of the motion. The rise of the energy and friction "
    "outside its cone are relative, iterations are mean / worst per step; of the long runs, looked at a thousand "
    "times, the error of the invariants stands in place of the rise of the energy. A row that fails says why and "
    "what bounds it, with more of it below; none is left out. Made by "
    "`ngalpha-pin stability{options} --out {out}`"
)
NOTES = """
## What bounds it

**Steps.** A spinning ball is followed from dt = 1e-6 to 0.2 s; its error at the end of a step stays below dt^2 / 2. The
quadruped lands and stands up to dt = 0.2 s. From 0.25 s on the free fall of one step, g dt^2 / 2 = 0.3 m, is as long as
its legs: what the equations say at the end of the step has nothing to do with the landing, and energy comes in. The
free fall in a step has to stay within the size of what lands, dt < sqrt(2 l / g).

**Springs that a step does not resolve**, omega dt > 1. The method turns the acceleration a of such a mode into a
velocity ((1 - rho_inf) / 2)^2 dt a, and the short rest of a step behind an impact leaves a = omega v. The next step
would start with ((1 - rho_inf) / 2)^2 omega dt times the velocity of the impact. Where that factor is above a tenth,
a step that is longer than the one before starts from accelerations averaged over it instead, with M + gamma_c D +
beta_c K for M, so that the energy does not rise. Nothing is changed of what is resolved, or with rho_inf = 1.

**Chain on the ground.** Where many contacts close within a step they are captured at its end instead of one by one at
their moments. Such a step is of first order, and so is its rise of the energy: it halves with dt. The impact leaves
links that turn by 1000 rad/s, a radian in a step of 1e-3 s. Such a motion is not resolved: with rho_inf = 0.5 and 0.9
the method damps it, with 0 and 0.2 its energy grows from step to step until no step converges. With half the step,
half a radian, all of them reach their end; with rho_inf = 0 the energy still rises by some hundredths there, and with
both the work of the forces does not explain some tenths of it.

**Energy of a closed loop.** A step loses about (omega dt)^3 / 70 of the kinetic energy of the four-bar, also with
rho_inf = 1: the method is of second order, and with constraints it does not keep the energy. So the loss grows with the
number of steps, and falls with dt^2 in a given time. The constraint itself does not drift.

**Momentum of a free body that turns.** The velocity of a free flyer is held in the axes of the body, so that the
direction of the momentum is integrated. It turns by (omega dt)^2 / 12 of the angle by which the body turns. Its size,
the angular momentum and the energy do not drift.

**Dependent constraints.** Directions that depend on each other get the smallest change of the forces. A driven
mechanism whose step ends in a singular position, to about 1e-8 of its lengths, has no solution where the load needs an
infinite force there; another dt passes it.
"""


def run(args: argparse.Namespace, load: Loader | None) -> int:
    """Run the cases; exit code 0 all passed, 1 a row failed, 130 interrupted (with the rows so far).

    Args:
        args: options of the command line.
        load: builds a scene of the user's own; None is the table of the package.
    """
    chosen = _chosen(args, load)
    found: dict[str, Row] = {}
    interrupted, began = False, time.perf_counter()
    try:
        for row in tqdm(_made(chosen), total=len(chosen), unit="case", leave=False):
            found[row.case] = row
            _print(row)
    except KeyboardInterrupt:
        interrupted = True
    rows = [found[case.name] for case in chosen if case.name in found]
    failed = sum(not row.passed for row in rows)
    print(f"{len(rows)} cases, {failed} failed")
    if args.out is not None:
        write(args.out, rows, args.quick, time.perf_counter() - began, None if load is None else args.target)
        print(f"wrote {args.out}")
    if interrupted:
        print("ngalpha-pin: interrupted", file=sys.stderr)
        return 130
    return int(failed > 0)


def _chosen(args: argparse.Namespace, load: Loader | None) -> list[Case]:
    if load is None:
        given = [name for name in (*CHANGES, "t_end", "dt") if getattr(args, name) not in (None, False)]
        if given:
            raise SceneError(f"--{given[0].replace('_', '-')} is for a scene of your own: name it")
        chosen = list(cases(args.quick, args.only))
        if not chosen:
            raise SceneError(f"no case has {args.only!r} in its name")
        return chosen
    load()  # what is wrong with it is said once
    t_end = T_END if args.t_end is None else args.t_end
    checks.number("--t-end", t_end, 0.0, above=True)
    checks.number("--dt", args.dt, 0.0, above=True)
    own = own_cases(Path(args.target).stem if Path(args.target).is_file() else args.target, load, t_end, args.dt)
    chosen = [case for case in own if args.only in case.name and not (args.quick and case.long)]
    if not chosen:
        raise SceneError(f"no case of {args.target} is left with these options")
    return chosen


def _made(chosen: list[Case]) -> Iterator[Row]:
    """Rows as they get ready, each core at one of them, those that take long first."""
    order = sorted(chosen, key=lambda case: not case.long)
    n = min(len(order), os.cpu_count() or 1)
    if n == 1:
        yield from map(made, order)
        return
    with Processes(n) as pool:
        waiting = {pool.submit(made, case): case for case in order}
        for done in as_completed(waiting):
            lost = isinstance(done.exception(), WorkerLost)
            yield not_run(waiting[done], "the process of this case was ended") if lost else done.result()


def _print(row: Row) -> None:
    tqdm.write(f"{'ok    ' if row.passed else 'FAILED'}  {row.case}: {row.reason}")


def write(path: Path, rows: list[Row], quick: bool, seconds: float, target: str | None = None) -> None:
    """Write the table as Markdown.

    Args:
        path: of the file.
        rows: of the table.
        quick: the cases that take long are left out.
        seconds: time that they took.
        target: scene of the user's own that the rows are of; None is the table of the package.
    """
    options = (f" {target}" if target else "") + (" --quick" if quick else "")
    about = ABOUT.format(options=options, out=path if target else "docs/stability.md")
    lines = [
        f"# {target} with other steps and damping" if target else "# Stiff and extreme cases",
        "",
        f"{about} (version {ngalpha_pin.__version__}).",
        "",
    ]
    lines += [_line(HEADER), _line(["---"] * len(HEADER))]
    for row in rows:
        case, *numbers, passed, reason = row
        lines.append(_line([case, "pass" if passed else "**fail**", *map(str, numbers), reason]))
    failed = sum(not row.passed for row in rows)
    took = f"{seconds / 60:.0f} minutes on {os.cpu_count()} cores"
    counted = f"{len(rows)} cases, {len(rows) - failed} pass, {failed} fail; {took}."
    lines += ["", counted, "" if target else NOTES]
    write_text(path, "\n".join(lines))


def _line(cells: tuple[str, ...] | list[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
