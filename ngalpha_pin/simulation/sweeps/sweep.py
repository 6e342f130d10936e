"""`sweep`: a function over a grid of parameters, each cell a run of its own."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import closing, contextmanager
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from tqdm import tqdm

from ngalpha_pin.common import checks
from ngalpha_pin.common.optional import require
from ngalpha_pin.errors import Interrupted
from ngalpha_pin.simulation.sweeps.cells import Outcome, Prepared, described, name_of, run_cell, work
from ngalpha_pin.simulation.sweeps.dataset import INSTALL, Cell, Grid, read, to_dataset, write
from ngalpha_pin.simulation.sweeps.processes import NotStarted, Processes, WorkerLost

TRIES = 3  # of a cell whose worker is lost
EVERY = 10.0  # between two writings of the file, at least [s]


def sweep(
    function: Callable[..., Any],
    *,
    executor: Executor | int | None = None,
    progress: bool = True,
    scene: Any = None,
    save_to: str | os.PathLike[str] | None = None,
    **grid: Any,
) -> Any:
    """Call a function with every combination of parameters, on all cores or on a cluster.

    For example::

        def drop(scene, mu, height):
            scene.add_contact("*foot*", "ground", mu=mu)
            run = nga.simulate(scene, scene.place_on("ground", scene.reference(), height), t_end=1.0, dt=1e-3)
            return {"tipped": abs(run.q[-1, 3]) > 0.5, "energy": run.energy.total[-1]}

        runs = nga.sweep(drop, scene=make_scene, mu=np.linspace(0.1, 1.0, 10), height=[0.05, 0.2])
        runs["tipped"].sel(height=0.2)

    Args:
        function: called with the parameters of a cell by name. It returns a number, a text, an array, an xarray
            DataArray, or several of them by name, in a mapping or a Dataset such as `trajectory.to_xarray()`.
        executor: any `concurrent.futures.Executor`, for a cluster `dask.distributed.Client(...).get_executor()`; a
            number of processes of this machine; 0 is this process, one cell after the other; None is a process for
            each core. A process that is ended costs its own cell, which is tried again; so do dask's workers.
        progress: show a bar.
        scene: a `Scene`, or a function without arguments that makes one, or anything else that is slow to make. It is
            made once per worker, and each cell gets a copy of its own as first argument of the function.
        save_to: file (.nc) that is written on the way and from which the sweep goes on: what it has is not run again.
        **grid: a sequence of numbers, texts or truth values for each parameter that is varied; one such value for a
            parameter that is not.

    Returns:
        An `xarray.Dataset` over the parameters: the results by name ("result" where they have none), with NaN or ""
        where a run failed; `error`, the reason as text, otherwise ""; and `seconds`, the time of each run [s].

    Raises:
        SceneError: the grid, the function or the file cannot be used.
        MissingPackageError: xarray, or h5netcdf for a file, is not installed.
        NotStarted: processes cannot be started.
        NotWritten: the file cannot be written.
        Interrupted: Ctrl-C; its `results` is the Dataset so far, which the file has as well.
    """
    require("xarray", "nga.sweep", INSTALL)
    checks.function("function", function, "of the parameters")
    checks.flag("progress", progress)
    cells = Grid(grid)
    path = None if save_to is None else checks.path("save_to", save_to)
    name = name_of(function)
    done = read(path, cells, name) if path is not None and path.exists() else {}
    file = None if path is None else _File(path, cells, name, done)
    left = [cell for cell in cells.cells() if cell not in done]
    try:
        with tqdm(total=len(cells.cells()), initial=len(done), disable=not progress, unit="run", leave=False) as bar:
            with closing(_outcomes(function, scene, executor, cells, left)) as outcomes:
                for cell, outcome in outcomes:
                    done[cell] = outcome
                    bar.update()
                    if file is not None:
                        file.write_now_and_then()
    except KeyboardInterrupt as error:
        interrupted = Interrupted(f"interrupted with {len(done)} of {len(cells.cells())} runs done")
        interrupted.results = to_dataset(cells, done, name)
        if file is not None:
            file.write()
        raise interrupted from error
    if file is not None:
        file.write()
    return to_dataset(cells, done, name)


class _File:
    """The file of a sweep, written as often as it is worth it."""

    def __init__(self, path: Path, grid: Grid, function: str, done: dict[Cell, Outcome]):
        self._path, self._grid, self._function, self._done = path, grid, function, done
        self.write()  # what cannot be written is known before anything is computed

    def write_now_and_then(self) -> None:
        if time.monotonic() - self._written > max(EVERY, 10.0 * self._took):
            self.write()

    def write(self) -> None:
        begin = time.monotonic()
        write(self._path, to_dataset(self._grid, self._done, self._function))
        self._written = time.monotonic()
        self._took = self._written - begin


def _outcomes(
    function: Callable[..., Any], scene: Any, executor: Any, grid: Grid, cells: list[Cell]
) -> Generator[tuple[Cell, Outcome]]:
    """The cells as they get ready."""
    if not isinstance(executor, Executor) and executor is not None and checks.integer("executor", executor, 0) == 0:
        prepared = Prepared(function, scene)
        yield from ((cell, prepared(grid.at(cell))) for cell in cells)
        return
    job = work(function, scene)
    with _executor(executor, len(cells)) as pool:
        tries = dict.fromkeys(cells, 0)
        ready: SimpleQueue[tuple[Cell, Future[Outcome]]] = SimpleQueue()
        waiting: dict[Cell, Future[Outcome]] = {}

        def submit(cell: Cell) -> Outcome | None:
            tries[cell] += 1
            try:
                future = pool.submit(run_cell, job, grid.at(cell))
            except RuntimeError as error:  # an executor of the user's own has ended for good
                return _failed(error)
            waiting[cell] = future
            future.add_done_callback(lambda future: ready.put((cell, future)))
            return None

        try:
            refused = {cell: submit(cell) for cell in cells}
            yield from ((cell, outcome) for cell, outcome in refused.items() if outcome is not None)
            while waiting:
                cell, future = ready.get()
                del waiting[cell]
                outcome = _outcome(future)
                if outcome is None:
                    outcome = submit(cell) if tries[cell] < TRIES else _failed(future.exception())
                if outcome is not None:
                    yield cell, outcome
        finally:
            for future in waiting.values():
                future.cancel()


def _outcome(future: Future[Outcome]) -> Outcome | None:
    """What became of a cell; None where its worker was lost.

    Raises:
        NotStarted: there are no workers.
    """
    if future.cancelled():
        return Outcome({}, "cancelled", 0.0)
    error = future.exception()
    if isinstance(error, NotStarted):
        raise error
    if isinstance(error, (WorkerLost, BrokenExecutor)):
        return None
    return future.result() if error is None else _failed(error)


def _failed(error: BaseException | None) -> Outcome:
    return Outcome({}, "" if error is None else described(error), 0.0)


@contextmanager
def _executor(given: Executor | int | None, cells: int) -> Iterator[Executor]:
    """The executor, which is ended afterwards where it was made here."""
    if isinstance(given, Executor):
        yield given
        return
    n = checks.cores() if given is None else checks.integer("executor", given, 0)
    with Processes(max(1, min(n, cells))) as pool:
        yield pool
