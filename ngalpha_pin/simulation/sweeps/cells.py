"""One run of a sweep, where it is made: what is slow to make is made once per worker, errors become text."""

from __future__ import annotations

import hashlib
import pickle
import threading
import time
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from ngalpha_pin.errors import SceneError

TAKEN = ("error", "seconds")  # names of variables that every sweep has
KINDS = "biufU"  # of numpy arrays that a file can take


class Work(NamedTuple):
    """A function, and what it is given in every cell, as workers get it.

    Attributes:
        key: the same for the same work.
        pickled: of the function and of what makes its first argument.
    """

    key: str
    pickled: bytes


class Value(NamedTuple):
    """A result of a cell.

    Attributes:
        dims: names of the axes.
        data: numbers or texts.
        coords: of the axes that have some.
        attrs: such as units.
    """

    dims: tuple[str, ...]
    data: np.ndarray
    coords: dict[str, np.ndarray]
    attrs: dict[str, Any]


class Outcome(NamedTuple):
    """What became of a cell.

    Attributes:
        values: results by name; empty where it failed.
        error: why it failed, or "".
        seconds: that it took [s].
    """

    values: dict[str, Value]
    error: str
    seconds: float


def name_of(function: Callable[..., Any]) -> str:
    """Module and name of a function, as a file of results remembers it."""
    inner = getattr(function, "func", function)  # of functools.partial
    return f"{getattr(inner, '__module__', '')}:{getattr(inner, '__qualname__', type(inner).__name__)}"


def work(function: Callable[..., Any], scene: Any) -> Work:
    """The function and what makes its scene, ready to be sent.

    Raises:
        SceneError: they cannot be sent to another process.
    """
    pickled = _pickled((function, scene))
    return Work(hashlib.sha256(pickled).hexdigest(), pickled)


def _pickled(what: Any) -> bytes:
    try:
        pickler = import_module("cloudpickle")  # comes with dask, and knows functions of notebooks
    except ImportError:
        pickler = pickle
    try:
        return pickler.dumps(what)
    except Exception as error:
        raise SceneError(
            f"the function of a sweep, and its scene, are sent to other processes, which cannot be done: {error}; "
            "define functions at the top level of a module, or make the scene there, in a function: scene=make_scene"
        ) from error


class Prepared:
    """A function with what is made once for all of its cells; each cell gets a copy of its own."""

    def __init__(self, function: Callable[..., Any], scene: Any):
        self._function = function
        self._made = None if scene is None else _pickled(scene() if callable(scene) else scene)

    def __call__(self, cell: Mapping[str, Any]) -> Outcome:
        """Call the function in one cell of the grid; whatever it raises is the error of the cell."""
        begin = time.perf_counter()
        try:
            first = () if self._made is None else (pickle.loads(self._made),)
            values, error = _values(self._function(*first, **cell)), ""
        except Exception as raised:
            values, error = {}, described(raised)
        return Outcome(values, error, time.perf_counter() - begin)


_lock = threading.Lock()
_prepared: dict[str, Prepared] = {}


def run_cell(job: Work, cell: Mapping[str, Any]) -> Outcome:
    """A cell in a worker, which prepares the work once."""
    try:
        with _lock:
            if job.key not in _prepared:
                _prepared.clear()  # of a sweep that is over
                _prepared[job.key] = Prepared(*pickle.loads(job.pickled))
            prepared = _prepared[job.key]
    except Exception as raised:
        return Outcome({}, described(raised), 0.0)
    return prepared(cell)


def described(error: BaseException) -> str:
    """An error in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".rstrip(": ")


def _values(returned: Any) -> dict[str, Value]:
    """What a function returned, by name.

    Raises:
        SceneError: it is nothing that can be kept.
    """
    named: Mapping[Any, Any]
    if hasattr(returned, "data_vars"):  # a Dataset of xarray
        named = dict(returned.data_vars)
    else:
        named = returned if isinstance(returned, Mapping) else {"result": returned}
    found = {str(name): _value(str(name), value) for name, value in named.items()}
    for name in TAKEN:
        if name in found:
            raise SceneError(f"{name!r} is a variable of the sweep itself; give the result another name")
    return found


def _value(name: str, value: Any) -> Value:
    labelled = hasattr(value, "dims") and hasattr(value, "coords")  # a DataArray of xarray
    data = np.asarray(value)
    if data.dtype.kind not in KINDS:
        raise SceneError(
            f"{name}: the function returned {type(value).__name__}: expected numbers, texts, arrays of them, a mapping "
            "of names to them, or an xarray Dataset such as trajectory.to_xarray()"
        )
    if not labelled:
        return Value(tuple(f"{name}_{i}" for i in range(data.ndim)), data, {}, {})
    coords = {str(d): np.asarray(value.coords[d]) for d in value.dims if d in value.coords}
    return Value(tuple(map(str, value.dims)), data, coords, dict(value.attrs))
