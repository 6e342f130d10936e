"""A trajectory in a file of numpy's npz format."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from ngalpha_pin.errors import SceneError
from ngalpha_pin.results.records import Chosen, Impacts, Kept
from ngalpha_pin.results.replay import ConstraintMotion
from ngalpha_pin.scene.serialization import scene_from_dict, scene_to_dict
from ngalpha_pin.system.state import State

if TYPE_CHECKING:
    from ngalpha_pin.results.trajectory import Trajectory

FORMAT = 6
ARRAYS = (
    "t", "q", "v", "a", "contact_columns", "P_N", "la_N", "La_N", "P_F", "la_F", "La_F",
    "la_g", "La_g", "la_gamma", "La_gamma", "tau_f", "P_f", "slots", "slot_ends", "n_iter", "solver_path",
)  # fmt: skip


def write(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """Write a trajectory, its final state and its scene."""
    chosen = trajectory.chosen
    header = {
        "format": FORMAT, "method": trajectory.method, "dt": trajectory.dt, "success": trajectory.success,
        "message": trajectory.message, "constraint_names": trajectory.constraint_names, "n_g": trajectory.n_g,
        "friction_names": trajectory.friction_names, "conserved": trajectory.energy.conserved,
        "has_forces": bool(trajectory.scene.forces) if trajectory.kept is None else trajectory.kept.has_forces,
        "contact_names": trajectory.contact_names,
        "friction_rows": [[s.start, s.stop] for s in trajectory.friction_rows],
        "scene": scene_to_dict(trajectory.scene), "chosen": None if chosen is None else chosen.to_header(),
    }  # fmt: skip
    arrays: dict[str, Any] = {"header": np.array(json.dumps(header))}
    arrays |= {name: getattr(trajectory, name) for name in ARRAYS}
    # what needs functions of the user's own is written down
    arrays |= {f"constraint.{name}": value for name, value in trajectory.constraint_motion._asdict().items()}
    arrays["elastic"] = trajectory.energy.elastic
    arrays |= {f"state.{name}": value for name, value in trajectory.final_state.to_arrays().items()}
    arrays |= {f"impacts.{name}": value for name, value in trajectory.impacts._asdict().items()}
    with open(path, "wb") as file:
        np.savez_compressed(file, **arrays)


def read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The fields of the trajectory in a file.

    Raises:
        SceneError: the file is missing or is not a trajectory.
    """
    try:
        with np.load(path) as file:
            content = {name: file[name] for name in file.files}
        header = json.loads(str(content["header"]))
        version = header["format"]
    except (OSError, ValueError, KeyError, TypeError, EOFError, AttributeError, BadZipFile) as error:
        raise SceneError(f"{path} cannot be read as a trajectory: {error!r}") from error
    if version != FORMAT:
        raise SceneError(f"{path} has format {version}, this version reads {FORMAT}")
    state = {name[6:]: value for name, value in content.items() if name.startswith("state.")}
    motion = ConstraintMotion(*(content[f"constraint.{name}"] for name in ConstraintMotion._fields))
    return {
        **{name: header[name] for name in ("method", "dt", "success", "message", "n_g")},
        **{name: tuple(header[name]) for name in ("contact_names", "constraint_names", "friction_names")},
        **{name: content[name] for name in ARRAYS},
        "scene": scene_from_dict(header["scene"]),
        "friction_rows": tuple(slice(*pair) for pair in header["friction_rows"]),
        "chosen": None if header["chosen"] is None else Chosen.from_header(header["chosen"]),
        "impacts": Impacts(**{name: content[f"impacts.{name}"] for name in Impacts._fields}),
        "final_state": State.from_arrays(state),
        "kept": Kept(motion, content["elastic"], header["conserved"], header.get("has_forces", True)),
    }
