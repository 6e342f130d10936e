"""What the command line is pointed at: a system or robot by name, a function of the user's own, a URDF or MJCF file."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import NgalphaError, SceneError
from ngalpha_pin.robots import load as load_system
from ngalpha_pin.robots import names
from ngalpha_pin.robots import parameters as system_parameters
from ngalpha_pin.robots._descriptions import file_of, loaders, says_free
from ngalpha_pin.scene.model_parts import is_mjcf
from ngalpha_pin.scene.posture import floats
from ngalpha_pin.scene.scene import Scene

MU = 0.8
ROUNDED = 1e-3  # a quaternion this close to norm one has been rounded
HEIGHT = 0.1  # of a robot that is dropped on the ground [m]

INSTEAD = {
    ".py": "give a function in it that returns (scene, q0, v0): {}:function",
    ".npz": "a trajectory is shown by: ngalpha-pin replay {} --html out.html",
}

Start = tuple[Scene, np.ndarray, np.ndarray]
"""A scene, q0 and v0."""


class Options(NamedTuple):
    """What can be said beside the target; None leaves it as it is.

    Attributes:
        floating: of a URDF: the root moves freely; None is what `moves_freely` finds.
        ground: of a file: add the plane z = 0, which every body can touch; None is for a root that moves freely.
        height: of a system, or of the lowest point of a floating robot [m].
        mu: friction coefficient [-].
        q0, v0: numbers with commas between them, or a file with them (.npy, or text).
    """

    floating: bool | None = None
    ground: bool | None = None
    height: float | None = None
    mu: float | None = None
    q0: str | None = None
    v0: str | None = None


def load(target: str, options: Options, own: dict[str, Any] | None = None) -> Start:
    """The scene of a target, q0 and v0.

    Args:
        target: name of a system or of a robot of example-robot-data, `module:function` or `file.py:function` of a
            function that returns a scene, q0 and v0, or the path of a URDF or MJCF (.xml) file.
        options: what to change.
        own: parameters of the target itself, see `parameters_of`.

    Raises:
        SceneError: there is no such thing, or an option does not go with it.
    """
    own = own or {}
    if target in names():
        start = _system(target, options, own)
    elif ":" in target and "://" not in target and not Path(target).is_file():
        start = _function(target, options, own)
    elif Path(target).is_file():
        start = _file(target, options)
    elif target in loaders():
        start = _file(str(file_of(target)), options)
    elif Path(target).suffix or "/" in target or Path(target).is_dir():
        raise SceneError(_no_file(target))
    else:
        close = get_close_matches(target, names(), n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise SceneError(f"{target!r} is neither a file nor a system; {hint}systems: {', '.join(names())}")
    return _started(start, options)


def parameters_of(target: str) -> tuple[str, ...]:
    """Names of the parameters that a target itself takes: those of a system, or of a function of the user's own."""
    if target in names():
        return tuple(system_parameters(target))
    if ":" in target and not Path(target).is_file():
        return tuple(inspect.signature(_function_of(target)).parameters)
    return ()


def _no_file(target: str) -> str:
    """What to do about something that looks like a file and is none."""
    path = Path(target)
    if "://" in target:
        return f"{target} is an address: download the file, with its meshes, and give its path"
    if path.is_dir():
        files = sorted(p.name for p in path.iterdir() if p.suffix in (".urdf", ".xml", ".xacro"))
        return f"{target} is a folder; give a file" + (f", such as {files[0]}" if files else "")
    there = path.parent if path.parent.is_dir() else Path()
    close = get_close_matches(path.name, [p.name for p in there.iterdir() if p.is_file()], n=1)
    hint = f"; did you mean {there / close[0]}?" if close else ""
    return f"there is no file {target}{hint}"


def _system(target: str, options: Options, own: dict[str, Any]) -> Start:
    if options.floating or options.ground:
        raise SceneError(f"--floating and --ground are for URDF files; {target} is complete as it is")
    given = {"height": options.height, "mu": options.mu}
    return load_system(target, **{name: value for name, value in given.items() if value is not None} | own)


def _function(target: str, options: Options, own: dict[str, Any]) -> Start:
    """Call `module:function` or `file.py:function`."""
    if options.floating or options.ground or options.height is not None or options.mu is not None:
        raise SceneError(f"{target}: --floating, --ground, --height and --mu are for files; the function says it all")
    value: Any = _called(target, _function_of(target), own)
    if not (isinstance(value, tuple) and len(value) in (2, 3) and isinstance(value[0], Scene)):
        raise SceneError(f"{target} must return (scene, q0, v0) or (scene, q0), not {type(value).__name__}")
    v0 = value[2] if len(value) == 3 else np.zeros(value[0].model.nv)
    return value[0], np.asarray(value[1], dtype=float), np.asarray(v0, dtype=float)


def _function_of(target: str) -> Callable[..., Any]:
    where, _, name = target.rpartition(":")
    function = getattr(_module(where), name, None)
    if not callable(function):
        raise SceneError(f"{where} has no function {name!r}")
    return function


def _called(target: str, function: Callable[..., Any], own: dict[str, Any]) -> Any:
    """What a function of the user returns; where it fails the message says which line did."""
    try:
        return function(**own)
    except NgalphaError:
        raise
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = "" if last.filename == __file__ else f", {last.filename} line {last.lineno}"
        raise SceneError(f"{target} failed: {type(error).__name__}: {error}{where}") from error


def _module(where: str) -> ModuleType:
    if where.endswith(".py"):
        path = Path(where)
        if not path.is_file():
            raise SceneError(f"there is no file {where}")
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        _called(where, partial(spec.loader.exec_module, module), {})
        return module
    # modules of the folder one is in are found, but never instead of an installed one, here or in a process of its own
    if "" not in sys.path:
        sys.path.append("")
    try:
        return importlib.import_module(where)
    except ModuleNotFoundError as error:
        raise SceneError(f"no module named {error.name!r}: is {where} installed or in this folder?") from error


def _file(target: str, options: Options) -> Start:
    if Path(target).suffix in INSTEAD:
        raise SceneError(f"{target} is no URDF or MJCF file; {INSTEAD[Path(target).suffix].format(target)}")
    if options.height is not None and options.q0 is not None:
        raise SceneError("--height and --q0 both say where the robot starts; give one of them")
    if Path(target).suffix == ".xml" and is_mjcf(Path(target)):
        if options.floating is not None:
            raise SceneError("--floating is for URDF files; an MJCF file says itself how its root moves")
        scene, floating = Scene.from_mjcf(target), False
    else:
        floating = moves_freely(target) if options.floating is None else options.floating
        scene = Scene.from_urdf(target, pin.JointModelFreeFlyer() if floating else None)
        if options.floating is None and scene.model.nv == 0:  # a body on its own, as a drone
            body = Scene.from_urdf(target, pin.JointModelFreeFlyer())
            scene, floating = (body, True) if body.model.inertias[1].mass > 0.0 else (scene, False)
    ground = floating if options.ground is None else options.ground
    if options.mu is not None and not ground:
        raise SceneError("--mu needs --ground: without it there is no contact")
    if options.height is not None and not floating:
        raise SceneError("--height needs --floating: the root of the URDF is fixed to the world")
    q0 = scene.reference()
    if ground:
        _add_ground(scene, MU if options.mu is None else options.mu, asked=options.ground is not None)
    if floating and _moving(scene) and (ground or options.height is not None):
        q0 = _at_height(scene, q0, HEIGHT if options.height is None else options.height)
    return scene, q0, np.zeros(scene.model.nv)


def _at_height(scene: Scene, q0: np.ndarray, height: float) -> np.ndarray:
    """The lowest point above the plane z = 0, which is there or not."""
    there = scene.declared_shapes.existGeometryName("ground")
    plane = "ground" if there else scene.add_plane("z = 0")
    q0 = scene.place_on(plane, q0, height)
    if not there:
        scene.remove(plane)
    return q0


def moves_freely(urdf: str) -> bool:
    """Whether the root of a URDF moves freely, as the package that it is from says, or else an SRDF beside it."""
    said = says_free(urdf)
    return floats(urdf) if said is None else said


def _moving(scene: Scene) -> list[str]:
    return [g.name for g in scene.declared_shapes.geometryObjects if g.parentJoint > 0]


def _add_ground(scene: Scene, mu: float, asked: bool) -> None:
    """Add the plane z = 0 and its contact with every geometry that moves; all shapes of URDF can touch it."""
    if not _moving(scene):
        if asked:
            raise SceneError(f"--ground: {scene.model.name} has no collision geometry that moves")
        return
    scene.add_plane("ground")
    scene.add_contact("*", "ground", mu=mu)


def _started(start: Start, options: Options) -> Start:
    """The same with the initial state of the options."""
    scene, q0, v0 = start
    if options.q0 is not None:
        q0 = _numbers("--q0", options.q0, scene.model.nq)
        # the digits of a text are not all there are
        q0 = pin.normalize(scene.model, q0) if pin.isNormalized(scene.model, q0, ROUNDED) else q0
    if options.v0 is not None:
        v0 = _numbers("--v0", options.v0, scene.model.nv)
    return scene, q0, v0


def _numbers(option: str, text: str, n: int) -> np.ndarray:
    """Numbers from a text with commas or from a file."""
    try:
        if text.endswith(".npy"):
            values = np.load(text)
        elif Path(text).is_file():
            values = np.loadtxt(text, delimiter="," if "," in Path(text).read_text() else None)
        else:
            values = np.array([float(word) for word in text.split(",")])
    except (OSError, ValueError) as error:
        raise SceneError(f"{option} {text}: neither numbers with commas between them nor a file of numbers") from error
    values = np.asarray(values, dtype=float).ravel()
    if values.shape != (n,) or not np.isfinite(values).all():
        raise SceneError(f"{option} has {len(values)} numbers, the model needs {n}, all of them finite")
    return values
