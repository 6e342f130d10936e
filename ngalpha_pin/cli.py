"""The command `ngalpha-pin`: run a system, replay a saved run, tell what a scene computes, look at the installation.

Nothing but the standard library is imported before a subcommand needs it, so that `doctor` also works where an import
fails; `python cli.py doctor` then goes round the package altogether.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np

    from ngalpha_pin import Scene
    from ngalpha_pin.simulate import Method
    from ngalpha_pin.system import System


class Defaults(NamedTuple):
    """How a system is run unless the options say otherwise.

    Attributes:
        t_end: end of the run [s].
        dt: step [s].
        rho_inf: parameter of the generalized-alpha method [-].
    """

    t_end: float = 2.0
    dt: float = 1e-3
    rho_inf: float = 0.5


# those of the paper where there is one, else long enough to come to rest
DEFAULTS = {
    "anymal": Defaults(1.5, 2e-3),
    "arm": Defaults(3.0, 1e-3, 0.9),
    "ball_in_corner": Defaults(2.0, 1e-3),
    "ball_in_cylinder": Defaults(6.0, 1e-2),
    "go2": Defaults(1.5, 2e-3),
    "painleve_rod": Defaults(1.2, 8e-4, 0.9),
    "quadruped": Defaults(1.5, 2e-3),
    "rotating_ball": Defaults(1.5, 2e-3),
    "solo12": Defaults(1.5, 1e-3),
    "tippe_top": Defaults(8.0, 1e-3),
}
MU = 0.8
UNBOUNDED = 1e10  # a limit beyond this is none [rad or m]
HEIGHT = 0.1  # of a URDF that is dropped on the ground [m]


def main(argv: list[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: arguments without the name of the program; None takes those of the process.

    Returns:
        Exit code: 0 success, 1 a run that ended early or an installation with problems, 2 an input that cannot be used.
    """
    args = _parser().parse_args(argv)
    if args.command is doctor:
        return doctor(args)
    from ngalpha_pin.errors import NgalphaError

    try:
        return args.command(args)
    except KeyboardInterrupt:
        print("ngalpha-pin: interrupted", file=sys.stderr)
        return 130
    except (NgalphaError, OSError) as error:
        print(f"ngalpha-pin: {' '.join(str(error).split())}", file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ngalpha-pin", description="Rigid frictional contact for Pinocchio models, with an audit of every run."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    p = _command(commands, run, "run", "simulate a system or a URDF file and print the audit")
    _add_scene_options(p)
    p.add_argument("--t-end", type=float, metavar="S", help="end of the run; systems bring their own, else 2 s")
    p.add_argument("--dt", type=float, metavar="S", help="step; systems bring their own, else 1e-3 s")
    p.add_argument("--method", choices=("generalized-alpha", "moreau"), default="generalized-alpha")
    p.add_argument("--rho-inf", type=float, metavar="RHO", help="damping of generalized-alpha: 1 none, 0 most (0.5)")
    p.add_argument("--html", type=Path, metavar="FILE", help="write a replay that any browser opens")
    p.add_argument("--out", type=Path, metavar="FILE", help="write the trajectory (.npz), to replay or to load")

    p = _command(commands, replay, "replay", "show trajectories that run --out has written")
    several = "trajectory (.npz); several are shown in one scene, the others as ghosts of the first"
    p.add_argument("files", type=Path, nargs="+", metavar="FILE", help=several)
    how = p.add_mutually_exclusive_group(required=True)
    how.add_argument("--html", type=Path, metavar="OUT", help="write a replay that any browser opens")
    how.add_argument("--video", type=Path, metavar="OUT", help="film it (.mp4 or .gif)")
    how.add_argument("--serve", action="store_true", help="play it in a browser window of this machine")
    p.add_argument("--speed", type=float, metavar="X", help="simulated seconds per second (1), without --html")
    p.add_argument("--loop", action="store_true", help="--serve: start again at the end")

    _add_scene_options(_command(commands, info, "info", "tell what a scene is, what is computed and what is left out"))
    _command(commands, doctor, "doctor", "look for what is wrong with the installation")
    return parser


def _command(
    commands: argparse._SubParsersAction, function: Callable[[argparse.Namespace], int], name: str, what: str
) -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.")
    parser.set_defaults(command=function)
    return parser


def _add_scene_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("target", metavar="TARGET", help=f"a URDF file, or one of {', '.join(DEFAULTS)}")
    parser.add_argument("--floating", action="store_true", help="URDF: the root moves freely (free flyer)")
    parser.add_argument("--ground", action="store_true", help="URDF: add the plane z = 0, which every body can touch")
    start = f"height at the start; URDF: of the lowest point, with --floating ({HEIGHT} m)"
    parser.add_argument("--height", type=float, metavar="H", help=start)
    parser.add_argument("--mu", type=float, help=f"friction coefficient (URDF: {MU})")


def _load(args: argparse.Namespace) -> tuple[Scene, np.ndarray, np.ndarray]:
    """The scene of a target, q0 and v0."""
    from ngalpha_pin.errors import SceneError
    from ngalpha_pin.robots import load, names

    if args.target in names():
        if args.floating or args.ground:
            raise SceneError(f"--floating and --ground are for URDF files; {args.target} is complete as it is")
        given = {"height": args.height, "mu": args.mu}
        return load(args.target, **{name: value for name, value in given.items() if value is not None})
    if not Path(args.target).is_file():
        close = get_close_matches(args.target, names(), n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise SceneError(f"{args.target!r} is neither a file nor a system; {hint}systems: {', '.join(names())}")
    return _load_urdf(args)


def _load_urdf(args: argparse.Namespace) -> tuple[Scene, np.ndarray, np.ndarray]:
    import numpy as np
    import pinocchio as pin

    from ngalpha_pin import Scene
    from ngalpha_pin.errors import SceneError
    from ngalpha_pin.joints import within_limits
    from ngalpha_pin.robots._legged import lowest_point

    if args.mu is not None and not args.ground:
        raise SceneError("--mu needs --ground: without it there is no contact")
    if args.height is not None and not args.floating:
        raise SceneError("--height needs --floating: the root of the URDF is fixed to the world")
    scene = Scene.from_urdf(args.target, pin.JointModelFreeFlyer() if args.floating else None)
    q0 = within_limits(scene.model, pin.neutral(scene.model))
    if args.floating and (args.ground or args.height is not None):
        height = HEIGHT if args.height is None else args.height
        q0[2] += height - lowest_point(scene, q0, "*")
    if args.ground:
        _add_ground(scene, MU if args.mu is None else args.mu)
    return scene, q0, np.zeros(scene.model.nv)


def _add_ground(scene: Scene, mu: float) -> None:
    """Add the plane z = 0 and its contact with every geometry that moves; all shapes of URDF can touch it."""
    from ngalpha_pin import SceneError

    # names first: a geometry is not valid any longer once another one has been added
    moving = [g.name for g in scene.collision_model.geometryObjects if g.parentJoint > 0]
    if not moving:
        raise SceneError(f"--ground: {scene.model.name} has no collision geometry that moves")
    scene.add_plane("ground")
    for name in moving:
        scene.add_contact(name, "ground", mu=mu)


def run(args: argparse.Namespace) -> int:
    """Simulate, print the audit, write the files."""
    import ngalpha_pin as nga

    for path in (args.html, args.out):
        _check_writable(path)
    defaults = DEFAULTS.get(args.target, Defaults())
    method = _method(args, defaults)
    scene, q0, v0 = _load(args)
    t_end = defaults.t_end if args.t_end is None else args.t_end
    dt = defaults.dt if args.dt is None else args.dt
    begin = time.perf_counter()
    trajectory = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=method, on_failure="stop", progress=True)
    took = time.perf_counter() - begin
    steps = len(trajectory.t) - 1
    print(f"{scene.model.name}: {steps} steps of {dt:g} s in {took:.2f} s, {1e3 * took / max(steps, 1):.3f} ms each")
    print(f"{method}\n")
    print(trajectory.audit())
    print()
    if args.out:
        trajectory.save(args.out)
        _say_written(args.out)
    if args.html:
        from ngalpha_pin.viz import save_html

        _say_written(save_html(trajectory, args.html))
    if not trajectory.success:
        print(f"ngalpha-pin: ended early, at t = {trajectory.t[-1]:g} s: {trajectory.message}", file=sys.stderr)
        return 1
    return 0


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
    play(trajectories[0], speed=speed, loop=args.loop)
    if sys.stdin.isatty():
        input("end of the run; press Enter to close the viewer ")
    return 0


def info(args: argparse.Namespace) -> int:
    """Print what a scene is, what is computed for it and what is left out."""
    from ngalpha_pin.system import System

    scene, _, _ = _load(args)
    system = System(scene)
    tables = {"scene": _scene_rows(system), "every step": _step_rows(system), "left out": _absent_rows(system)}
    for title, rows in tables.items():
        print(title)
        for name, value in rows:
            print(f"  {name:<24}{value}")
    return 0


def _scene_rows(system: System) -> Iterator[tuple[str, str]]:
    scene, model, table = system.scene, system.model, system.contacts
    kinds = Counter(joint.shortname().removeprefix("JointModel") for joint in list(model.joints)[1:])
    yield "model", model.name
    yield "coordinates", f"nq = {model.nq}, nv = {model.nv}"
    yield "joints", ", ".join(f"{n} {kind}" for kind, n in kinds.items())
    yield "bodies", f"{sum(inertia.mass > 0 for inertia in list(model.inertias)[1:])} with mass"
    yield "mass", f"{sum(inertia.mass for inertia in model.inertias):.6g} kg"
    visual = 0 if scene.visual_model is None else scene.visual_model.ngeoms
    yield "geometries", f"{scene.collision_model.ngeoms} for contact, {visual} to draw"
    yield "contacts", f"{table.n} points of {len(scene.contacts)} pairs of geometries"
    forces = Counter(type(force).__name__ for force in system.scene.forces)
    yield "forces", ", ".join(f"{n} {kind}" for kind, n in forces.items()) or "none"


def _step_rows(system: System) -> Iterator[tuple[str, str]]:
    nv, table = system.model.nv, system.contacts
    yield "in flight", f"{nv} unknowns: the accelerations"
    if table.n:
        rows = [kind for kinds in table.row_kinds for kind in kinds]
        drilling = rows.count(2)
        tangential = len(rows) - drilling
        dropped = 2 * int((table.mu > 0).sum()) - tangential
        planar = f" ({dropped} dropped: the motion is planar)" if dropped else ""
        n = 3 * table.n + 2 * len(rows)
        yield "all contacts closed", f"{3 * nv + n} unknowns: a, U and Q, {nv} each, and {n} multipliers"
        yield "Newton matrix", f"at most {n} x {n}, for the multipliers alone"
        yield "normal rows", str(table.n)
        yield "friction rows", f"{tangential} tangential{planar}, {drilling} drilling"
    yield "evaluation calls", "pin.integrate, pin.computeRNEADerivatives"
    if not system.flat:
        yield "correction", "pin.dIntegrate"
    if table.n:
        yield "search for contact", "pin.forwardKinematics"
        yield "impact law", "pin.computeJointJacobiansTimeVariation"


def _absent_rows(system: System) -> Iterator[tuple[str, str]]:
    table, model = system.contacts, system.model
    if table.n == 0:
        yield "contact", "none is declared: no contact code runs"
    else:
        yield "open contacts", "those that cannot close within a step are not unknowns of it"
        if not (table.mu > 0).any():
            yield "friction", "mu = 0: no friction rows"
        elif not any(2 in row for row in table.row_kinds):
            yield "drilling friction", "contact_radius = 0"
        if not _restitutes(system):
            yield "restitution", "e_N = e_F = 0: no velocities at the start of a step without impact"
        if not table.curved.any():
            yield "curvature", "every surface is a plane"
    if not system.scene.forces:
        yield "forces", "none is declared"
    if system.flat:
        yield "pin.dIntegrate", "every coordinate is a plain number: it is the identity"
    bounded = (model.lowerPositionLimit > -UNBOUNDED) | (model.upperPositionLimit < UNBOUNDED)
    ignored = {
        "joint limits": sum(bounded[joint.idx_q] for joint in list(model.joints)[1:] if joint.nq == joint.nv == 1),
        "joint damping": (model.damping > 0).sum(),
        "joint dry friction": (model.upperDryFrictionLimit > 0).sum(),
    }
    for name, count in ignored.items():
        if count:
            yield name, f"of {count} coordinates in the model"


def _restitutes(system: System) -> bool:
    return bool(system.contacts.e_N.any() or system.contacts.e_F.any())


class Package(NamedTuple):
    """A package that is looked at: the module, what pip installs, and what needs it, empty where everything does."""

    module: str
    distribution: str
    optional: str = ""


PACKAGES = (
    Package("pinocchio", "pin"),
    Package("coal", "coal"),
    Package("numpy", "numpy"),
    Package("scipy", "scipy"),
    Package("tqdm", "tqdm"),
    Package("meshcat", "meshcat"),
    Package("matplotlib", "matplotlib", "plots need"),
    Package("example_robot_data", "example-robot-data-loaders", "anymal, go2 and solo12 need"),
)
# a process of its own for every import: one that crashes is a finding, not the end
IMPORT = """
import importlib, json, sys
sys.path[:] = json.loads(sys.argv[1])
module = importlib.import_module(sys.argv[2])
print(json.dumps([getattr(module, "__version__", None), getattr(module, "__file__", None)]))
"""
TOGETHER = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
import coal, numpy, pinocchio
pinocchio.GeometryObject("ball", 0, pinocchio.SE3.Identity(), coal.Sphere(1.0))
model = pinocchio.Model()
pinocchio.rnea(model, model.createData(), *[numpy.zeros(0)] * 3)
"""
KERNEL = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from ngalpha_pin import kernel
print(f"{'numpy' if kernel.library is None else 'compiled':<10}{kernel.origin}")
"""
ROS = "/opt/ros"
NEW_VENV = "start from a new virtual environment"


class Problem(NamedTuple):
    """What is wrong, and what to do about it."""

    what: str
    remedy: str


def doctor(args: argparse.Namespace) -> int:
    """Print versions and import paths, then what is wrong and what to do."""
    problems: list[Problem] = []
    print(f"{'python':<20}{sys.version.split()[0]:<10}{sys.executable}")
    probes = [(package, _start(IMPORT, package.module)) for package in PACKAGES]
    for package, process in probes:
        line, problem = _judge(package, *_finish(process))
        print(f"{package.module:<20}{line}")
        problems += problem
    problems = [*_shadows(), *problems]  # first what may explain the others
    if not problems:
        _, error = _finish(_start(TOGETHER))
        if error:
            problems.append(Problem(f"pinocchio and coal do not go together: {error}", _reinstall("pin coal numpy")))
        print(f"{'kernel':<20}{_finish(_start(KERNEL))[0]}")
    print()
    for what, remedy in problems:
        print(f"problem: {what}\n     do: {remedy}")
    print(f"{len(problems)} problem{'s' * (len(problems) != 1)} found" if problems else "nothing is wrong")
    return 1 if problems else 0


def _start(script: str, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", script, json.dumps(sys.path), *arguments]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True)


def _finish(process: subprocess.Popen[str]) -> tuple[str, str]:
    """Last line that a probe printed, and its error, empty where there was none."""
    out, err = process.communicate()
    if process.returncode < 0:
        return "", f"the interpreter was ended by signal {-process.returncode}"
    lines = err.strip().splitlines() or [f"exit code {process.returncode}"]
    return out.strip().rpartition("\n")[2], lines[-1] if process.returncode else ""


def _judge(package: Package, found: str, error: str) -> tuple[str, list[Problem]]:
    """What to print about a package, and what is wrong with it."""
    module, distribution, optional = package
    installed = _installed(distribution)
    if module == "pinocchio" and "nose" in _summary("pinocchio"):
        what = "pip has installed 'pinocchio', an unrelated plugin of the test runner nose; the library is called 'pin'"
        return "-         hidden", [Problem(what, f"pip uninstall -y pinocchio && {_reinstall('pin')}")]
    if error:
        missing = installed is None and f"No module named {module!r}" in error
        if missing and optional:
            return f"-         not installed; {optional} it: pip install {distribution}", []
        remedy = f"pip install {distribution}" if missing else f"{_reinstall(distribution)}, or {NEW_VENV}"
        if "libgomp" in error:
            remedy = "apt-get install libgomp1, which the wheels of pin do not contain"
        return "-         import fails", [Problem(f"import {module}: {error}", remedy)]
    version, path = json.loads(found)
    problems = list(_pin_version(version, path)) if module == "pinocchio" else []
    return f"{version or installed or '?':<10}{path}", problems


def _pin_version(version: str | None, path: str) -> Iterator[Problem]:
    installed = _installed("pin")
    if version is None:
        yield Problem(f"{path} is not the rigid body dynamics library", f"remove it and {_reinstall('pin')}")
    elif not (4, 1) <= tuple(int(part) for part in version.split(".")[:2]) < (5,):
        yield Problem(f"pinocchio {version} is imported, 4.1 or a later 4.x is needed", "pip install 'pin>=4.1,<5'")
    elif installed not in (None, version):
        yield Problem(f"pip has installed pin {installed}, but version {version} is imported from {path}", NEW_VENV)


def _installed(distribution: str) -> str | None:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None


def _summary(distribution: str) -> str:
    try:
        return str(metadata.metadata(distribution)["Summary"]).lower()
    except metadata.PackageNotFoundError:
        return ""


def _reinstall(distributions: str) -> str:
    return f"pip install --force-reinstall {distributions}"


def _shadows() -> Iterator[Problem]:
    """Installations that hide others: from PYTHONPATH or ROS, which come first, or several of pinocchio or coal."""
    own = next((i for i, entry in enumerate(sys.path) if Path(entry).name == "site-packages"), len(sys.path))
    exported = [Path(entry).resolve() for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep) if entry]
    hidden: list[str] = []
    for path in dict.fromkeys(Path(entry or ".").resolve() for entry in sys.path[:own]):
        modules = [package.module for package in PACKAGES if _copies(package.module, [path])]
        ros = path.is_relative_to(ROS)
        if modules and (ros or path in exported):
            remedy = f"use a shell that has not sourced {ROS}/*/setup.bash" if ros else "unset PYTHONPATH"
            names = ", ".join(modules)
            yield Problem(f"{path} comes before the installed packages and brings its own {names}", remedy)
            hidden += modules
    for module in ("pinocchio", "coal"):
        copies = _copies(module, [Path(entry or ".").resolve() for entry in sys.path])
        if len(copies) > 1 and module not in hidden and not (module == "pinocchio" and "nose" in _summary(module)):
            where = ", ".join(map(str, copies))
            yield Problem(f"{len(copies)} installations of {module}, the first one hides the others: {where}", NEW_VENV)


def _copies(module: str, folders: list[Path]) -> list[Path]:
    """Folders of a search path that hold a module, each once."""
    found = [f for f in folders if (f / module / "__init__.py").is_file() or (f / f"{module}.py").is_file()]
    return list(dict.fromkeys(found))


if __name__ == "__main__":
    sys.exit(main())
