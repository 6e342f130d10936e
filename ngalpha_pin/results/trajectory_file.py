"""A trajectory in a file of numpy's npz format."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from ngalpha_pin.errors import SceneError
from ngalpha_pin.results.archive import read_archive, write_archive
from ngalpha_pin.results.energy_balance import conserved, elastic_energy
from ngalpha_pin.results.events import Event
from ngalpha_pin.results.recorded import Recorded
from ngalpha_pin.results.records import Chosen, Impacts, Kept
from ngalpha_pin.results.replay import ConstraintMotion
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.scene.serialization import scene_from_dict, scene_to_dict
from ngalpha_pin.system.state import State

FORMAT = 8
ARRAYS = (
    "t", "q", "v", "a", "contact_columns", "P_N", "la_N", "La_N", "P_F", "la_F", "La_F",
    "la_g", "La_g", "la_gamma", "La_gamma", "adhesion", "tau", "tau_step",
    "tau_f", "P_f", "slots", "slot_ends", "n_iter", "solver_path",
)  # fmt: skip


def write(trajectory: Recorded, path: str | os.PathLike[str]) -> None:
    """Write a trajectory, its final state and its scene; of one with parts, these and the scene of the whole."""
    first, *others = trajectory.parts or (trajectory,)
    header, arrays = _content(first)
    header |= {"format": FORMAT, "others": [], "changes": [list(change) for change in trajectory.changes]}
    for i, part in enumerate(others, 1):
        of_part, own = _content(part)
        header["others"].append(of_part)
        arrays |= {f"{i}.{name}": value for name, value in own.items()}
    if others:
        header["whole"] = scene_to_dict(trajectory.scene)
    write_archive(path, header, arrays)


def _content(trajectory: Recorded) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and arrays of a run of one scene."""
    chosen, acts = trajectory.chosen, trajectory.scene.has_functions
    header = {
        "method": trajectory.method, "dt": trajectory.dt, "success": trajectory.success,
        "message": trajectory.message, "constraint_names": trajectory.constraint_names, "n_g": trajectory.n_g,
        "friction_names": trajectory.friction_names, "conserved": conserved(trajectory),
        "has_forces": acts if trajectory.kept is None else trajectory.kept.has_forces,
        "contact_names": trajectory.contact_names,
        "friction_rows": [[s.start, s.stop] for s in trajectory.friction_rows],
        "scene": scene_to_dict(trajectory.scene, trajectory.t),
        "chosen": None if chosen is None else chosen.to_header(),
    }  # fmt: skip
    arrays: dict[str, np.ndarray] = {name: getattr(trajectory, name) for name in ARRAYS}
    # what needs functions of the user's own is written down
    arrays |= {f"constraint.{name}": value for name, value in trajectory.constraint_motion._asdict().items()}
    arrays["elastic"] = elastic_energy(trajectory)
    arrays |= {f"state.{name}": value for name, value in trajectory.final_state.to_arrays().items()}
    arrays |= {f"impacts.{name}": value for name, value in trajectory.impacts._asdict().items()}
    if trajectory.entry is not None:
        arrays |= {f"entry.{name}": value for name, value in trajectory.entry._asdict().items()}
    return header, arrays


class Content(NamedTuple):
    """What is in a file.

    Attributes:
        parts: fields of the trajectory of every part.
        scene: of the whole, where there are several parts.
        changes: of the scene.
    """

    parts: list[dict[str, Any]]
    scene: Scene | None
    changes: tuple[Event, ...]


def read(path: str | os.PathLike[str]) -> Content:
    """The content of a file.

    Raises:
        SceneError: the file is missing, is not a trajectory, or is damaged.
    """
    header, content = read_archive(path, "a trajectory", FORMAT)
    parts = [_fields(header, {name: x for name, x in content.items() if not name[0].isdigit()})]
    for i, own in enumerate(header["others"], 1):
        start = f"{i}."
        parts.append(_fields(own, {name[len(start) :]: x for name, x in content.items() if name.startswith(start)}))
    scene = scene_from_dict(header["whole"]) if "whole" in header else None
    return Content(parts, scene, tuple(Event(*change) for change in header["changes"]))


def _fields(header: dict[str, Any], content: dict[str, np.ndarray]) -> dict[str, Any]:
    """The fields of a trajectory of one scene."""
    state = {name[6:]: value for name, value in content.items() if name.startswith("state.")}
    motion = ConstraintMotion(*(content[f"constraint.{name}"] for name in ConstraintMotion._fields))
    impacts, entry = (
        Impacts(**{name: content[f"{of}.{name}"] for name in Impacts._fields})
        if of == "impacts" or f"{of}.t" in content
        else None
        for of in ("impacts", "entry")
    )
    return {
        **{name: header[name] for name in ("method", "dt", "success", "message", "n_g")},
        **{name: tuple(header[name]) for name in ("contact_names", "constraint_names", "friction_names")},
        **{name: content[name] for name in ARRAYS},
        "scene": scene_from_dict(header["scene"]),
        "friction_rows": tuple(slice(*pair) for pair in header["friction_rows"]),
        "chosen": None if header["chosen"] is None else Chosen.from_header(header["chosen"]),
        "impacts": impacts,
        "entry": entry,
        "final_state": State.from_arrays(state),
        "kept": Kept(motion, content["elastic"], header["conserved"], header.get("has_forces", True)),
    }


@contextmanager
def damaged(path: str | os.PathLike[str]) -> Iterator[None]:
    """What fails in here is for the content of the file.

    Raises:
        SceneError: something does.
    """
    try:
        yield
    except SceneError as error:
        if str(path) in str(error):
            raise
        raise SceneError(f"{path} cannot be read as a trajectory: {error}") from error
    except Exception as error:  # what is missing or has another type or shape fails where it is used
        raise SceneError(f"{path} cannot be read as a trajectory: its content is damaged: {error!r}") from error


def check_sizes(trajectory: Recorded) -> None:
    """The arrays of a trajectory fit each other and the scene.

    Raises:
        SceneError: one does not.
    """
    n, k, m = len(trajectory.t), len(trajectory.contact_names), trajectory.P_F.shape[1]
    system, b, f = trajectory.system, len(trajectory.constraint_names), len(trajectory.friction_names)
    widths = {"q": system.nq, "v": system.nv, "a": system.nv, "tau_f": f, "P_f": f, "adhesion": k}
    widths |= {f"{name}_N": k for name in ("P", "la", "La")} | {f"{name}_F": m for name in ("P", "la", "La")}
    n_g = trajectory.n_g
    widths |= {f"{la}_{kind}": w for la in ("la", "La") for kind, w in (("g", n_g), ("gamma", b - n_g))}
    widths |= dict.fromkeys(("tau", "tau_step"), system.tree.nv if trajectory.tau.size else 0)
    wanted: dict[str, tuple[int, ...]] = {name: (n, width) for name, width in widths.items()}
    wanted |= dict.fromkeys(("t", "slot_ends", "n_iter", "solver_path"), (n,)) | {"contact_columns": (k,)}
    for name, shape in wanted.items():
        if getattr(trajectory, name).shape != shape:
            raise SceneError(f"{name} has the shape {getattr(trajectory, name).shape}, expected {shape}")
    ends, contacts = [rows.stop for rows in trajectory.friction_rows], range(system.contacts.n)
    if len(ends) != k or not all(int(i) in contacts for i in trajectory.contact_columns):
        raise SceneError("its contacts are not those of its scene")
    features = trajectory.slot_ends
    if (ends and max(ends) > m) or (np.diff(features) < 0).any() or features[-1] != len(trajectory.slots):
        raise SceneError("parts of friction or of features end where there is nothing")
