"""What can be said to each command; nothing but the standard library is imported before a command needs it."""

from __future__ import annotations

import argparse
from pathlib import Path

if __package__:
    from ngalpha_pin.cli.defaults import DEFAULTS
    from ngalpha_pin.cli.parser import numbers
else:  # as a script `main` finds its neighbours without the package
    from defaults import DEFAULTS  # type: ignore[import-not-found,no-redef]
    from parser import numbers  # type: ignore[import-not-found,no-redef]


def of_run(p: argparse.ArgumentParser) -> None:
    """One run: its scene, its steps, what is written."""
    of_scene(p)
    p.add_argument("--t-end", type=float, metavar="S", help="end of the run; systems bring their own, else 2 s")
    p.add_argument("--dt", type=float, metavar="S", help="step; systems bring their own, else 1e-3 s")
    p.add_argument("--method", choices=("generalized-alpha", "moreau"), default="generalized-alpha")
    p.add_argument("--rho-inf", type=float, metavar="RHO", help="damping of generalized-alpha: 1 none, 0 most (0.5)")
    p.add_argument("--html", type=Path, metavar="FILE", help="write a replay that any browser opens")
    p.add_argument("--out", type=Path, metavar="FILE", help="write the trajectory (.npz), to replay or to load")
    live = "simulate in a browser window where bodies are dragged and joints are moved (extra live), until Ctrl-C"
    p.add_argument("--live", action="store_true", help=live)


def of_replay(p: argparse.ArgumentParser) -> None:
    """Runs that have been saved, and how they are shown."""
    several = "trajectory (.npz); several are shown in one scene, the others as ghosts of the first"
    p.add_argument("files", type=Path, nargs="+", metavar="FILE", help=several)
    how = p.add_mutually_exclusive_group(required=True)
    how.add_argument("--html", type=Path, metavar="OUT", help="write a replay that any browser opens")
    how.add_argument("--video", type=Path, metavar="OUT", help="film it (.mp4 or .gif)")
    how.add_argument("--serve", action="store_true", help="play it in a browser window of this machine")
    where = "--serve: the address to listen at (127.0.0.1, this machine alone); 0.0.0.0 opens it to the network"
    p.add_argument("--address", metavar="IP", help=where)
    p.add_argument("--speed", type=float, metavar="X", help="simulated seconds per second (1), without --html")
    p.add_argument("--loop", action="store_true", help="--serve: start again at the end")


def of_report(p: argparse.ArgumentParser) -> None:
    """The systems, steps and values of rho_inf that are compared."""
    of_scene(p, "paper: its six systems; these and others by default")
    p.add_argument("--out", type=Path, default=Path("out_report"), metavar="FOLDER", help="written to (out_report)")
    p.add_argument("--quick", action="store_true", help="the three coarsest steps of each system, in under a minute")
    p.add_argument("--t-end", type=float, metavar="S", help="end of the run")
    p.add_argument("--dt", type=numbers, metavar="S,S,...", help="steps, each a multiple of the smallest")
    p.add_argument("--rho-inf", type=numbers, default=(), metavar="RHO,...", help="one line for each value")
    p.add_argument("--repeat", type=int, default=5, metavar="N", help="runs of which the median time is taken (5)")
    what = "against a motion of your own: a trajectory (.npz), or CSV with the columns t and one for every joint"
    p.add_argument("--compare", type=Path, metavar="FILE", help=what)
    p.add_argument(
        "--audit", type=Path, metavar="FILE", help="only the audit page of a trajectory (.npz); TARGET: its forces"
    )


def of_sweep(p: argparse.ArgumentParser) -> None:
    """The grid of parameters, and what runs it."""
    of_scene(p)
    grid = (
        "parameters: mu=0.1:1:10 (ten from 0.1 to 1), e_N=0,0.5; mu, e_N and e_F of all contacts, t_end, dt, rho_inf, "
    )
    grid += "and those of the target: of a system, or of a function that returns (scene, q0, v0)"
    p.add_argument("--grid", nargs="+", required=True, metavar="NAME=VALUES", help=grid)
    p.add_argument("--t-end", type=float, metavar="S", help="end of the run; systems bring their own, else 2 s")
    p.add_argument("--dt", type=float, metavar="S", help="step; systems bring their own, else 1e-3 s")
    where = "address of a dask scheduler, tcp://HOST:PORT; by default processes of this machine"
    p.add_argument("--scheduler", metavar="ADDRESS", help=where)
    p.add_argument("--processes", type=int, metavar="N", help="of this machine; by default one for each core")
    out = "write the results: .nc, from which the same command goes on, or .csv, a line for each run"
    p.add_argument("--out", type=Path, metavar="FILE", help=out)


def of_stability(p: argparse.ArgumentParser) -> None:
    """The cases, or a scene of one's own."""
    of_scene(p, "a scene to try with other steps and damping; the table of the package by default")
    p.add_argument("--t-end", type=float, metavar="S", help="TARGET: end of the runs (0.5 s)")
    p.add_argument("--dt", type=float, metavar="S", help="TARGET: the middle one of the steps")
    p.add_argument("--quick", action="store_true", help="leave out what takes minutes")
    p.add_argument("--only", default="", metavar="WORD", help="the cases whose name contains it")
    p.add_argument("--out", type=Path, metavar="FILE", help="write the table as Markdown")


def of_scene(parser: argparse.ArgumentParser, optional: str = "") -> None:
    """The target and what can be said beside it; where it is optional, what it means there."""
    what = f"a URDF or MJCF file, module:function or file.py:function, or one of {', '.join(DEFAULTS)}"
    what += f"; {optional}" if optional else ""
    parser.add_argument("target", metavar="TARGET", nargs="?" if optional else None, help=what)
    either = argparse.BooleanOptionalAction
    free = "URDF: the root moves freely; by default where an SRDF beside the file says so"
    parser.add_argument("--floating", action=either, help=free)
    plane = "file: add the plane z = 0, which every body can touch; by default for a root that moves freely"
    parser.add_argument("--ground", action=either, help=plane)
    start = "height at the start; URDF: of the lowest point, with --floating (0.1 m)"
    parser.add_argument("--height", type=float, metavar="H", help=start)
    parser.add_argument("--mu", type=float, help="friction coefficient (URDF: 0.8)")
    what = "numbers with commas between them, or a file of numbers (.npy, text)"
    parser.add_argument("--q0", metavar="Q", help=f"initial configuration: {what}")
    parser.add_argument("--v0", metavar="V", help="initial velocity, likewise")
