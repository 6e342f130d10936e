"""Every robot of example-robot-data-loaders, dropped on the ground with its own bodies in contact: docs/robots.md.

Run with `python benchmarks/all_robots.py`, or with names to print the lines of those robots alone; a second table has
what becomes of each with the defaults of `./run` and of README.md. Each run is a process of its own with a limit of
processor time. Joints are held by a PD law; a robot with a free base falls 2 cm,
others have the ground just below them.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import robot_defaults
from robot_defaults import one

import ngalpha_pin as nga
from ngalpha_pin.collision.shapes import solid

T_END, DT, HEIGHT, MU = 0.5, 1e-3, 0.02, 0.6
KP, KD = 200.0, 10.0
PENETRATION = 1e-8  # that counts as none [m]
SINGULAR, ARMATURE = 1e12, 1e-3  # condition of the mass matrix of a body without inertia, and what its joints then get
TABLE = Path(__file__).parents[1] / "docs" / "robots.md"
DEFAULTS = ("robot", "root", "./run ends", "README ends")
COLUMNS = (
    "robot", "nv", "pairs", "left out", "most closed", "penetration [m]", "iterations mean / worst", "solved by",
    "us / step", "remark",
)  # fmt: skip
TEXT = """# Robots that fall

Every robot of `example-robot-data-loaders` with all of its collision shapes against the ground and against each other,
but for neighbours in the mechanism. Joints are held by a PD law, a robot with a free base falls {height:g} m, others
have the ground just below them; mu = {mu}, {t_end} s in steps of {dt:g} s. Pairs overlapping at the start are left out.
`python benchmarks/all_robots.py` writes this page; times are processor times of one thread of the machine it ran on.

{summary}

{table}

## With the defaults

`./run NAME` takes the robot as its file is, without a control, 0.1 m above the ground where its root moves freely; the
script of README.md holds the joints, 0.05 m above it. The loader of the robot says whether the root moves freely; for a
file of your own an SRDF beside it does, or `--floating`. On a fixed base there is no ground. After {t_default} s; at
rest means that no coordinate is faster than 0.1 m/s or rad/s. One robot alone: `python benchmarks/robot_defaults.py
NAME`.

{defaults}
"""


def dropped_robot(name: str) -> tuple[nga.Scene, np.ndarray]:
    """A robot above the ground with contact between everything that may touch.

    Raises:
        nga.SceneError: it has no collision shapes.
    """
    import example_robot_data

    robot = example_robot_data.load(name)
    if robot.collision_model.ngeoms == 0:
        raise nga.SceneError("no collision shapes")
    scene = nga.Scene(robot.model, robot.collision_model, robot.visual_model)
    q0, data = pin.normalize(robot.model, robot.q0), robot.model.createData()
    M = np.triu(pin.crba(robot.model, data, q0, pin.Convention.WORLD))
    if np.linalg.cond(M + np.triu(M, 1).T) > SINGULAR:
        free = 6 if robot.model.nvs[1] == 6 else 0
        robot.model.armature = np.concatenate((np.zeros(free), np.full(robot.model.nv - free, ARMATURE)))
    q0 = np.clip(q0, robot.model.lowerPositionLimit, robot.model.upperPositionLimit)
    pin.forwardKinematics(robot.model, data, q0)
    free = robot.model.nvs[1] == 6
    heights = []
    for geometry in scene.collision_model.geometryObjects:
        shape, pose = solid(geometry), data.oMi[geometry.parentJoint]
        if shape is not None and np.isfinite(shape.size):
            heights.append(float(pose.act(shape.native.support(-pose.rotation[2]))[2]))
    lowest = min(heights)
    if free:
        q0[2] += HEIGHT - lowest
    scene.add_plane("ground", point=(0, 0, 0 if free else lowest - HEIGHT))
    scene.set_surface("*", mu=MU)
    scene.add_contact("*", "*")
    scene.add_force(nga.JointPD(q0, KP, KD))
    return scene, q0


def run_robot(name: str, t_end: float = T_END) -> dict[str, Any]:
    """Measure one robot: the columns of its line, and "good" where it is as it should be."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene, q0 = dropped_robot(name)
        start = time.process_time()
        trajectory = nga.simulate(scene, q0, t_end=t_end, dt=DT, on_failure="stop")
    seconds, audit = time.process_time() - start, trajectory.audit()
    steps = len(trajectory.t) - 1
    remarks = (
        [f"armature of {ARMATURE} kg m^2: a body has no inertia"] if scene.model.armature.max() == ARMATURE else []
    )
    if not (audit.finite and audit.success):
        remarks.insert(0, f"stopped after {steps} steps: {audit.message}")
    elif audit.penetration > PENETRATION:
        remarks.insert(0, "penetrates")
    return {
        "robot": name,
        "nv": scene.model.nv,
        "pairs": len(scene.contacts),
        "left out": len(scene.left_out),
        "most closed": int((trajectory.P_N > 0.0).sum(axis=1).max(initial=0)),
        "penetration [m]": audit.penetration,
        "iterations mean / worst": f"{audit.n_iter_mean:.1f} / {audit.n_iter_max}",
        "solved by": ", ".join(f"{rung} {count}" for rung, count in audit.rungs.items()),
        "us / step": seconds / max(1, steps) * 1e6,
        "remark": "; ".join(remarks),
        "good": bool(audit.finite and audit.success and audit.penetration <= PENETRATION),
    }


def _in_process(name: str, limit: int, what: str = "fall") -> dict[str, Any]:
    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))

    cell = {"fall": "remark", "run": "./run ends", "readme": "README ends"}[what]
    command = [sys.executable, __file__, "--one", name, "--what", what]
    # threads that wait for each other would be counted as processor time
    one_thread = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=limited, env=one_thread)
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return {"robot": name, cell: f"not done after {limit} s"}
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if not lines:
        last = done.stderr.strip().splitlines()[-1:] or [f"ended with code {done.returncode}"]
        return {"robot": name, cell: f"not simulated: {last[0].split(': ', 1)[-1][:160]}"}
    found: dict[str, Any] = json.loads(lines[-1])
    return found


def _row(name: str, limit: int) -> dict[str, Any]:
    """All cells of a robot, of both tables."""
    return {key: value for what in ("run", "readme", "fall") for key, value in _in_process(name, limit, what).items()}


def _line(row: dict[str, Any], columns: tuple[str, ...] = COLUMNS) -> str:
    cells = [f"{row[c]:.2g}" if isinstance(row.get(c), float) else str(row.get(c, "")) for c in columns]
    return "| " + " | ".join(cells) + " |"


def _table(rows: list[dict[str, Any]], columns: tuple[str, ...] = COLUMNS) -> str:
    head = ["| " + " | ".join(columns) + " |", "|" + " --- |" * len(columns)]
    return "\n".join([*head, *(_line(row, columns) for row in rows)])


def _summary(rows: list[dict[str, Any]]) -> str:
    """What the table says in a sentence."""
    simulated, good = [r for r in rows if "good" in r], [r for r in rows if r.get("good")]
    empty, late = (sum(word in r.get("remark", "") for r in rows) for word in ("no collision shapes", "not done after"))
    failed = len(rows) - empty - late - len(simulated)
    times = sorted(r["us / step"] for r in good)
    return (
        f"Of {len(rows)} robots {empty} have no collision shapes, {failed} could not be simulated for the reason given "
        f"and {late} took too long. {len(good)} of the other {len(simulated)} reach the end, every step converged, "
        f"with penetrations of at most {max((r['penetration [m]'] for r in good), default=0.0):.1g} m; "
        f"the median of their steps takes {times[len(times) // 2] / 1e3 if times else 0.0:.2g} ms."
    )


def _rows(names: list[str], limit: int, kept: Path | None) -> list[dict[str, Any]]:
    """One row for every robot, those of a file of finished rows first."""
    finished = [json.loads(x) for x in kept.read_text().splitlines()] if kept is not None and kept.exists() else []
    rows = {row["robot"]: row for row in finished}
    for name in names:
        if name not in rows:
            rows[name] = _row(name, limit)
            print(_line(rows[name]), _line(rows[name], DEFAULTS), sep="\n", flush=True)
            if kept is not None:
                with kept.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(rows[name]) + "\n")
    return [rows[name] for name in names]


def main() -> None:
    """Print or write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="robots; by default all of them, written to docs/robots.md")
    parser.add_argument("--limit", type=int, default=600, help="processor time for each robot [s]")
    parser.add_argument("--rows", type=Path, help="file that keeps finished rows, so that a run can be taken up again")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    parser.add_argument("--what", choices=("fall", "run", "readme"), default="fall", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        of_defaults = arguments.what != "fall"
        print(json.dumps(one(arguments.what, arguments.one) if of_defaults else run_robot(arguments.one)))
        return
    from example_robot_data.robots_loader import ROBOTS

    rows = _rows(arguments.names or sorted(ROBOTS), arguments.limit, arguments.rows)
    print(_summary(rows))
    if not arguments.names:
        numbers = {"height": HEIGHT, "mu": MU, "t_end": T_END, "dt": DT, "t_default": robot_defaults.T_END}
        text = TEXT.format(**numbers, summary=_summary(rows), table=_table(rows), defaults=_table(rows, DEFAULTS))
        TABLE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
