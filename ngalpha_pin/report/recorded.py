"""A recorded motion as the reference of a report: a trajectory file, or a CSV file with names."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError
from ngalpha_pin.references.integration import Motion
from ngalpha_pin.results.trajectory import Trajectory

from .cases import Case
from .points import MaterialPoints, largest_distance

TIMES = ("t", "time", "t [s]", "time [s]")
FREE = ("x", "y", "z", "qx", "qy", "qz", "qw")


def compared_with(case: Case, path: Path) -> Case:
    """The case from the start of a recording to its end, with the recording as its reference.

    Between two samples the motion is interpolated; what that may be wrong by is the uncertainty of the reference.

    Args:
        case: with the scene that was recorded; its own start is not used.
        path: of a trajectory (.npz) or of a CSV file with a column "t" [s] and one for every coordinate, see `columns`.

    Raises:
        SceneError: the file cannot be read, or does not fit the scene.
    """
    scene = case.start()[0]
    if scene.beams:
        raise SceneError("--compare: recordings of beams are not read")
    model = scene.model
    t, q, v = _trajectory(path, model) if path.suffix == ".npz" else _table(path, model)
    if len(t) < 3 or not (np.diff(t) > 0).all():
        raise SceneError(f"{path}: at least three samples are needed, at increasing times")
    t = t - t[0]

    def at(times: np.ndarray) -> Motion:
        return _interpolated(model, t, q, v, np.asarray(times, dtype=float))

    every = _interpolated(model, t[::2], q[::2], v[::2], t)[0]
    points = MaterialPoints(scene)
    doubt = largest_distance(points.positions(q), points.positions(every)) / 4  # lines are of second order
    end = min(case.t_end, float(t[-1]))
    start = (scene, q[0], v[0])
    kind = f"recorded motion {path.name}, {len(t)} samples to {t[-1]:g} s"
    return replace(
        case, start=lambda: start, t_end=end, reference=at, smooth=None, kind=kind, doubt=doubt, quick_end=np.inf
    )


def columns(model: pin.Model) -> list[str]:
    """Names of the columns of a CSV file: "joint", or "joint.x" to "joint.qw" of a free one, "joint.0" of others."""
    found = []
    for j in range(1, model.njoints):
        n, name = model.nqs[j], model.names[j]
        if n == 1:
            found.append(name)
        elif model.joints[j].shortname() == "JointModelFreeFlyer":
            found += [f"{name}.{part}" for part in FREE]
        else:
            found += [f"{name}.{k}" for k in range(n)]
    return found


def _trajectory(path: Path, model: pin.Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    run = Trajectory.load(path)
    if list(run.scene.model.names) != list(model.names) or run.q.shape[1] != model.nq:
        raise SceneError(f"{path} was recorded with other joints: {', '.join(list(run.scene.model.names)[1:][:8])}")
    return run.t, run.q, run.v


def _table(path: Path, model: pin.Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, configurations and velocities; velocities from differences, as a table has none."""
    wanted = columns(model)
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = list(csv.reader(file))
        values = np.array([[float(cell) for cell in row] for row in rows if row])
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise SceneError(f"{path} cannot be read as a table of numbers with a line of names: {error}") from error
    names = [name.strip() for name in header]
    time = next((name for name in names if name.lower() in TIMES), None)
    missing = [name for name in wanted if name not in names]
    if time is None or missing or values.ndim != 2 or values.shape[1] != len(names):
        lacks = missing[0] if missing else "t" if time is None else "some numbers"
        raise SceneError(f"{path} lacks {lacks!r}; columns: t, {', '.join(wanted)}")
    q = values[:, [names.index(name) for name in wanted]]
    q = np.array([pin.normalize(model, row) if not pin.isNormalized(model, row, 1e-9) else row for row in q])
    t = values[:, names.index(time)]
    steps = np.array([pin.difference(model, a, b) for a, b in zip(q[:-1], q[1:], strict=True)])
    rates = steps / np.diff(t)[:, None]
    ends = 1.5 * rates[[0, -1]] - 0.5 * rates[[min(1, len(rates) - 1), max(len(rates) - 2, 0)]]
    v = np.vstack((ends[:1], 0.5 * (rates[1:] + rates[:-1]), ends[1:]))
    return t, q, v


def _interpolated(model: pin.Model, t: np.ndarray, q: np.ndarray, v: np.ndarray, times: np.ndarray) -> Motion:
    """Configurations along geodesics and velocities along lines; NaN outside of the recording."""
    i = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    part = (times - t[i]) / (t[i + 1] - t[i])
    inside = (times >= t[0] - 1e-9) & (times <= t[-1] + 1e-9)
    known = [pin.interpolate(model, q[k], q[k + 1], float(s)) for k, s in zip(i, np.clip(part, 0, 1), strict=True)]
    found_q = np.where(inside[:, None], np.array(known).reshape(len(times), model.nq), np.nan)
    found_v = (1 - part[:, None]) * v[i] + part[:, None] * v[i + 1]
    return found_q, np.where(inside[:, None], found_v, np.nan)
