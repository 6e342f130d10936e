"""The command `ngalpha-pin`: run a system, replay a saved run, tell what a scene computes, look at the installation.

Nothing but the standard library is imported before a subcommand needs it, so that `doctor` also works where an import
fails; `python main.py doctor` then goes round the package altogether.
"""

from __future__ import annotations

import argparse
import os
import secrets
import shutil
import signal
import sys
import tempfile
import textwrap
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if __package__:
    from ngalpha_pin.cli.defaults import DEFAULTS, Defaults
    from ngalpha_pin.cli.options import of_replay, of_report, of_run, of_scene, of_stability, of_sweep
    from ngalpha_pin.cli.parser import Parser, Version
else:  # as a script it finds its neighbours without the package
    from defaults import DEFAULTS, Defaults  # type: ignore[import-not-found,no-redef]
    from options import (  # type: ignore[import-not-found,no-redef]
        of_replay,
        of_report,
        of_run,
        of_scene,
        of_stability,
        of_sweep,
    )
    from parser import Parser, Version  # type: ignore[import-not-found,no-redef]

if TYPE_CHECKING:
    import numpy as np

    from ngalpha_pin import Scene, Trajectory
    from ngalpha_pin.integrators.method import Method


def main(argv: list[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: arguments without the name of the program; None takes those of the process.

    Returns:
        Exit code: 0 success, 1 a run that ended early or an installation with problems, 2 an input that cannot be used.
    """
    try:
        return _main(sys.argv[1:] if argv is None else argv)
    except BrokenPipeError:  # whoever read the output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


def _main(argv: list[str]) -> int:
    parser = _parser()
    if not argv:
        parser.print_help(sys.stderr)
        return 2
    args, unknown = parser.parse_known_args(argv)
    if unknown:
        args.parser.error_of(unknown)
    if args.command is doctor:
        return doctor(args)  # where nothing of the package can be imported
    from ngalpha_pin.errors import NgalphaError

    try:
        with _terminable(), warnings.catch_warnings():
            warnings.showwarning = _show_warning
            return args.command(args)
    except KeyboardInterrupt as error:
        print(f"ngalpha-pin: {_stopped(error)}", file=sys.stderr)
        return _stopped(error).code
    except BrokenPipeError:
        raise
    except (NgalphaError, OSError) as error:
        print(f"ngalpha-pin: {' '.join(str(error).split())}", file=sys.stderr)
        return 2


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"ngalpha-pin: warning: {' '.join(str(message).split())}", file=sys.stderr)


class Stop(NamedTuple):
    """What ends a command from outside: a word and the exit code of the shell for it."""

    word: str
    code: int

    def __str__(self) -> str:
        return self.word


class Terminated(KeyboardInterrupt):
    """SIGTERM, which ends a command as Ctrl-C does: what there is gets written."""


def _stopped(error: KeyboardInterrupt) -> Stop:
    """Whether it was Ctrl-C or SIGTERM; a run passes it on as the cause of its own."""
    return Stop("terminated", 143) if isinstance(error.__cause__ or error, Terminated) else Stop("interrupted", 130)


@contextmanager
def _terminable() -> Iterator[None]:
    """SIGTERM is a `Terminated` within this, where the main thread may say so."""

    def stop(*_: object) -> None:
        raise Terminated

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _parser() -> Parser:
    parser = Parser(
        prog="ngalpha-pin", description="Rigid frictional contact for Pinocchio models, with an audit of every run."
    )
    parser.set_defaults(parser=parser)
    parser.add_argument("--version", action=Version, nargs=0, help="tell the version")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    of_run(_command(commands, run, "run", "simulate a system or a URDF file and print the audit"))
    of_replay(_command(commands, replay, "replay", "show trajectories that run --out has written"))
    of_scene(_command(commands, info, "info", "tell what a scene is, what is computed and what is left out"))
    what = "error against run time of every method, orders in words, audit of a run"
    of_report(_command(commands, report, "report", what))
    what = "run a target over a grid of parameters, on all cores or on a cluster"
    of_sweep(_command(commands, sweep, "sweep", what))
    what = "a table of stiff and extreme cases, or of a scene of one's own with other steps and damping"
    of_stability(_command(commands, stability, "stability", what))
    _command(commands, doctor, "doctor", "look for what is wrong with the installation")
    return parser


def _command(
    commands: argparse._SubParsersAction, function: Callable[[argparse.Namespace], int], name: str, what: str
) -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.")
    parser.set_defaults(command=function, parser=parser)
    return parser


def _load(args: argparse.Namespace) -> tuple[Scene, np.ndarray, np.ndarray]:
    """The scene of a target, q0 and v0."""
    from ngalpha_pin.cli import targets as target

    return target.load(args.target, target.Options(**{name: getattr(args, name) for name in target.Options._fields}))


def run(args: argparse.Namespace) -> int:
    """Simulate, print the audit, write the files."""
    import ngalpha_pin as nga

    for path in (args.html, args.out):
        _check_writable(path)
    defaults = DEFAULTS.get(args.target, Defaults())
    method = _method(args, defaults)
    scene, q0, v0 = _load(args)
    if not scene.q_ref.size and args.floating is None and Path(args.target).is_file():
        expanded = " once xacro has expanded it" if args.target.endswith(".xacro") else ""
        raise nga.SceneError(f"{args.target} has no joint that moves and no link with a mass{expanded}: nothing moves")
    t_end = defaults.t_end if args.t_end is None else args.t_end
    dt = defaults.dt if args.dt is None else args.dt
    if args.live:
        from ngalpha_pin.viz import live

        if args.html or args.out or args.t_end is not None:
            raise nga.SceneError("--live runs until Ctrl-C and writes nothing: leave out --html, --out and --t-end")
        live(scene, q0, v0, dt, method=method)
        return 0
    begin = time.perf_counter()
    stopped: Stop | None = None
    try:
        trajectory = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=method, on_failure="stop", progress=True)
    except nga.Interrupted as error:
        trajectory, stopped = error.trajectory, _stopped(error)
    took = time.perf_counter() - begin
    steps = len(trajectory.t) - 1
    print(f"{scene.model.name}: {steps} steps of {dt:g} s in {took:.2f} s, {1e3 * took / max(steps, 1):.3f} ms each")
    print(f"{method}\n")
    print(trajectory.audit())
    print()
    code = 0 if trajectory.success else 1
    if stopped is not None:
        print(f"ngalpha-pin: {stopped} at t = {trajectory.t[-1]:g} s; this is what there was", file=sys.stderr)
        code = stopped.code
    elif code:
        print(f"ngalpha-pin: ended early, at t = {trajectory.t[-1]:g} s: {trajectory.message}", file=sys.stderr)
    _write(trajectory, args.out, args.html)  # last: where that fails, what has ended the run is said already
    return code


def _write(trajectory: Trajectory, out: Path | None, html: Path | None) -> None:
    """Write a run; one of which nothing can be written where it should be is kept among the temporary files."""
    from ngalpha_pin.errors import NotWritten

    kept: Path | None = None
    try:
        if out:
            trajectory.save(out)
            _say_written(out)
            kept = out
        if html:
            from ngalpha_pin.viz import save_html

            _say_written(save_html(trajectory, html))
    except NotWritten as error:
        if kept is None:
            kept = Path(tempfile.gettempdir()) / f"ngalpha-pin-{secrets.token_hex(4)}.npz"
            trajectory.save(kept)
        raise NotWritten(f"{error}; the run is in {kept}") from error


def _method(args: argparse.Namespace, defaults: Defaults) -> Method:
    import ngalpha_pin as nga

    if args.method == "moreau":
        if args.rho_inf is not None:
            raise nga.SceneError("--rho-inf belongs to generalized-alpha, moreau has no such parameter")
        return nga.MoreauJean(theta=0.5)
    return nga.GeneralizedAlpha(rho_inf=defaults.rho_inf if args.rho_inf is None else args.rho_inf)


def _check_writable(path: Path | None) -> None:
    """Find out before the run that its result cannot be written."""
    if path is None:
        return
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a folder, give the name of a file")
    if not path.absolute().parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {path.parent}")
    if not os.access(path.absolute().parent, os.W_OK):
        raise PermissionError(f"{path}: files cannot be written to the folder {path.parent}")


def _say_written(path: Path) -> None:
    print(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB)")


def replay(args: argparse.Namespace) -> int:
    """Show saved trajectories."""
    from ngalpha_pin import SceneError, Trajectory
    from ngalpha_pin.viz import play, save_html, save_video

    if args.html and args.speed is not None:
        raise SceneError("--speed goes with --serve and --video; the page that --html writes has a control for it")
    if args.loop and not args.serve:
        raise SceneError("--loop goes with --serve")
    if args.address is not None and not args.serve:
        raise SceneError("--address goes with --serve")
    if args.serve and len(args.files) > 1:
        raise SceneError("--serve plays one trajectory; several are shown by --html and --video")
    speed = 1.0 if args.speed is None else args.speed
    for path in (args.html, args.video):
        _check_writable(path)
    trajectories = [Trajectory.load(path) for path in args.files]
    labels = [path.stem for path in args.files]
    if args.html:
        _say_written(save_html(trajectories, args.html, labels=labels))
        return 0
    if args.video:
        _say_written(save_video(trajectories, args.video, speed=speed, labels=labels))
        return 0
    play(trajectories[0], speed=speed, loop=args.loop, **({} if args.address is None else {"address": args.address}))
    if sys.stdin.isatty():
        input("end of the run; press Enter to close the viewer ")
    return 0


def info(args: argparse.Namespace) -> int:
    """Print what a scene is, what is computed for it and what is left out."""
    from ngalpha_pin.cli.info import file_tables, tables

    dt = DEFAULTS.get(args.target, Defaults()).dt
    scene, q0, v0 = _load(args)
    found = file_tables(scene) | tables(scene, q0, v0, dt)
    wide = max(36, *(len(name) + 2 for rows in found.values() for name, _ in rows))
    room = shutil.get_terminal_size().columns - wide - 2 if sys.stdout.isatty() else 0
    for title, rows in found.items():
        print(title)
        for name, value in rows:
            lines = textwrap.wrap(value, room) if room > 20 else [value]
            print(f"  {name:<{wide}}{f'{os.linesep}{chr(32) * (wide + 2)}'.join(lines)}")
    return 0


def report(args: argparse.Namespace) -> int:
    """Write the report of a target or of the systems of the paper, or the audit page of a trajectory."""
    from ngalpha_pin.report import command

    return command.run(args, None if args.target is None else lambda: _load(args))


def sweep(args: argparse.Namespace) -> int:
    """Run a target over a grid of parameters."""
    from ngalpha_pin.cli import grid as command

    _check_writable(args.out)
    return command.run(args, DEFAULTS.get(args.target, Defaults())._asdict())


def stability(args: argparse.Namespace) -> int:
    """Print the table of stiff and extreme cases."""
    from ngalpha_pin.cli import targets as target
    from ngalpha_pin.report.stability import command

    if args.target is None:
        return command.run(args, None)
    options = target.Options(**{name: getattr(args, name) for name in target.Options._fields})
    defaults = DEFAULTS.get(args.target, Defaults())
    args.dt = defaults.dt if args.dt is None else args.dt
    return command.run(args, partial(target.load, args.target, options))


def doctor(args: argparse.Namespace) -> int:
    """Look at the installation; as a script this file finds its neighbour without the package."""
    return import_module("ngalpha_pin.cli.doctor" if __package__ else "doctor").doctor()


if __name__ == "__main__":
    sys.exit(main())
