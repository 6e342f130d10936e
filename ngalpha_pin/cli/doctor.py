"""Looks at the installation: which packages are there, from where, and what hides or breaks them.

Only the standard library is imported, so that it also works where nothing else does.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import NamedTuple


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
from ngalpha_pin.engine.kernel import binding as kernel
print(f"{'numpy' if kernel.library is None else 'compiled':<10}{kernel.origin}")
"""
ENGINE = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from ngalpha_pin.engine import versions
from ngalpha_pin.engine.libraries import loaded
built = versions()
libraries = ", ".join(f"{name} {built[name]} ({version} loaded)" for name, version in loaded().items())
print(f"compiled  by {built['compiler']} against {libraries}, eigen {built['eigen']}")
"""
ROS = "/opt/ros"
NEW_VENV = "start from a new virtual environment"


class Problem(NamedTuple):
    """What is wrong, and what to do about it."""

    what: str
    remedy: str


def doctor() -> int:
    """Print versions and import paths, then what is wrong and what to do.

    Returns:
        Exit code: 0 nothing is wrong, 1 problems were found.
    """
    problems: list[Problem] = []
    print(f"{'python':<20}{sys.version.split()[0]:<10}{sys.executable}")
    probes = [(package, _start(IMPORT, package.module)) for package in PACKAGES]
    for package, process in probes:
        line, problem = _judge(package, *_finish(process))
        print(f"{package.module:<20}{line}")
        problems += problem
    print(f"{'kernel':<20}{_finish(_start(KERNEL))[0]}")
    engine, error = _finish(_start(ENGINE))
    print(f"{'engine':<20}{engine or '-         import fails'}")
    problems = [*_shadows(), *problems]  # first what may explain the others
    if error and not problems:
        problems.append(Problem(f"import ngalpha_pin.engine: {error}", _reinstall("ngalpha-pin")))
    if not problems:
        _, error = _finish(_start(TOGETHER))
        if error:
            problems.append(Problem(f"pinocchio and coal do not go together: {error}", _reinstall("pin coal numpy")))
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
    elif version.split(".")[:2] != ["4", "1"]:
        yield Problem(f"pinocchio {version} is imported, 4.1 is needed", "pip install 'pin>=4.1,<4.2'")
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
