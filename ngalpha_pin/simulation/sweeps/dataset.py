"""The results of a sweep as an xarray Dataset and as a file, from which a sweep goes on."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ngalpha_pin.common.files import replacing
from ngalpha_pin.common.optional import require
from ngalpha_pin.errors import SceneError
from ngalpha_pin.simulation.sweeps.cells import KINDS, TAKEN, Outcome, Value

INSTALL = "pip install 'ngalpha-pin[sweep]'"
NOT_RUN = "not run"
FUNCTION, KIND = "function", "kind"  # attributes of the Dataset and of its variables

Cell = tuple[int, ...]


class Grid:
    """The parameters of a sweep and the values they take.

    Args:
        given: values by name, a sequence for a parameter that is varied, otherwise a number, a text or a truth value.

    Attributes:
        names: of those that are varied.
        axes: their values, one array each.
        fixed: the others.

    Raises:
        SceneError: a value can be no coordinate, a value comes twice, or nothing is varied.
    """

    def __init__(self, given: Mapping[str, Any]):
        axes: dict[str, np.ndarray] = {}
        self.fixed: dict[str, Any] = {}
        for name, values in given.items():
            array = np.asarray(values)
            if name in TAKEN or name == "result":
                raise SceneError(f"{name!r} is a variable of the sweep itself; give the parameter another name")
            if array.ndim > 1 or array.dtype.kind not in KINDS or array.size == 0:
                raise SceneError(
                    f"{name} has values that cannot be coordinates: expected numbers, texts or truth values, or a "
                    "sequence of them; pass the name or the number of anything else and look it up in the function"
                )
            if array.ndim == 0:
                self.fixed[name] = array.item()
                continue
            if len(np.unique(array)) < array.size or (array.dtype.kind == "f" and not np.isfinite(array).all()):
                raise SceneError(f"{name}: each value must come once, and numbers must be finite")
            axes[name] = array
        if not axes:
            raise SceneError("a sweep needs a parameter with a sequence of values, e.g. mu=[0.1, 0.5]")
        self.names, self.axes = tuple(axes), tuple(axes.values())
        self.shape = tuple(len(axis) for axis in self.axes)

    def cells(self) -> list[Cell]:
        """All of them, the last parameter fastest."""
        return list(np.ndindex(self.shape))

    def at(self, cell: Cell) -> dict[str, Any]:
        """The parameters of a cell, as Python's own numbers."""
        return {n: axis[i].item() for n, axis, i in zip(self.names, self.axes, cell, strict=True)} | self.fixed


def to_dataset(grid: Grid, done: Mapping[Cell, Outcome], function: str) -> Any:
    """The results so far as an `xarray.Dataset`; numbers of cells without any are NaN, texts are empty."""
    xarray = require("xarray", "nga.sweep", INSTALL)
    done = _fitting(done)
    error = np.full(grid.shape, NOT_RUN, dtype=object)
    seconds = np.full(grid.shape, np.nan)
    for cell, outcome in done.items():
        error[cell], seconds[cell] = outcome.error, outcome.seconds
    variables: dict[str, Any] = {
        "error": (grid.names, error.astype(str), {"long_name": "why a run failed, or empty"}),
        "seconds": (grid.names, seconds, {"units": "s", "long_name": "time that a run took"}),
    }
    coords: dict[str, Any] = {**dict(zip(grid.names, grid.axes, strict=True)), **grid.fixed}
    for name in _names(done):
        variables[name] = _stacked(grid, {c: o.values[name] for c, o in done.items() if name in o.values}, coords)
    return xarray.Dataset(variables, coords, {FUNCTION: function})


def _names(done: Mapping[Cell, Outcome]) -> list[str]:
    return list(dict.fromkeys(name for outcome in done.values() for name in outcome.values))


def _fitting(done: Mapping[Cell, Outcome]) -> dict[Cell, Outcome]:
    """The outcomes; one whose results have other axes than those of the first cell is an error."""
    first: dict[str, Value] = {}
    found = {}
    for cell in sorted(done):
        outcome = done[cell]
        for name, value in outcome.values.items():
            known = first.setdefault(name, value)
            same_kind = (known.data.dtype.kind == "U") == (value.data.dtype.kind == "U")
            if known.dims != value.dims or not same_kind:
                said = f"{name} has the axes {value.dims} and {value.data.dtype}, in an earlier cell {known.dims}"
                outcome = Outcome({}, f"SceneError: {said} and {known.data.dtype}", outcome.seconds)
                break
        found[cell] = outcome
    return found


def _stacked(grid: Grid, values: dict[Cell, Value], coords: dict[str, Any]) -> Any:
    """One variable over the grid and its own axes; axes that differ in length end in NaN."""
    first = next(iter(values.values()))
    own = np.max([value.data.shape for value in values.values()], axis=0).astype(int).tolist()
    dtype = np.result_type(*(value.data.dtype for value in values.values()))
    full = len(values) == np.prod(grid.shape) and all(list(v.data.shape) == own for v in values.values())
    attrs = first.attrs | {KIND: dtype.kind}
    if not full and dtype.kind in "biu":
        dtype = np.dtype(float)
    data = np.full((*grid.shape, *own), "" if dtype.kind == "U" else np.nan if dtype.kind == "f" else 0, dtype=dtype)
    for cell, value in values.items():
        place: tuple[Any, ...] = (*cell, *(slice(n) for n in value.data.shape))
        data[place] = value.data
    for dim, size in zip(first.dims, own, strict=True):
        known = [value.coords.get(dim) for value in values.values()]
        if known[0] is not None and len(known[0]) == size and all(_equal(known[0], x) for x in known):
            coords.setdefault(dim, known[0])
    return (*grid.names, *first.dims), data, attrs


def _equal(a: np.ndarray, b: np.ndarray | None) -> bool:
    return b is not None and np.array_equal(a, b)


def write(path: Path, dataset: Any) -> None:
    """Write a Dataset as netCDF, whole or not at all; see `files.replacing`."""
    require("h5netcdf", "a file of results", INSTALL)
    with replacing(path) as beside:
        dataset.to_netcdf(beside, engine="h5netcdf")


def read(path: str | os.PathLike[str], grid: Grid, function: str) -> dict[Cell, Outcome]:
    """What a file says of the cells of a grid: those with the same values of all parameters, without error.

    Raises:
        SceneError: it is no file of a sweep, or of another function or other parameters.
    """
    xarray = require("xarray", "nga.sweep", INSTALL)
    require("h5netcdf", "a file of results", INSTALL)
    try:
        with xarray.open_dataset(path, engine="h5netcdf") as opened:
            dataset = opened.load()
    except Exception as error:
        raise SceneError(f"{path} is no file of a sweep that can be read: {error}") from error
    said = dataset.attrs.get(FUNCTION)
    if said != function or "error" not in dataset or dataset["error"].dims != grid.names:
        parameters = ", ".join(map(str, dataset["error"].dims)) if "error" in dataset else "none"
        raise SceneError(
            f"{path} is of another sweep, of {said} over {parameters}: this is of {function} over "
            f"{', '.join(grid.names)}; give another file"
        )
    for name, value in grid.fixed.items():
        if name not in dataset.coords or dataset.coords[name].item() != value:
            raise SceneError(f"{path} is of a sweep with another {name}; give another file")
    places = [{x: i for i, x in enumerate(dataset[name].values.tolist())} for name in grid.names]
    found = {}
    for cell in grid.cells():
        at = [place.get(axis[i].item()) for place, axis, i in zip(places, grid.axes, cell, strict=True)]
        if None not in at and dataset["error"].values[tuple(at)] == "":
            found[cell] = _outcome(dataset.isel(dict(zip(grid.names, at, strict=True))))
    return found


def _outcome(one: Any) -> Outcome:
    """A cell of a Dataset as it was computed."""
    values = {}
    for name, variable in one.data_vars.items():
        if name in TAKEN:
            continue
        attrs = dict(variable.attrs)
        kind = attrs.pop(KIND, variable.dtype.kind)
        if kind in "biu" and variable.dtype.kind == "f":
            if not np.isfinite(variable.values).all():  # of an axis that is shorter here
                kind = "f"
        data = variable.values.astype({"b": bool, "i": int, "u": np.uint, "U": str}.get(kind, float))
        coords = {d: variable.coords[d].values for d in variable.dims if d in variable.coords}
        values[str(name)] = Value(tuple(map(str, variable.dims)), data, coords, attrs)
    return Outcome(values, "", float(one["seconds"]))
