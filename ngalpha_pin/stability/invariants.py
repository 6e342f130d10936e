"""Runs of a million steps: what stays in mechanics must not drift, and the memory must not grow."""

from __future__ import annotations

import resource
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pinocchio as pin

from ngalpha_pin import robots
from ngalpha_pin.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.scene import Scene
from ngalpha_pin.simulate import Simulator

from . import scenes
from .row import Case, Check, Row, stepped

STEPS = 1_000_000
SETTLED = 0.1  # part of the run after which the memory must not grow any more
GROWTH = 8.0  # of the memory that is allowed after that [MB]


def cases(steps: int = STEPS) -> Iterator[Case]:
    """All long runs."""
    for name, run in (("pendulum swings", pendulum), ("ball rolls on", rolling), ("box lies on an incline", lying)):
        title = f"{name} for {steps:.0e} steps"
        yield Case(title, partial(run, title, steps), True)


def pendulum(name: str, steps: int) -> Row:
    """Without damping the energy stays within its oscillation."""
    scene, q0, v0 = scenes.pendulum_chain(1)
    return _run(
        name, (scene, q0, v0), steps, 1e-2, GeneralizedAlpha(rho_inf=1.0), lambda q, v: (_energy(scene, q, v), 1.0)
    )


def rolling(name: str, steps: int) -> Row:
    """Its speed stays, and its height."""
    scene, q0, v0 = robots.load("rotating_ball", height=0.1, omega=-10.0)
    v0[0] = 1.0
    return _run(name, (scene, q0, v0), steps, 1e-3, GeneralizedAlpha(), lambda q, v: (v[0] + q[1], 1.0))


def lying(name: str, steps: int) -> Row:
    """It does not creep."""
    start = robots.load("box_on_incline", mu=0.7, speed=0.0)
    return _run(name, start, steps, 1e-3, GeneralizedAlpha(), lambda q, v: (q[0], 0.1))


def _energy(scene: Scene, q: np.ndarray, v: np.ndarray) -> float:
    data = scene.model.createData()
    return float(pin.computeKineticEnergy(scene.model, data, q, v) + pin.computePotentialEnergy(scene.model, data, q))


def _run(
    name: str,
    start: tuple[Scene, np.ndarray, np.ndarray],
    steps: int,
    dt: float,
    method: GeneralizedAlpha,
    invariant: Callable[[np.ndarray, np.ndarray], tuple[float, float]],
) -> Row:
    """Step without keeping anything; the invariant is looked at a hundred times in the first and in the last tenth."""
    simulator = Simulator(start[0], dt, method)
    state = simulator.initial_state(start[1], start[2])
    first, unit = invariant(state.q, state.v)
    rungs: Counter[str] = Counter()
    n_iter, worst, memory = 0, 0, 0.0
    early, late = 0.0, 0.0
    every = max(1, steps // 1000)
    for i in range(steps):
        result = method.step(simulator.system, state, dt)
        if not result.converged:
            raise method.not_converged(simulator.system, state, dt, result)
        state, n_iter, worst = result.state, n_iter + result.n_iter, max(worst, result.n_iter)
        rungs[result.rung] += 1
        if i % every == 0:
            off = abs(invariant(state.q, state.v)[0] - first) / unit
            early, late = (max(early, off), late) if i < SETTLED * steps else (early, max(late, off))
        if i == int(SETTLED * steps):
            memory = _memory()
    grown = Check("memory grows by [MB]", _memory() - memory, GROWTH)
    return stepped(name, rungs, n_iter, worst, [Check("invariant off by", late, 1.5 * early + 1e-9), grown])


def _memory() -> float:
    """Largest resident memory so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
