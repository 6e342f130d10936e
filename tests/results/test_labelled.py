"""Trajectories with names for their axes: every number is where its name says."""

import sys

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.results.labelled import coordinate_names, units

xarray = pytest.importorskip("xarray")
pandas = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def run():
    return nga.simulate(*robots.load("quadruped", height=0.01), t_end=0.06, dt=2e-3)


def test_coordinates_have_the_names_and_units_of_joints(run):
    q, v = coordinate_names(run.scene)
    assert q[:8] == [f"root_joint.{x}" for x in ("x", "y", "z", "qx", "qy", "qz", "qw")] + [run.scene.model.names[2]]
    assert v[:6] == [f"root_joint.{x}" for x in ("vx", "vy", "vz", "wx", "wy", "wz")]
    assert (len(q), len(v)) == (run.scene.model.nq, run.scene.model.nv)
    unit_q, unit_v = units(run.scene)
    assert unit_q == 3 * ["m"] + 4 * ["1"] + 12 * ["rad"]
    assert unit_v == 3 * ["m/s"] + 15 * ["rad/s"]


def test_numbers_are_where_their_names_say(run):
    found = run.to_xarray(kinematics=True)
    name = run.contact_names[2]
    assert np.array_equal(found["time"], run.t)
    assert np.array_equal(found["q"].sel(coordinate="root_joint.z"), run.q[:, 2])
    assert np.array_equal(found["la_N"].sel(contact=name), run.la_N[:, 2])
    rows = run.friction_rows[2]
    assert np.array_equal(found["la_F"].sel(contact=name), run.la_F[:, rows])
    assert np.array_equal(found["gamma_F"].sel(contact=name), run.gamma_F[:, rows])
    assert np.array_equal(found["g_N"].sel(contact=name), run.g_N[:, 2])
    assert found["la_N"].attrs["units"] == "N" and found.attrs["message"] == "reached t_end"


@pytest.mark.parametrize("name", ["four_bar", "cantilever", "tippe_top", "belt"])
def test_every_system_has_names(name):
    run = nga.simulate(*robots.load(name), t_end=2e-3, dt=1e-3)
    found, frame = run.to_xarray(), run.to_dataframe()
    q, v = coordinate_names(run.scene)
    assert len(set(q)) == run.q.shape[1] and len(set(v)) == run.v.shape[1]
    assert [len(x) for x in units(run.scene)] == [len(q), len(v)]
    if run.n_g:
        assert np.array_equal(found["la_g"], run.la_g)
        assert sum(column.startswith("la_g[") for column in frame) == run.n_g
    assert set(frame.attrs["units"]) == set(frame.columns)


def test_a_sliding_joint_has_metres_and_an_endless_one_none():
    model = pin.Model()
    for joint, name in ((pin.JointModelPX(), "slide"), (pin.JointModelRUBZ(), "wheel"), (pin.JointModelRX(), "arm")):
        model.addJoint(0, joint, pin.SE3.Identity(), name)
    scene = nga.Scene(model)
    assert coordinate_names(scene) == (["slide", "wheel.cos", "wheel.sin", "arm"], ["slide", "wheel", "arm"])
    assert units(scene) == (["m", "1", "1", "rad"], ["m/s", "rad/s", "rad/s"])


def test_netcdf_and_csv_in_one_line(run, tmp_path):
    pytest.importorskip("h5netcdf")
    run.to_xarray().to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as again:
        assert np.array_equal(again["q"], run.q)
        assert list(again["contact"].values) == list(run.contact_names)
    run.to_dataframe().to_csv(tmp_path / "run.csv")
    frame = pandas.read_csv(tmp_path / "run.csv", dtype=str).drop(columns="solved_by").astype(float)
    assert np.array_equal(frame[f"la_N[{run.contact_names[0]}]"], run.la_N[:, 0])
    assert np.array_equal(frame["v[root_joint.vz]"], run.v[:, 2])
    assert np.array_equal(frame["time"], run.t)


@pytest.mark.parametrize("name", ["xarray", "pandas"])
def test_without_the_packages_the_error_says_what_to_install(run, monkeypatch, name):
    monkeypatch.setitem(sys.modules, name, None)
    method = run.to_xarray if name == "xarray" else run.to_dataframe
    with pytest.raises(ImportError, match=rf"needs {name}: pip install 'ngalpha-pin\[data\]'"):
        method()
