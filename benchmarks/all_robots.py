"""Every robot of example-robot-data-loaders, dropped on the ground with its own bodies in contact: a Markdown table.

Run with `python benchmarks/all_robots.py [names ...] [--out table.md]`. Each robot runs in a process of its own with a
time limit. Joints are held by a PD law; a robot with a free base falls 2 cm, others have the ground just below them.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga
from ngalpha_pin.solids import solid

T_END, DT, HEIGHT, MU = 0.5, 1e-3, 0.02, 0.6
KP, KD = 200.0, 10.0
TIME_LIMIT = 240.0
COLUMNS = ("robot", "nv", "pairs", "left out", "penetration [m]", "iterations mean / worst", "solved by", "us / step")


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
    q0 = np.clip(q0, robot.model.lowerPositionLimit, robot.model.upperPositionLimit)
    pin.forwardKinematics(robot.model, data, q0)
    free = robot.model.nvs[1] == 6
    heights = []
    for geometry in scene.collision_model.geometryObjects:
        shape, pose = solid(geometry), data.oMi[geometry.parentJoint]
        if shape is not None and np.isfinite(shape.size):
            heights.append(float(pose.act(shape.support(-pose.rotation[2]))[2]))
    lowest = min(heights)
    if free:
        q0[2] += HEIGHT - lowest
    scene.add_plane("ground", point=(0, 0, 0 if free else lowest - HEIGHT))
    scene.set_surface("*", mu=MU)
    scene.add_contact("*", "*")
    scene.add_force(nga.JointPD(q0, KP, KD))
    return scene, q0


def run_robot(name: str, t_end: float = T_END) -> dict[str, Any]:
    """Measure one robot; "reason" is there where it did not reach the end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene, q0 = dropped_robot(name)
        start = time.perf_counter()
        trajectory = nga.simulate(scene, q0, t_end=t_end, dt=DT, on_failure="stop")
    seconds, audit = time.perf_counter() - start, trajectory.audit()
    row = {
        "robot": name,
        "nv": scene.model.nv,
        "pairs": len(scene.contacts),
        "left out": len(scene.left_out),
        "penetration [m]": audit.penetration,
        "iterations mean / worst": f"{audit.n_iter_mean:.1f} / {audit.n_iter_max}",
        "solved by": ", ".join(f"{rung} {count}" for rung, count in audit.rungs.items()),
        "us / step": seconds / max(1, len(trajectory.t) - 1) * 1e6,
    }
    return row if audit.finite and audit.success else row | {"reason": audit.message}


def _in_process(name: str) -> dict[str, Any]:
    command = [sys.executable, __file__, "--one", name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIME_LIMIT)
    except subprocess.TimeoutExpired:
        return {"robot": name, "reason": f"not done after {TIME_LIMIT:.0f} s"}
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if not lines:
        last = done.stderr.strip().splitlines()[-1:] or [f"ended with code {done.returncode}"]
        return {"robot": name, "reason": last[0][:160]}
    found: dict[str, Any] = json.loads(lines[-1])
    return found


def _line(row: dict[str, Any]) -> str:
    cells = [f"{row[c]:.3g}" if isinstance(row.get(c), float) else str(row.get(c, "")) for c in COLUMNS]
    return "| " + " | ".join(cells) + f" | {row.get('reason', '')} |"


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="robots; by default all of them")
    parser.add_argument("--out", type=Path, help="file to write the table to")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        print(json.dumps(run_robot(arguments.one)))
        return
    from example_robot_data.robots_loader import ROBOTS

    lines = ["| " + " | ".join((*COLUMNS, "remark")) + " |", "| " + " | ".join(["---"] * (len(COLUMNS) + 1)) + " |"]
    print("\n".join(lines), flush=True)
    for name in arguments.names or sorted(ROBOTS):
        lines.append(_line(_in_process(name)))
        print(lines[-1], flush=True)
    if arguments.out:
        arguments.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
