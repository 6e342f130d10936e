"""What threads and environments make of the time: 64 Solo12 at once, and steps per second of a learning environment.

python benchmarks/batches.py --runs 64 --threads 2
python benchmarks/batches.py --env ngalpha_pin/Quadruped-v0 --actions 500
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import ngalpha_pin as nga
from ngalpha_pin import robots


def standing(runs: int, threads: int, seconds: float) -> None:
    """Solo12 that stand, with servos of different stiffness: one thread against several, and whether the bits agree."""
    scene, q0, v0 = robots.load("solo12", height=0.0)
    landed = nga.simulate(scene, q0, v0, t_end=0.1, dt=1e-3).final_state
    options = {"kp": np.linspace(9.0, 11.0, runs), "t_end": landed.t + seconds, "dt": 1e-3}
    states = runs * [landed]
    times: dict[int, list[float]] = {}
    found: dict[int, list[nga.Trajectory]] = {}
    processor: dict[int, list[float]] = {}
    for n in (1, threads):
        begin, begin_process = time.perf_counter(), time.process_time()
        found[n] = nga.simulate_many(scene, states=states, threads=n, **options)
        times.setdefault(n, []).append(time.perf_counter() - begin)
        processor.setdefault(n, []).append(time.process_time() - begin_process)
    same = all(
        np.array_equal(a.q, b.q) and np.array_equal(a.la_N, b.la_N) for a, b in zip(*found.values(), strict=True)
    )
    one, several = (min(times[n]) for n in (1, threads))
    steps = sum(len(run.t) - 1 for run in found[1])
    print(f"{runs} Solo12, {steps} steps: {one:.2f} s on one thread, {several:.2f} s on {threads}; same bits: {same}")
    print(f"ratio {one / several:.2f}; time of the processors {processor[1][0]:.2f} and {processor[threads][0]:.2f} s")


def random_actions(name: str, actions: int) -> None:
    """Simulated steps per second of processor time with actions by chance."""
    import gymnasium

    env = gymnasium.make(f"ngalpha_pin.gym:{name}")
    env.action_space.seed(0)
    env.reset(seed=0)
    spent, episodes = [], 1
    for _ in range(actions):
        action = env.action_space.sample()
        begin = time.process_time()
        *_, ended, truncated, _ = env.step(action)
        spent.append(time.process_time() - begin)
        if ended or truncated:
            env.reset()
            episodes += 1
    each = np.array(spent) / env.unwrapped.hold
    print(f"{name}: {1.0 / each.mean():.0f} steps/s with {actions} actions by chance, {episodes} episodes")
    mean, median, worst = 1e3 * each.mean(), 1e3 * np.median(each), 1e3 * each.max()
    print(f"a step: mean {mean:.2f} ms, median of actions {median:.2f}, worst {worst:.0f}")


def main() -> None:
    """One of the two measurements."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=64)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=0.5)
    parser.add_argument("--env", help="measure an environment instead")
    parser.add_argument("--actions", type=int, default=300)
    options = parser.parse_args()
    if options.env:
        random_actions(options.env, options.actions)
    else:
        standing(options.runs, options.threads, options.seconds)


if __name__ == "__main__":
    main()
