"""How a robot of example-robot-data ends that a user takes as it comes: `./run NAME`, and the script of README.md.

Run with `python benchmarks/robot_defaults.py NAME...`; `python benchmarks/all_robots.py` makes a table of all of them.
"""

from __future__ import annotations

import re
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga
from ngalpha_pin.cli import targets
from ngalpha_pin.robots._descriptions import file_of

README = Path(__file__).parents[1] / "README.md"
T_END, DT = 0.4, 1e-3  # the landing: shorter than `./run` (2 s) and the script (0.5 s) are of themselves
STILL = 0.1  # speed of every coordinate that counts as rest [m/s or rad/s]
ON_GROUND = re.compile(r"/ground(\[\d+\])?$")  # a pair of convex shapes touches at numbered places
UPRIGHT = 20.0  # tilt of the root up to which a robot stands [deg]


def run_defaults(name: str, t_end: float = T_END) -> dict[str, Any]:
    """What `ngalpha-pin run NAME` makes of a robot, and how that ends."""
    scene, q0, v0 = targets.load(name, targets.Options())
    root = "free, on the ground" if "ground" in scene.added else "free" if _free(scene.model) else "fixed"
    trajectory = nga.simulate(scene, q0, v0, t_end=t_end, dt=DT, on_failure="stop")
    return {"root": root, "./run ends": ending(trajectory)}


def run_readme(name: str, t_end: float = T_END) -> dict[str, Any]:
    """How the script of the README ends with the file of a robot, without drawing it.

    As the README says, a robot on a fixed base has no free flyer and no ground.
    """
    found = re.search(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    script = found.group(1).replace("robot.urdf", str(file_of(name))).replace("t_end=0.5", f"t_end={t_end}")
    lines = [line for line in script.splitlines() if "viz" not in line and "print" not in line]
    if not targets.moves_freely(str(file_of(name))):
        lines = [line for line in lines if not line.startswith(("scene.add_plane", "scene.add_contact"))]
        script = "\n".join(lines).replace(", root_joint=pin.JointModelFreeFlyer()", "")
        lines = re.sub(r"scene\.place_on\(.*\)", "scene.reference()", script).splitlines()
    names: dict[str, Any] = {}
    exec("\n".join(lines), names)
    return {"README ends": ending(names["trajectory"])}


def ending(trajectory: nga.Trajectory) -> str:
    """In words: stands, lies, moves on the ground or hangs, or is in the air; and what is wrong."""
    model, audit = trajectory.scene.model, trajectory.audit()
    if not trajectory.success:
        return f"stops at {trajectory.t[-1]:.3g} s: {trajectory.message}"
    wrong = [f"penetrates {audit.penetration:.1g} m"] if audit.penetration > 1e-8 else []
    fastest = float(np.abs(trajectory.v[-1]).max(initial=0.0))
    still = fastest < STILL
    moving = f"moves, {fastest:.2g} at most"
    if not _free(model):
        return ", ".join([f"hangs, {'at rest' if still else moving}", *wrong])
    on_ground = np.array([bool(ON_GROUND.search(name)) for name in trajectory.contact_names], dtype=bool)
    force = trajectory.la_N[-1][on_ground].sum()
    if not trajectory.P_N[-1][on_ground].any():
        return ", ".join(["bounces on the ground" if trajectory.P_N[:, on_ground].any() else "in the air", *wrong])
    weight = sum(float(inertia.mass) for inertia in model.inertias) * float(np.abs(model.gravity.linear[2]))
    if still and abs(force / weight - 1.0) > 0.1:
        wrong.append(f"the ground carries {force / weight:.2g} of the weight")
    tilt = np.degrees(np.arccos(np.clip(pin.Quaternion(trajectory.q[-1][3:7]).matrix()[2, 2], -1.0, 1.0)))
    posture = "upright" if tilt < UPRIGHT else f"tilted by {tilt:.0f} deg"
    return ", ".join([f"on the ground, {posture}, {'at rest' if still else moving}", *wrong])


def _free(model: pin.Model) -> bool:
    return model.njoints > 1 and model.nvs[1] == 6


def one(what: str, name: str) -> dict[str, Any]:
    """The cells of one of them, "run" or "readme", with the reason where it refuses the robot."""
    run, cell = {"run": (run_defaults, "./run ends"), "readme": (run_readme, "README ends")}[what]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return {"robot": name} | run(name)
        except nga.NgalphaError as error:
            return {"robot": name, cell: f"refused: {' '.join(str(error).split())}"}


if __name__ == "__main__":
    for robot in sys.argv[1:]:
        print(one("run", robot) | one("readme", robot), flush=True)
