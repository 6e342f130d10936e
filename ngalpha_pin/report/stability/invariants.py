"""Long runs, most of a million steps: what stays in mechanics must not drift, and the memory must not grow."""

from __future__ import annotations

import resource
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin

from ngalpha_pin import robots
from ngalpha_pin.common.tolerances import GRAVITY, TINY
from ngalpha_pin.integrators.breakpoints import steps_ahead
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.simulation.simulate import Simulator
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

from . import scenes
from .row import Case, Check, Row, stepped

STEPS = 1_000_000
FEWER = 10  # times fewer steps for a closed loop, whose steps lose energy
LOOKS = 1000  # at the invariants in a run
SETTLED = 0.1  # part of the run after which an error must not grow any more, nor the memory
GROWTH = 8.0  # of the memory that is allowed after that [MB]
NONE = np.zeros(0)  # breakpoints
Invariants = Callable[[np.ndarray, np.ndarray], np.ndarray]


def cases(steps: int = STEPS) -> Iterator[Case]:
    """All long runs."""
    for name, run, n in (
        ("free body tumbles", tumbling, steps),
        ("pendulum swings", pendulum, steps),
        ("four-bar goes round", four_bar, steps // FEWER),
        ("ball rolls on", rolling, steps),
        ("plate stands on 4 points", standing, steps),
        ("box lies on an incline", lying, steps),
    ):
        title = f"{name} for {n:.0e} steps"
        yield Case(title, partial(run, title, n), True)


def tumbling(name: str, steps: int) -> Row:
    """Energy, size of the momentum and angular momentum of a body with three different inertias, without gravity.

    The momentum, which is held in the axes of the body, turns slowly: by (omega dt)^2 / 12 of the angle by which the
    body turns, the error of the trapezoidal rule for v_dot = -omega x v.
    """
    scene, q0, v0 = scenes.free_body()
    data, dt = scene.model.createData(), 1e-3

    def momentum(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.array(pin.computeCentroidalMomentum(scene.model, data, q, v).vector)

    def invariants(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        h = momentum(q, v)
        kinetic = pin.computeKineticEnergy(scene.model, data, q, v)
        return np.array([kinetic / energy, float(np.linalg.norm(h[:3])), *(h[3:] / angular)])

    energy = pin.computeKineticEnergy(scene.model, data, q0, v0)
    before = momentum(q0, v0)
    angular, phase = float(np.linalg.norm(before[3:])), float(np.linalg.norm(v0[3:])) * dt

    def turned(q: np.ndarray, v: np.ndarray) -> Check:
        angle = float(np.linalg.norm(momentum(q, v)[:3] - before[:3]))
        return Check("momentum turned by [rad], of (omega dt)^3 steps / 12 =", angle, 1.2 * phase**3 * steps / 12)

    return kept(name, (scene, q0, v0), steps, dt, GeneralizedAlpha(rho_inf=1.0), invariants, turned)


def pendulum(name: str, steps: int) -> Row:
    """Without damping the energy stays within its oscillation."""
    start = scenes.pendulum_chain(1)
    return kept(name, start, steps, 1e-2, GeneralizedAlpha(rho_inf=1.0), partial(_energy, start[0], GRAVITY / 2))


def four_bar(name: str, steps: int) -> Row:
    """A closed loop: its constraint, and its energy, of which a step loses a part of third order."""
    omega, dt = 12.0, 1e-3
    scene, q0, v0 = robots.load("four_bar", speed=omega)
    kinetic = pin.computeKineticEnergy(scene.model, scene.model.createData(), q0, v0)
    energy, method, lost = partial(_energy, scene, kinetic), GeneralizedAlpha(rho_inf=1.0), (omega * dt) ** 3 / 50
    return kept(name, (scene, q0, v0), steps, dt, method, energy, lost=lost)


def rolling(name: str, steps: int) -> Row:
    """Its speed, its spin and its height."""
    scene, q0, v0 = robots.load("rotating_ball", height=0.1, omega=-10.0)
    v0[0] = 1.0
    return kept(name, (scene, q0, v0), steps, 1e-3, GeneralizedAlpha(), lambda q, v: np.array([v[0], v[2], q[1]]))


def standing(name: str, steps: int) -> Row:
    """More contacts than the forces can be told by: it does not creep."""
    return kept(name, scenes.plate(4, 0.0), steps, 1e-3, GeneralizedAlpha(), lambda q, v: q)


def lying(name: str, steps: int) -> Row:
    """It does not creep."""
    start = robots.load("box_on_incline", mu=0.7, speed=0.0)
    return kept(name, start, steps, 1e-3, GeneralizedAlpha(), lambda q, v: q)


def _energy(scene: Scene, unit: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Energy in parts of a unit [J], shape (1,)."""
    data = scene.model.createData()
    kinetic = pin.computeKineticEnergy(scene.model, data, q, v)
    return np.array([kinetic + pin.computePotentialEnergy(scene.model, data, q)]) / unit


def kept(
    name: str,
    start: tuple[Scene, np.ndarray, np.ndarray],
    steps: int,
    dt: float,
    method: GeneralizedAlpha,
    invariants: Invariants,
    at_end: Callable[[np.ndarray, np.ndarray], Check] | None = None,
    lost: float = 0.0,
) -> Row:
    """Step without keeping anything; the invariants and the laws are looked at `LOOKS` times.

    The error of an invariant may oscillate as it does in the first part of the run; it must not go on growing.

    Args:
        name: of the case.
        start: scene, q0 and v0.
        steps: their number.
        dt: step [s].
        method: that makes them.
        invariants: what stays, from q and v.
        at_end: what else is said of the end of the run, from q and v.
        lost: growth of the error that a step of the method is allowed.
    """
    simulator = Simulator(start[0], dt, method)
    state = simulator.initial_state(start[1], start[2])
    first = invariants(state.q, state.v)
    rungs: Counter[str] = Counter()
    n_iter, worst, memory = 0, 0, 0.0
    early, late, violated = 0.0, 0.0, np.zeros(3)
    every = max(1, steps // LOOKS)
    done, settled = 0, max(1, int(SETTLED * steps / every)) * every
    while done < steps:
        for result in steps_ahead(method, simulator.system, state, dt, every - done % every, NONE):
            if not result.converged:
                raise method.not_converged(simulator.system, state, dt, result)
            state, n_iter, worst = result.state, n_iter + result.n_iter, max(worst, result.n_iter)
            rungs[result.solved_by.value] += 1
            done += 1
        if done % every:
            continue
        off = float(np.abs(invariants(state.q, state.v) - first).max())
        early, late = (max(early, off), late) if done <= settled else (early, max(late, off))
        violated = np.maximum(violated, _violations(simulator.system, state))
        if done == settled:
            memory = _memory()
    checks = [
        Check(f"invariants off by {early:.0e} in the first tenth, later by", late, 1.5 * early + 1e-9 + lost * steps),
        Check("memory grows by [MB]", _memory() - memory, GROWTH),
    ]
    if at_end is not None:
        checks.append(at_end(state.q, state.v))
    return stepped(name, rungs, n_iter, worst, checks, f"{max(early, late):.0e}", violated)


def _violations(system: System, state: State) -> np.ndarray:
    """Constraints off by, penetration [m], and friction outside its cone, in parts of the largest force."""
    system.dynamics(state.t, state.q, state.v, state.a)
    drift = penetration = cone = 0.0
    if system.constraints.names:
        rows = system.constraint_rows(state.t, state.q, state.v, state.a)
        drift = float(np.abs(rows.whole(system.motion(state.v, state.a))[0]).max())
    sub = system.contacts.subset(state.contacts)
    if sub.k:
        penetration = max(0.0, -float(system.gaps(sub, state.q).min()))
        size, bound = sub.cones.sizes(state.la_F), sub.cones.mu * state.la_N[sub.cones.contact]
        cone = max(0.0, float((size - bound).max())) / max(float(state.la_N.max()), TINY)
    return np.array([drift, penetration, cone])


def _memory() -> float:
    """Resident memory now, or where the system does not tell, the largest so far [MB]."""
    pages = Path("/proc/self/statm")
    if pages.is_file():
        return int(pages.read_text().split()[1]) * resource.getpagesize() / 2**20
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
