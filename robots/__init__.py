"""Ready systems: the benchmarks of the paper and some robots, one module each with `load() -> (scene, q0, v0)`."""

from __future__ import annotations

import pkgutil
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from ngalpha_pin import Scene
from ngalpha_pin.errors import SceneError


@cache
def names() -> tuple[str, ...]:
    """Names of the systems, sorted; each is a module of this package."""
    return tuple(sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")))


def load(name: str, **given: Any) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Build the system of that name.

    Args:
        name: one of `names()`.
        **given: parameters, passed on to the `load` of the module, which documents them.

    Returns:
        The scene, q0 of shape (nq,) and v0 of shape (nv,).

    Raises:
        SceneError: there is no such system, or it does not take one of the parameters.
    """
    known = parameters(name)
    unknown = [p for p in given if p not in known]
    if unknown:
        raise SceneError(f"{name} has no parameter {unknown[0]!r}; it takes {', '.join(known)}")
    return import_module(f"{__name__}.{name}").load(**given)


def parameters(name: str) -> dict[str, Any]:
    """The parameters that the system of that name takes, with their defaults.

    Raises:
        SceneError: there is no such system.
    """
    if name not in names():
        close = get_close_matches(name, names(), n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise SceneError(f"no system named {name!r}; {hint}known: {', '.join(names())}")
    return dict(import_module(f"{__name__}.{name}").load.__kwdefaults__ or {})


def __getattr__(name: str) -> Any:
    """Systems are loaded by name: `robots.quadruped` is no function."""
    if name in names():
        raise AttributeError(f"robots.{name} is not loaded: use robots.load({name!r}), which returns scene, q0 and v0")
    close = get_close_matches(name, names(), n=1)
    hint = f"; did you mean robots.load({close[0]!r})?" if close else ""
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")
