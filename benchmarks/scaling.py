"""What a step costs against the number of closed contacts, and against the number of declared pairs that stay far away.

    python benchmarks/scaling.py [--only spheres boxes closed] [--repeat N] [--table PATH]

Closed contacts: sleds that slide and turn on a plane, each on five spherical feet, so that the forces of a sled are not
unique. Far pairs: a ball that rolls on a plane, and a box that slides on it, with contact declared to bodies that they
do not come near; the pairs of the ball are points against round surfaces, those of the box change their touching
features.

Times are processor times of the stepping loop on one thread, the fastest of several runs; the cases of a table take
turns, so that whatever else the machine does is shared by all of them. The unit beside them is a LAPACK solve of size
20 in the same process, as in benchmarks/step_cost.py. Tables are Markdown.
"""
# ruff: noqa: E402  (threads are limited before numpy is imported)

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when numpy is imported

import coal
import numpy as np
import pinocchio as pin
from tables import add_table_option, publish

import ngalpha_pin as nga
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.report.machine import solve_time
from ngalpha_pin.system.system import System

FEET = 5
SLEDS = (2, 4, 8, 16, 32, 60)
FAR = (10, 30, 100, 300, 1000, 2000)
# a look at all far pairs, which the first step takes, is spread over the steps of a run
DT, STEPS, FAR_STEPS = 1e-3, 40, 400
AWAY = 30.0  # radius of the circle of far bodies [m]

Start = tuple[nga.Scene, np.ndarray, np.ndarray]


def sleds(n: int) -> Start:
    """N sleds on a plane, each of 1 kg, with five feet of which none is where symmetry would put it."""
    model = pin.Model()
    scene_feet: list[tuple[int, np.ndarray]] = []
    rng = np.random.default_rng(0)
    for i in range(n):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"sled_{i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, 0.4, 0.4, 0.1), pin.SE3.Identity())
        model.addJointFrame(joint)
        angles = 2 * np.pi * (np.arange(FEET) + 0.3 * rng.random(FEET)) / FEET
        scene_feet += [(i, np.array([0.2 * np.cos(x), 0.2 * np.sin(x), -0.05])) for x in angles]
    scene = nga.Scene(model)
    scene.add_plane("ground")
    for j, (i, at) in enumerate(scene_feet):
        scene.add_geometry(f"foot_{j}", coal.Sphere(0.02), parent=f"sled_{i}", placement=pin.SE3(np.eye(3), at))
    scene.add_contact("foot_*", "ground", mu=0.3)
    q0, v0 = pin.neutral(model), np.zeros(model.nv)
    for i in range(n):
        q0[7 * i : 7 * i + 3] = 2.0 * (i % 8), 2.0 * (i // 8), 0.07
        v0[6 * i : 6 * i + 6] = 1.0, 0.2, 0.0, 0.0, 0.0, 2.0
    return scene, q0, v0


def ball_among_spheres(n: int) -> Start:
    """A rolling ball, and contact with n spheres far away."""
    return _among(n, coal.Sphere(0.1), pin.Inertia.FromSphere(1.0, 0.1), coal.Sphere(0.1))


def box_among_boxes(n: int) -> Start:
    """A sliding box, and contact with n boxes far away."""
    return _among(n, coal.Box(0.2, 0.2, 0.2), pin.Inertia.FromBox(1.0, 0.2, 0.2, 0.2), coal.Box(0.2, 0.3, 0.4))


def _among(n: int, shape: coal.CollisionGeometry, inertia: pin.Inertia, far: coal.CollisionGeometry) -> Start:
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_geometry("moving", shape, parent="body")
    scene.add_plane("ground")
    scene.add_contact("moving", "ground", mu=0.3)
    for i, angle in enumerate(np.linspace(0.0, 2 * np.pi, n, endpoint=False)):
        at = AWAY * np.array([np.cos(angle), np.sin(angle), 0.0])
        scene.add_geometry(f"far_{i}", far, placement=pin.SE3(np.eye(3), at))
    scene.add_contact("moving", "far_*", mu=0.3)
    q0, v0 = pin.neutral(model), np.zeros(6)
    q0[2], v0[0] = 0.1, 1.0
    return scene, q0, v0


class Case:
    """One scene that is stepped again and again from the same state.

    Attributes:
        seconds: processor time of a step in the fastest run [s].
        closed: closed contacts at the end.
        iterations: per step.
    """

    def __init__(self, start: Start, steps: int):
        scene, q0, v0 = start
        self._system, self._method, self._steps = System(scene), nga.GeneralizedAlpha(), steps
        self._first = initial_state(self._system, q0, v0)
        self.seconds, self.closed, self.iterations = np.inf, 0, 0.0

    def run(self) -> None:
        """Take the steps once."""
        state, n_iter, begin = self._first, 0, time.process_time()
        for _ in range(self._steps):
            result = self._method.step(self._system, state, DT)
            if not result.converged:
                raise self._method.not_converged(self._system, state, DT, result)
            state, n_iter = result.state, n_iter + result.n_iter
        self.seconds = min(self.seconds, (time.process_time() - begin) / self._steps)
        self.closed, self.iterations = len(state.contacts), n_iter / self._steps


def measured(cases: list[Case], repeat: int) -> float:
    """Run all cases in turns, once more than counted for the index arrays that it makes; time of a LAPACK solve [s]."""
    unit = np.inf
    for _ in range(repeat + 1):
        for case in cases:
            case.run()
        unit = min(unit, solve_time()[0])
    return float(unit)


def far_table(build: Callable[[int], Start], title: str, repeat: int) -> list[str]:
    """Cost against far pairs; the ratio is to the first line."""
    cases = [Case(build(n), FAR_STEPS) for n in FAR]
    unit = measured(cases, repeat)
    return [
        f"| {title} | us / step | in LAPACK solves of size 20 | ratio |",
        "| --- | --- | --- | --- |",
        *(
            f"| {n} | {1e6 * case.seconds:.0f} | {case.seconds / unit:.0f} | {case.seconds / cases[0].seconds:.2f} |"
            for n, case in zip(FAR, cases, strict=True)
        ),
    ]


def contact_table(repeat: int) -> list[str]:
    """Cost against closed contacts."""
    cases = [Case(sleds(n), STEPS) for n in SLEDS]
    unit = measured(cases, repeat)
    return [
        "| closed contacts (sleds on five feet) | us / step | iterations | us / step and contact | in LAPACK solves |",
        "| --- | --- | --- | --- | --- |",
        *(
            f"| {case.closed} | {1e6 * case.seconds:.0f} | {case.iterations:.1f} | "
            f"{1e6 * case.seconds / case.closed:.0f} | {case.seconds / unit:.0f} |"
            for case in cases
        ),
    ]


TABLES: dict[str, Callable[[int], list[str]]] = {
    "spheres": lambda repeat: far_table(ball_among_spheres, "far pairs of spheres", repeat),
    "boxes": lambda repeat: far_table(box_among_boxes, "far pairs of boxes", repeat),
    "closed": contact_table,
}


def main(argv: list[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", nargs="+", choices=TABLES, default=list(TABLES), help="tables to measure (all)")
    parser.add_argument("--repeat", type=int, default=3, metavar="N", help="runs of each case; the fastest counts (3)")
    add_table_option(parser)
    args = parser.parse_args(argv)
    lines: list[str] = []
    for name in args.only:
        lines += ["", *TABLES[name](args.repeat)]
    publish(lines[1:], args.table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
