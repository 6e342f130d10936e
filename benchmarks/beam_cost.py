"""Cost of one step of a clamped beam against its number of elements.

The time is that of the processor, the smallest of several runs. Up to some hundred elements the engine solves full
matrices; of longer beams bands are solved in numpy, which is a constant for the calls of Python plus a part that grows
linearly.

    python benchmarks/beam_cost.py
"""

from __future__ import annotations

import time

import numpy as np

import ngalpha_pin as nga

ELEMENTS = (2, 4, 8, 16, 32, 64, 128)
STEPS, REPEATS, DT = 20, 8, 1e-5


def clamped_beam(elements: int) -> tuple[nga.Scene, np.ndarray]:
    """A cantilever under its weight, and its undeformed configuration."""
    scene = nga.Scene()
    beam = scene.add_beam(nga.PlanarBeam(0.2, EA=1.89e7, EI=14.2, line_density=0.71, elements=elements), "beam")
    scene.add_beam_point("root", "beam", 0.0)
    scene.add_constraint(nga.Weld("world", "root", placement_a=beam.plane))
    return scene, scene.q_ref


def seconds_per_correction(elements: int) -> float:
    """Smallest time of a step, per evaluation and correction."""
    scene, q0 = clamped_beam(elements)
    simulator = nga.Simulator(scene, DT, nga.GeneralizedAlpha(rho_inf=0.8))
    best = np.inf
    for _ in range(REPEATS):
        state, n_iter = simulator.initial_state(q0), 0
        start = time.process_time()
        for _ in range(STEPS):
            result = simulator.method.step(simulator.system, state, DT)
            state, n_iter = result.state, n_iter + result.n_iter
        best = min(best, (time.process_time() - start) / max(n_iter, 1))
    return best


def main() -> None:
    """Print the table."""
    times = [seconds_per_correction(n) for n in ELEMENTS]
    print(f"{'elements':>8} {'nv':>5} {'us':>8} {'ratio':>6}")
    for n, seconds in zip(ELEMENTS, times, strict=True):
        print(f"{n:8d} {2 * (n + 3):5d} {1e6 * seconds:8.0f} {seconds / times[0]:6.2f}")


if __name__ == "__main__":
    main()
