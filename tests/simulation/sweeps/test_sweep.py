"""Sweeps: the same bits wherever they run, an error per cell, results that a file goes on from."""

import functools
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest
import sweep_functions

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.simulation.sweeps import sweep as module
from ngalpha_pin.simulation.sweeps.processes import WorkerLost

xarray = pytest.importorskip("xarray")
GRID = {"mu": [0.1, 0.3], "height": [0.2, 0.5]}


def swept(function, **options):
    return nga.sweep(function, progress=False, **options)


@pytest.fixture(scope="module")
def serial():
    return swept(sweep_functions.ball, executor=0, **GRID)


def test_cells_are_runs(serial):
    assert serial["x"].dims == ("mu", "height")
    assert serial["q"].dims == ("mu", "height", "q_0")
    assert [serial[name].dtype.kind for name in ("x", "impacts", "slips", "end")] == list("fibU")
    for mu in GRID["mu"]:
        one = sweep_functions.ball(mu, 0.5)
        cell = serial.sel(mu=mu, height=0.5)
        assert cell["x"].item() == one["x"] and cell["slips"].item() == one["slips"]
        assert np.array_equal(cell["q"], one["q"])
    assert (serial["error"] == "").all() and (serial["seconds"] > 0).all()


def test_same_bits_on_threads(serial):
    found = swept(sweep_functions.ball, executor=ThreadPoolExecutor(2), **GRID)
    assert found.drop_vars("seconds").identical(serial.drop_vars("seconds"))


def test_dask_cluster_gives_the_same_bits_and_survives_a_kill(tmp_path):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        found = swept(sweep_functions.dangerous, executor=client.get_executor(), x=[0, 1, 3, 4], folder=str(tmp_path))
    assert found["result"].fillna(-1).values.tolist() == [0, 1, -1, 16]
    assert found["error"].values.tolist() == ["", "", "SceneError: no such thing", ""]
    assert len(list(tmp_path.glob("1-*"))) == 2


def test_a_killed_worker_costs_its_own_cell_and_is_tried_again(tmp_path):
    found = swept(sweep_functions.dangerous, executor=2, x=[0, 1, 3, 4], folder=str(tmp_path))
    assert found["result"].fillna(-1).values.tolist() == [0, 1, -1, 16]
    assert found["error"].values.tolist() == ["", "", "SceneError: no such thing", ""]
    assert [len(list(tmp_path.glob(f"{x}-*"))) for x in (0, 1, 3, 4)] == [1, 2, 1, 1]
    assert found["folder"].item() == str(tmp_path)


class Loses(Executor):
    """An executor in which every call for 2 is lost, and which takes so many calls."""

    def __init__(self, most):
        self.calls, self.most = [], most

    def submit(self, function, job, cell):
        if len(self.calls) == self.most:
            raise BrokenExecutor("closed for good")
        self.calls.append(cell["x"])
        future = Future()
        if cell["x"] == 2:
            future.set_exception(WorkerLost("gone"))
        else:
            future.set_result(function(job, cell))
        return future


def test_a_cell_that_ends_its_workers_is_given_up():
    pool = Loses(100)
    found = swept(sweep_functions.square, executor=pool, x=range(4))
    assert found["error"].values.tolist() == ["", "", "WorkerLost: gone", ""]
    assert sorted(pool.calls) == [0, 1, *module.TRIES * [2], 3]


def test_an_executor_that_has_ended_leaves_errors():
    found = swept(sweep_functions.square, executor=Loses(2), x=[0, 1, 3])
    assert found["result"].fillna(-1).values.tolist() == [0, 1, -1]
    assert found["error"].values[2] == "BrokenExecutor: closed for good"


def test_a_scene_is_made_once_per_worker_and_each_cell_has_its_own(tmp_path):
    make = functools.partial(sweep_functions.made, str(tmp_path))
    mu = np.linspace(0.1, 0.9, 9)
    found = swept(sweep_functions.contacts, executor=ThreadPoolExecutor(2), scene=make, mu=mu)
    first = robots.load("rotating_ball")[0].contacts[0].law.mu
    assert np.array_equal(found["result"], [[first, x] for x in mu])
    assert len(list(tmp_path.iterdir())) == 1
    given = swept(sweep_functions.contacts, executor=0, scene=sweep_functions.made(str(tmp_path)), mu=mu)
    assert np.array_equal(given["result"], found["result"])


def test_a_scene_that_cannot_be_made_is_the_error_of_its_cells():
    found = swept(
        sweep_functions.contacts, executor=ThreadPoolExecutor(1), scene=functools.partial(robots.load, "x"), mu=[1.0]
    )
    assert "no system named 'x'" in found["error"].item()


def test_a_file_goes_on_where_it_was(tmp_path, serial):
    path = tmp_path / "runs.nc"
    calls = []

    def counted(mu, height):
        calls.append((mu, height))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return sweep_functions.ball(mu, height)

    with pytest.raises(nga.Interrupted, match="2 of 4 runs done") as caught:
        swept(counted, executor=0, save_to=path, **GRID)
    so_far = caught.value.results
    assert (so_far["error"] == "not run").sum() == 2 and np.isnan(so_far["impacts"]).sum() == 2
    found = swept(counted, executor=0, save_to=path, **GRID)
    assert calls[:2] + calls[3:] == [(mu, height) for mu in GRID["mu"] for height in GRID["height"]]
    assert found.drop_vars("seconds").equals(serial.drop_vars("seconds"))
    assert all(found[name].dtype == serial[name].dtype for name in found)
    # a larger grid takes over what is there
    wider = swept(counted, executor=0, save_to=path, mu=[0.2, *GRID["mu"]], height=GRID["height"])
    assert len(calls) == 5 + 2
    assert wider.sel(mu=GRID["mu"]).drop_vars("seconds").equals(serial.drop_vars("seconds"))


def test_ctrl_c_keeps_what_is_done(tmp_path):
    """In a process of its own, with the signal of a terminal, and processes that are at work."""
    code = """
import json, sys
import ngalpha_pin as nga
import sweep_functions
if __name__ == "__main__":
    print(sorted({"xarray", "dask", "pandas", "gymnasium", "h5py"} & set(sys.modules)), flush=True)
    try:
        nga.sweep(sweep_functions.waits, executor=1, progress=False, x=range(100), folder=sys.argv[1])
    except KeyboardInterrupt as stopped:
        print(json.dumps(stopped.results["error"].values.tolist()))
"""
    script = tmp_path / "script.py"
    script.write_text(code)
    process = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.path.dirname(sweep_functions.__file__)},
    )
    assert process.stdout.readline() == "[]\n"  # importing the package has imported no extra
    while not (tmp_path / "1").exists():
        assert process.poll() is None
        time.sleep(0.02)
    time.sleep(0.5)  # the one before has come back
    process.send_signal(signal.SIGINT)
    errors = json.loads(process.communicate(timeout=300)[0])
    assert errors[0] == "" and errors[-1] == "not run"


def test_results_of_different_lengths_end_in_nan():
    found = swept(lambda n: {"t": np.arange(n), "last": n}, executor=0, n=[1, 3])
    assert np.array_equal(found["t"], [[0, np.nan, np.nan], [0, 1, 2]], equal_nan=True)


def test_labelled_results_keep_their_axes():
    def run(x):
        return xarray.DataArray([x, 2 * x], dims="leg", coords={"leg": ["left", "right"]}, attrs={"units": "N"})

    found = swept(run, executor=0, x=[1.0, 2.0])
    assert found["result"].sel(x=2.0, leg="right").item() == 4.0
    assert found["result"].attrs["units"] == "N"


def test_cells_of_another_kind_are_errors():
    found = swept(lambda x: "text" if x else 1.0, executor=0, x=[0, 1])
    assert found["error"].values[0] == "" and "result has the axes" in found["error"].values[1]
    found = swept(lambda x: {"error": 1.0}, executor=0, x=[0])
    assert "'error' is a variable of the sweep itself" in found["error"].item()
    found = swept(lambda x: object(), executor=0, x=[0])
    assert "the function returned object" in found["error"].item()


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        ({}, "a sequence of values"),
        ({"mu": 0.3}, "a sequence of values"),
        ({"mu": []}, "cannot be coordinates"),
        ({"mu": [[1.0]]}, "cannot be coordinates"),
        ({"mu": [object()]}, "look it up"),
        ({"mu": [0.1, 0.1]}, "come once"),
        ({"mu": [0.1, np.nan]}, "finite"),
        ({"error": [1]}, "another name"),
        ({"mu": [0.1], "executor": -1}, "executor"),
        ({"mu": [0.1], "executor": "fast"}, "executor"),
        ({"mu": [0.1], "progress": 3}, "progress"),
    ],
)
def test_bad_input(grid, message):
    with pytest.raises(nga.SceneError, match=message):
        nga.sweep(sweep_functions.ball, **{"executor": 0, "progress": False} | grid)


def test_a_file_of_another_sweep_is_refused(tmp_path):
    path = tmp_path / "runs.nc"
    path.write_text("no netCDF")
    with pytest.raises(nga.SceneError, match="no file of a sweep"):
        swept(sweep_functions.ball, executor=0, save_to=path, **GRID)
    path.unlink()
    swept(sweep_functions.dangerous, executor=0, save_to=path, x=[0], folder=str(tmp_path))
    with pytest.raises(nga.SceneError, match="is of another sweep"):
        swept(sweep_functions.ball, executor=0, save_to=path, **GRID)
    with pytest.raises(nga.SceneError, match="with another folder"):
        swept(sweep_functions.dangerous, executor=0, save_to=path, x=[0], folder="/tmp")


def test_what_cannot_be_written_is_known_before_anything_runs(tmp_path):
    with pytest.raises(nga.NotWritten, match="cannot write"):
        swept(sweep_functions.ball, executor=0, save_to=tmp_path / "gone" / "runs.nc", **GRID)


def test_without_xarray_nothing_runs(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match=r"nga.sweep needs xarray: pip install 'ngalpha-pin\[sweep\]'"):
        swept(sweep_functions.ball, executor=0, **GRID)


@pytest.mark.long
def test_drops_on_a_cluster_with_a_killed_worker(tmp_path):
    distributed = pytest.importorskip("distributed")
    pytest.importorskip("example_robot_data")
    seeds = range(20)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        found = swept(sweep_functions.drop, executor=client.get_executor(), seed=seeds, folder=str(tmp_path))
    serial = swept(sweep_functions.drop, executor=0, seed=seeds, folder=str(tmp_path))
    assert (tmp_path / "killed").exists() and (found["error"] == "").all()
    assert found.drop_vars("seconds").identical(serial.drop_vars("seconds"))
