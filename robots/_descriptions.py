"""Robots of the package example-robot-data: their files, and what its loaders say of them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import ngalpha_pin as nga


def loaders() -> dict[str, Any]:
    """Loaders of the robots by name; none where the package is not installed."""
    try:
        from example_robot_data.robots_loader import ROBOTS
    except ImportError:
        return {}
    return dict(ROBOTS)


def loader_of(name: str) -> Any:
    """The loader of a robot.

    Raises:
        nga.SceneError: the package is not installed, or has no such robot.
    """
    known = loaders()
    if not known:
        raise nga.SceneError(f"{name} needs its description: pip install example-robot-data-loaders")
    if name not in known:
        raise nga.UnknownName("robot of example-robot-data", name, known)
    return known[name]


def file_of(name: str) -> Path:
    """The URDF of a robot, or its SDF where it has no URDF.

    Raises:
        nga.SceneError: as of `loader_of`.
    """
    return _file(loader_of(name))


def srdf_of(name: str) -> Path:
    """The SRDF of a robot that has one; raises as `loader_of`."""
    loader = loader_of(name)
    return _folder(loader) / loader.srdf_subpath / loader.srdf_filename


def _folder(loader: Any) -> Path:
    from example_robot_data.robots_loader import getModelPath

    return Path(getModelPath(loader.path)) / loader.path


def _file(loader: Any) -> Path:
    if loader.urdf_filename:
        return _folder(loader) / loader.urdf_subpath / loader.urdf_filename
    return _folder(loader) / loader.sdf_subpath / loader.sdf_filename


def says_free(path: str | os.PathLike[str]) -> bool | None:
    """Whether the root of a file of example-robot-data moves freely, as its loader says; None of any other file."""
    target = Path(path).resolve()
    for loader in loaders().values():
        filename = loader.urdf_filename or loader.sdf_filename
        if os.path.basename(filename) == target.name and _file(loader).resolve() == target:
            return bool(loader.free_flyer)
    return None
