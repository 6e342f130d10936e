"""The one place that imports MuJoCo: a file becomes its compiled model, whose arrays the other readers take."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError

INSTALL = "MJCF files are read by MuJoCo's compiler: pip install 'ngalpha-pin[mjcf]'"


def mujoco() -> Any:
    """The module of MuJoCo.

    Raises:
        SceneError: it is not installed.
    """
    try:
        import mujoco as module
    except ImportError as error:
        raise SceneError(INSTALL) from error
    return module


def compiled(path: str | os.PathLike[str]) -> tuple[Any, list[str]]:
    """The `mujoco.MjModel` of a file, and what its compiler warns of.

    Raises:
        SceneError: the file is missing, MuJoCo is not installed, or its compiler refuses the file.
    """
    path = checks.path("path of an MJCF file", path).resolve()
    if not path.is_file():
        raise SceneError(f"no MJCF file at {path}")
    module = mujoco()
    said: list[str] = []
    before = module.get_mju_user_warning()
    module.set_mju_user_warning(said.append)  # which otherwise go to a file in the folder one is in
    try:
        return module.MjModel.from_xml_path(str(path)), said
    except ValueError as error:
        if "'mujocoinclude'" in str(error):
            raise SceneError(f"{path.name} is a part of MJCF files, which include it: read one of these") from error
        raise SceneError(f"{path.name} cannot be read: {error}") from error
    finally:
        module.set_mju_user_warning(before)


class Names:
    """Names of the objects of a compiled model; those without one are called after their kind or their body.

    Args:
        m: the compiled model.
    """

    def __init__(self, m: Any):
        kind = mujoco().mjtObj
        self._m, self._module = m, mujoco()
        self.bodies = ["world", *self._of(kind.mjOBJ_BODY, range(1, m.nbody), lambda i: f"body{i}")]
        self.joints = self._of(
            kind.mjOBJ_JOINT, range(m.njnt), lambda i: f"{self.bodies[m.jnt_bodyid[i]]}_joint{self._place(i)}"
        )
        self.geoms = self._of(
            kind.mjOBJ_GEOM, range(m.ngeom), lambda i: f"{self.bodies[b := m.geom_bodyid[i]]}_{i - m.body_geomadr[b]}"
        )
        self.sites = self._of(kind.mjOBJ_SITE, range(m.nsite), lambda i: f"site{i}")
        self.equalities = self._of(kind.mjOBJ_EQUALITY, range(m.neq), lambda i: f"equality{i}")
        self.tendons = self._of(kind.mjOBJ_TENDON, range(m.ntendon), lambda i: f"tendon{i}")
        self.actuators = self._of(kind.mjOBJ_ACTUATOR, range(len(m.actuator_trntype)), lambda i: f"actuator{i}")
        self.keys = self._of(kind.mjOBJ_KEY, range(m.nkey), lambda i: f"key{i}")

    def _place(self, joint: int) -> str:
        body = self._m.jnt_bodyid[joint]
        return "" if self._m.body_jntnum[body] == 1 else str(joint - self._m.body_jntadr[body])

    def _of(self, kind: Any, indices: range, otherwise: Any) -> list[str]:
        given = [self._module.mj_id2name(self._m, kind, i) for i in indices]
        taken = {name for name in given if name}
        names = []
        for i, name in zip(indices, given, strict=True):
            name = name or otherwise(i)
            while not given[i - indices.start] and name in taken:
                name += "_"
            taken.add(name)
            names.append(name)
        return names


def pose(position: np.ndarray, quaternion: np.ndarray) -> pin.SE3:
    """A pose from a position, shape (3,), and MuJoCo's quaternion (w, x, y, z)."""
    w, x, y, z = (float(number) for number in quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(position, dtype=float))


def one_of(kind: Any, *kinds: Any) -> bool:
    """Whether a number of a compiled model is one of some members of an enumeration, which do not equal it."""
    return int(kind) in {int(k) for k in kinds}


# what the flag "constraint" switches off as well
CONSTRAINTS = ("CONTACT", "EQUALITY", "FRICTIONLOSS", "LIMIT")


def disabled(m: Any, flag: str) -> bool:
    """A flag of <option><flag/></option> switches something off, e.g. "GRAVITY"."""
    flags = (flag, "CONSTRAINT") if flag in CONSTRAINTS else (flag,)
    return any(bool(m.opt.disableflags & getattr(mujoco().mjtDisableBit, f"mjDSBL_{f}")) for f in flags)
