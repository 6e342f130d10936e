"""Who is near, out of many declared pairs: coal's trees of boxes beside the package's own look at spheres and motions.

    python benchmarks/broadphase.py [--table PATH]

One look in every step of a box that moves among others that it does not come near. coal's managers are told where the
box is, updated and asked for the pairs whose boxes overlap; what they do not know is which pairs are declared, so that
a scene in which many bodies move would get undeclared pairs as well. The package looks at all pairs only after some
body has moved as far as the nearest of the others was away; "all pairs" is such a look in every step. Microseconds of
processor time for one look, the fastest of several runs.
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
from scaling import AWAY, FAR, box_among_boxes
from tables import add_table_option, publish

from ngalpha_pin.system.system import System

STEPS, REPEATS = 200, 5
MANAGERS = (coal.DynamicAABBTreeCollisionManager, coal.SaPCollisionManager)
DT, SPEED = 1e-3, 1.0


def with_coal(kind: type, n: int) -> Callable[[int], None]:
    """One look of one of coal's managers in step number i."""
    manager, callback = kind(), coal.CollisionCallBackCollect(10 * n)
    moving = coal.CollisionObject(coal.Box(0.2, 0.2, 0.2), coal.Transform3s())
    # coal keeps pointers: the objects must live as long as the manager
    objects = [moving]
    for angle in np.linspace(0.0, 2 * np.pi, n, endpoint=False):
        at = AWAY * np.array([np.cos(angle), np.sin(angle), 0.0])
        objects.append(coal.CollisionObject(coal.Box(0.2, 0.3, 0.4), coal.Transform3s(np.eye(3), at)))
    for thing in objects:
        thing.computeAABB()
        manager.registerObject(thing)
    manager.setup()

    def look(i: int) -> None:
        objects[0].setTranslation(np.array([SPEED * DT * i, 0.0, 0.0]))
        objects[0].computeAABB()
        manager.update()
        callback.init()
        manager.collide(callback)

    return look


def with_package(n: int, always: bool) -> Callable[[int], None]:
    """One look of the package, at all pairs in every step or only where it is needed."""
    scene, q0, v0 = box_among_boxes(n)
    system = System(scene)
    proximity, q = system.slots.proximity, q0.copy()

    def look(i: int) -> None:
        q[0] = SPEED * DT * i
        system.place_moving(q, v0)
        if always:
            proximity.forget()
        proximity.within(system.data, 1e-9, 3 * DT)

    return look


def seconds(look: Callable[[int], None]) -> float:
    """Processor time of one look [s]."""
    times = []
    for _ in range(REPEATS):
        begin = time.process_time()
        for i in range(STEPS):
            look(i)
        times.append((time.process_time() - begin) / STEPS)
    return min(times)


def main(argv: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    add_table_option(parser)
    args = parser.parse_args(argv)
    names = [kind.__name__.removesuffix("CollisionManager") for kind in MANAGERS]
    lines = [f"| declared far pairs | {' | '.join(names)} | all pairs | package |", "| --- " * (len(names) + 3) + "|"]
    for n in FAR:
        looks = [with_coal(kind, n) for kind in MANAGERS] + [with_package(n, always) for always in (True, False)]
        lines.append(f"| {n} | " + " | ".join(f"{1e6 * seconds(look):.0f}" for look in looks) + " |")
        print(lines[-1], flush=True)
    print()
    publish(lines, args.table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
