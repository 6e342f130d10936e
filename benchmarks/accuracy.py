"""Error against run time: generalized-alpha with both sets of laws, and Moreau's scheme, on the paper's benchmarks.

    python benchmarks/accuracy.py

Errors are the largest over the run, against the closed form (ball) or an event-driven reference (cylinder, tippe top)
from tests/references.py. Time is the stepping loop alone, in units of Moreau's at the same dt in the same run.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import time
from pathlib import Path

import numpy as np

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.initial import initial_state
from ngalpha_pin.system import System

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
import references  # noqa: E402

METHODS = {
    "second order (default)": nga.GeneralizedAlpha(rho_inf=0.5),
    "laws of the paper": nga.GeneralizedAlpha(rho_inf=0.5, laws="paper"),
    "Moreau": nga.MoreauJean(),
}


def run(scene: nga.Scene, q0: np.ndarray, v0: np.ndarray, method: object, dt: float, t_end: float) -> tuple:
    """Times, configurations, largest penetration [m] and seconds per step."""
    system = System(scene)
    state = initial_state(system, q0, v0)
    times, configurations = [state.t], [state.q]
    begin = time.perf_counter()
    for _ in range(round(t_end / dt)):
        state = method.step(system, state, dt).state
        times.append(state.t)
        configurations.append(state.q)
    seconds = (time.perf_counter() - begin) / (len(times) - 1)
    every, deepest = system.contacts.subset(np.arange(system.contacts.n)), 0.0
    for q in configurations:
        system.place(q)
        deepest = max(deepest, -float(system.gaps(every, q).min()))
    return np.array(times), np.array(configurations), deepest, seconds


def position_error(reference: np.ndarray, q: np.ndarray) -> float:
    """Largest error of the position [m]."""
    return float(np.nanmax(np.abs(q - reference)[:, :2]))


def tilt_error(reference: np.ndarray, q: np.ndarray) -> float:
    """Largest error of the angle between the axis of the top and the vertical [rad]."""

    def tilt(q: np.ndarray) -> np.ndarray:
        return np.arccos(np.clip(1 - 2 * (q[:, 3] ** 2 + q[:, 4] ** 2), -1, 1))

    return float(np.nanmax(np.abs(tilt(q) - tilt(reference))))


SYSTEMS = [
    ("ball, omega = 50", "rotating_ball", {"omega": 50.0}, 1.5, (1e-2, 1e-3), position_error, "m"),
    ("ball, omega = 10", "rotating_ball", {"omega": 10.0}, 1.5, (1e-2, 1e-3), position_error, "m"),
    ("ball in cylinder", "ball_in_cylinder", {}, 2.0, (1e-2, 1e-3), position_error, "m"),
    ("tippe top, theta", "tippe_top", {}, 1.3, (2e-3, 1e-3, 5e-4), tilt_error, "rad"),
]


def main() -> None:
    """Print the table."""
    print("| system | dt [s] | method | largest error | penetration [m] | time / Moreau |")
    print("| --- | --- | --- | --- | --- | --- |")
    for title, name, parameters, t_end, steps, error, unit in SYSTEMS:
        scene, q0, v0 = robots.load(name, **parameters)
        reference = getattr(references, name)
        for dt in steps:
            results = {label: run(scene, q0, v0, method, dt, t_end) for label, method in METHODS.items()}
            for label, (t, q, deepest, seconds) in results.items():
                size = error(reference(t, **parameters)[0], q)
                ratio = seconds / results["Moreau"][3]
                print(f"| {title} | {dt:g} | {label} | {size:.1e} {unit} | {deepest:.0e} | {ratio:.1f} |")


if __name__ == "__main__":
    main()
