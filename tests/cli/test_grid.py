"""`ngalpha-pin sweep`: grids in words, runs of every kind of target, files to go on from and tables."""

import csv
import re
import sys

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.cli import grid, targets
from ngalpha_pin.cli import main as cli

xarray = pytest.importorskip("xarray")
pytest.importorskip("h5netcdf")


def sweeps(*arguments):
    return cli.main(["sweep", *map(str, arguments)])


@pytest.fixture(autouse=True)
def here(monkeypatch):
    """In this process."""
    original = grid.sweep
    monkeypatch.setattr(grid, "sweep", lambda *args, **kwargs: original(*args, **kwargs | {"progress": False}))
    monkeypatch.setattr(grid, "_executor", lambda args: grid.nullcontext(0))


def test_grids_in_words():
    assert grid._parameter("mu=0.1:1:10") == ("mu", np.linspace(0.1, 1.0, 10).tolist())
    assert grid._parameter("e_N=0,0.5") == ("e_N", [0.0, 0.5])
    assert grid._parameter("leg=left,right") == ("leg", ["left", "right"])


@pytest.mark.parametrize("text", ["mu", "mu=", "=1", "mu=1:2:x", "mu=1:2:0", "m u=1"])
def test_bad_grids(text, capsys):
    assert sweeps("rotating_ball", "--grid", text) == 2
    assert re.search("--grid|NUMBER", capsys.readouterr().err)


def test_a_system_over_its_own_parameters_and_its_contacts(tmp_path, capsys):
    out = tmp_path / "runs.nc"
    command = ("rotating_ball", "--grid", "mu=0.2,0.4", "e_N=0,0.5", "--t-end", 0.5, "--dt", 0.01, "--out", out)
    assert sweeps(*command) == 0
    assert "4 runs, 0 without a result" in capsys.readouterr().out
    with xarray.open_dataset(out, engine="h5netcdf") as found:
        scene, q0, v0 = robots.load("rotating_ball", mu=0.4)
        run = nga.simulate(scene.varied(e_N=0.5), q0, v0, t_end=0.5, dt=0.01)
        cell = found.sel(mu=0.4, e_N=0.5)
        assert np.array_equal(cell["q"], run.q[-1])
        assert cell["impacts"] == len(run.impacts.t) > 0
        assert cell["largest_force"] == run.la_N.max()
        assert found["dt"] == 0.01
    # the same command goes on: there is nothing left
    before = out.read_bytes()
    assert sweeps(*command) == 0
    with xarray.open_dataset(out, engine="h5netcdf") as again:
        assert again["seconds"].values.tolist() == found["seconds"].values.tolist()
    assert len(before) == out.stat().st_size


def test_a_table_and_failed_runs(tmp_path, capsys):
    out = tmp_path / "runs.csv"
    assert sweeps("rotating_ball", "--grid", "height=-1,0.3", "--t-end", 0.1, "--dt", 0.01, "--out", out) == 1
    printed = capsys.readouterr().out
    assert "height=-1.0: Penetration" in printed and "2 runs, 1 without a result" in printed
    with out.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["height"] for row in rows] == ["-1.0", "0.3"]
    assert rows[0]["error"].startswith("Penetration") and rows[1]["error"] == ""
    assert float(rows[1]["penetration"]) == 0.0


def test_a_file_with_ground_and_height(capsys):
    urdf = robots.__path__[0] + "/urdf/quadruped.urdf"
    command = (urdf, "--floating", "--grid", "height=0.1,0.2", "mu=0.5,0.9", "--t-end", 0.01, "--dt", 0.01)
    assert sweeps(*command) == 0
    assert "4 runs, 0 without" in capsys.readouterr().out


def test_a_function_of_the_user(tmp_path, capsys):
    (tmp_path / "own.py").write_text(
        "from ngalpha_pin import robots\n"
        "def start(spin, kind='plain'):\n"
        "    assert kind == 'special'\n"
        "    return robots.load('rotating_ball', omega=spin)\n"
    )
    command = (f"{tmp_path / 'own.py'}:start", "--t-end", 0.02, "--dt", 0.01)
    assert sweeps(*command, "--grid", "spin=1,10", "kind=special") == 0
    assert sweeps(*command, "--grid", "colour=1,10") == 2
    assert (
        "no parameter 'colour'; known: t_end, dt, rho_inf, mu, e_N, e_F, height, spin, kind" in capsys.readouterr().err
    )


def test_what_is_said_twice_is_refused(capsys):
    assert sweeps("rotating_ball", "--grid", "mu=1,2", "--mu", 3) == 2
    assert "--mu and --grid mu=... both say it" in capsys.readouterr().err


def test_parameters_of_targets():
    assert "omega" in targets.parameters_of("rotating_ball")
    assert targets.parameters_of("no_such.urdf") == ()


def test_executors(monkeypatch, capsys):
    monkeypatch.undo()
    one = ("rotating_ball", "--grid", "mu=1,2")
    assert sweeps(*one, "--scheduler", "tcp://127.0.0.1:1", "--processes", 2) == 2
    assert "give one of them" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "dask.distributed", None)
    assert sweeps(*one, "--scheduler", "tcp://127.0.0.1:1") == 2
    assert "pip install 'ngalpha-pin[sweep]'" in capsys.readouterr().err
