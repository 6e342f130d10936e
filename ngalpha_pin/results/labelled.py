"""A trajectory with names for its axes, as an xarray Dataset or a pandas DataFrame."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.common.optional import require
from ngalpha_pin.scene.joints import linear_coordinates

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded
    from ngalpha_pin.scene.scene import Scene

INSTALL = "pip install 'ngalpha-pin[data]'"
# coordinates of joints that have several: by nq and nv
SEVERAL_Q = {7: ("x", "y", "z", "qx", "qy", "qz", "qw"), 4: ("x", "y", "cos", "sin"), 2: ("cos", "sin")}
SEVERAL_V = {6: ("vx", "vy", "vz", "wx", "wy", "wz"), 3: ("vx", "vy", "wz"), 1: ("",)}
FORCES = {"la": "force", "P": "percussion of the step", "La": "impulsive part of the percussion"}
OF_MOMENTS = "; N m instead of N for limits of joints that turn and for drilling friction"


def coordinate_names(scene: Scene) -> tuple[list[str], list[str]]:
    """Names of the coordinates of q and of v: the joint, with its part where it has several."""
    q: list[str] = []
    v: list[str] = []
    model = scene.model
    for j in range(1, model.njoints):
        name, nq, nv = model.names[j], model.nqs[j], model.nvs[j]
        ends_q: tuple[str, ...]
        ends_v: tuple[str, ...]
        kind = model.joints[j].shortname()
        if nq == nv == 1:
            ends_q, ends_v = ("",), ("",)
        elif kind in ("JointModelFreeFlyer", "JointModelPlanar") or (nq, nv) == (2, 1):
            ends_q, ends_v = SEVERAL_Q[nq], SEVERAL_V[nv]
        elif kind == "JointModelSpherical":
            ends_q, ends_v = SEVERAL_Q[7][3:], SEVERAL_V[6][3:]
        else:
            ends_q, ends_v = (tuple(map(str, range(n))) for n in (nq, nv))
        q += [f"{name}.{end}" if end else name for end in ends_q]
        v += [f"{name}.{end}" if end else name for end in ends_v]
    for name, beam in scene.beams.items():
        points = [f"{name}.{axis}{i}" for i in range(beam.nv // 2) for axis in "xy"]
        q += points
        v += points
    return q, v


def units(scene: Scene) -> tuple[list[str], list[str]]:
    """Units of the coordinates of q and of v; those of quaternions, cosines and sines are 1."""
    model = scene.model
    slides, lengths, _ = linear_coordinates(model)
    q = np.full(model.nq, "1", dtype="U5")
    q[lengths] = "m"
    for j in range(1, model.njoints):
        if model.nqs[j] == model.nvs[j]:
            turns = ~slides[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]]
            q[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]][turns] = "rad"
    beams = sum(beam.nv for beam in scene.beams.values())
    return q.tolist() + beams * ["m"], np.where(slides, "m/s", "rad/s").tolist() + beams * ["m/s"]


def to_xarray(trajectory: Recorded, kinematics: bool = False) -> Any:
    """See `Trajectory.to_xarray`."""
    xarray = require("xarray", "to_xarray", INSTALL)
    run = trajectory
    coords = _axes(run)
    variables = _motion(run) | _of_contacts(run, kinematics) | _of_rows(run, len(coords["velocity"]))
    used = {dim for dims, *_ in variables.values() for dim in ((dims,) if isinstance(dims, str) else dims)}
    coords = {n: x for n, x in coords.items() if n in used or (isinstance(x, tuple) and x[0] in used)}
    attrs = {
        "model": run.scene.model.name,
        "method": run.method,
        "dt": run.dt,
        "success": int(run.success),
        "message": run.message,
        "pinocchio": pin.__version__,
    }
    return xarray.Dataset(variables, coords, attrs)


def _axes(run: Recorded) -> dict[str, Any]:
    """What the entries of every axis are called, and the units of coordinates."""
    names_q, names_v = coordinate_names(run.scene)
    units_q, units_v = units(run.scene)
    n_F = max((s.stop - s.start for s in run.friction_rows), default=0)
    return {
        "time": ("time", run.t, {"units": "s"}),
        "coordinate": names_q,
        "unit_q": ("coordinate", units_q),
        "velocity": names_v,
        "unit_v": ("velocity", units_v),
        "contact": list(run.contact_names),
        "direction": np.arange(n_F),
        "constraint": list(run.constraint_names[: run.n_g]),
        "constraint_rate": list(run.constraint_names[run.n_g :]),
        "dry_friction": list(run.friction_names),
    }


def _motion(run: Recorded) -> dict[str, Any]:
    q, v = ("time", "coordinate"), ("time", "velocity")
    return {
        "q": (q, run.q, {"units": "see unit_q", "long_name": "configuration"}),
        "v": (v, run.v, {"units": "see unit_v", "long_name": "velocity"}),
        "a": (v, run.a, {"units": "unit_v per s", "long_name": "acceleration"}),
        "n_iter": ("time", run.n_iter, {"units": "1", "long_name": "iterations of the step"}),
        "solved_by": ("time", run.solver_path.astype(str), {"long_name": "rung of the solver ladder"}),
    }


def _of_contacts(run: Recorded, kinematics: bool) -> dict[str, Any]:
    """Forces and percussions of the contacts, and their motion where it is wanted."""
    contact, friction = ("time", "contact"), ("time", "contact", "direction")
    variables: dict[str, Any] = {}
    for start, what in FORCES.items():
        unit = {"units": "N" if start == "la" else "N s", "comment": f"units{OF_MOMENTS}"}
        variables[f"{start}_N"] = contact, getattr(run, f"{start}_N"), unit | {"long_name": f"normal {what}"}
        rows = _by_contact(run, getattr(run, f"{start}_F"))
        variables[f"{start}_F"] = friction, rows, unit | {"long_name": f"friction, {what}"}
    if checks.flag("kinematics", kinematics):
        motion = run.contact_motion
        variables["g_N"] = contact, motion.g_N, {"units": "m", "long_name": "gap"}
        variables["g_N_dot"] = contact, motion.g_N_dot, {"units": "m/s", "long_name": "rate of the gap"}
        slip = _by_contact(run, motion.gamma_F)
        variables["gamma_F"] = friction, slip, {"units": "m/s", "long_name": "slip velocity"}
    return variables


def _of_rows(run: Recorded, nv: int) -> dict[str, Any]:
    """Forces of constraints, of dry friction in joints and of what was held, where there are any."""
    variables: dict[str, Any] = {}
    for name, dim, array, in_units in (
        ("la_g", "constraint", run.la_g, "N or N m"),
        ("La_g", "constraint", run.La_g, "N s or N m s"),
        ("la_gamma", "constraint_rate", run.la_gamma, "N or N m"),
        ("La_gamma", "constraint_rate", run.La_gamma, "N s or N m s"),
        ("tau_f", "dry_friction", run.tau_f, "N m or N"),
        ("P_f", "dry_friction", run.P_f, "N m s or N s"),
        ("tau", "velocity", _wide(run.tau, nv), "N m or N"),
    ):
        if array.shape[1]:
            variables[name] = ("time", dim), array, {"units": in_units}
    return variables


def to_dataframe(trajectory: Recorded, kinematics: bool = False) -> Any:
    """See `Trajectory.to_dataframe`."""
    pandas = require("pandas", "to_dataframe", INSTALL)
    require("xarray", "to_dataframe", INSTALL)
    dataset = to_xarray(trajectory, kinematics)
    columns: dict[str, Any] = {}
    said: dict[str, str] = {}
    for name, variable in dataset.data_vars.items():
        others = [dataset[dim].values for dim in variable.dims[1:]]
        for place in np.ndindex(*variable.shape[1:]):
            ends = [str(labels[i]) for labels, i in zip(others, place, strict=True)]
            series = (slice(None), *place)
            values = variable.values[series]
            if len(place) == 2 and not np.isfinite(values).any():  # a contact without this row of friction
                continue
            column = _free(f"{name}[{', '.join(ends)}]" if ends else str(name), columns)
            columns[column] = values
            said[column] = _unit(dataset, str(name), place)
    frame = pandas.DataFrame(columns, index=pandas.Index(dataset["time"].values, name="time"))
    frame.attrs = dataset.attrs | {"units": said}
    return frame


def _free(column: str, columns: dict[str, Any]) -> str:
    """Rows of one constraint have one name; the later ones are numbered."""
    found, i = column, 1
    while found in columns:
        i += 1
        found = f"{column} {i}"
    return found


def _unit(dataset: Any, name: str, place: tuple[int, ...]) -> str:
    if name == "q":
        return str(dataset["unit_q"].values[place])
    if name in ("v", "a"):
        return str(dataset["unit_v"].values[place]) + ("^2" if name == "a" else "")
    return str(dataset[name].attrs.get("units", ""))


def _wide(tau: np.ndarray, nv: int) -> np.ndarray:
    """Held forces of the tree over all velocities, those of beams zero; without any as they are."""
    return tau if not tau.shape[1] else np.pad(tau, ((0, 0), (0, nv - tau.shape[1])))


def _by_contact(run: Recorded, rows: np.ndarray) -> np.ndarray:
    """Rows of friction by contact and direction, NaN where a contact has no such row."""
    widths = [s.stop - s.start for s in run.friction_rows]
    found = np.full((len(run.t), len(widths), max(widths, default=0)), np.nan)
    for i, (place, width) in enumerate(zip(run.friction_rows, widths, strict=True)):
        found[:, i, :width] = rows[:, place]
    return found
