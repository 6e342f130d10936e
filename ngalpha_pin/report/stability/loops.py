"""Cases of closed loops: singular positions, and constraints that are dependent."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from ngalpha_pin import robots
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.scene.constraints import JointTrajectory
from ngalpha_pin.simulation.simulate import simulate

from .row import Case, Check, Row, judged

DT = 5e-3
INFINITE = "the load, which needs an infinite force in that position; another dt passes it"


def cases() -> Iterator[Case]:
    """All cases of loops."""
    for run, title in (
        (through_flat, "two parallelograms fall through their flat positions"),
        (from_flat, "two parallelograms start in their flat position"),
        (always_dependent, "Bricard mechanism, one constraint too many everywhere"),
    ):
        yield Case(title, partial(run, title))
    for dt, where in ((7.5e-3, "between two steps"), (1e-2, "at the end of a step")):
        title = f"driven parallelogram is flat {where}, dt = {dt:g}"
        yield Case(title, partial(landing, title, dt), bound=INFINITE)


def through_flat(name: str) -> Row:
    """They stay parallelograms where they could fold over, and the energy stays."""
    run = simulate(*robots.load("n_four_bar", windows=2), t_end=3.2, dt=DT, method=GeneralizedAlpha(rho_inf=0.9))
    upright = _upright(run)
    flat = int(np.diff(np.floor(upright[:, 0] / np.pi - 0.5)).sum())
    folded = float(np.abs(upright - upright[:, :1]).max())
    missing = Check("flat positions not passed, of 3", max(0, 3 - flat), 0)
    return judged(name, run, [missing, Check("out of parallel by [rad]", folded, 1e-8), _energy(run)])


def from_flat(name: str) -> Row:
    """Half of the rows of the constraints vanish there."""
    scene, _, v0 = robots.load("n_four_bar", windows=2, speed=5.0)
    method = GeneralizedAlpha(rho_inf=0.9)
    run = simulate(scene, np.pi / 2 * v0 / 5.0, v0, t_end=0.5, dt=DT, method=method, on_failure="stop")
    upright = _upright(run)
    return judged(
        name, run, [Check("out of parallel by [rad]", float(np.ptp(upright, axis=1).max()), 1e-8), _energy(run)]
    )


def always_dependent(name: str) -> Row:
    """All joints of odd number turn alike, and those of even number."""
    run = simulate(*robots.load("bricard"), t_end=5.0, dt=1e-2, method=GeneralizedAlpha(rho_inf=0.9))
    apart = max(float(np.ptp(run.q[:, start::2], axis=1).max()) for start in (0, 1))
    return judged(name, run, [Check("joints that turn alike differ by [rad]", apart, 1e-8), _energy(run)])


def landing(name: str, dt: float) -> Row:
    """It lies flat after one second: the steps next to it pass, a step that ends there has no solution."""
    speed = np.pi / 2
    scene, q0, v0 = robots.load("n_four_bar", windows=1, speed=speed)
    scene.add_constraint(JointTrajectory("up0", lambda t: (speed * t, speed, 0.0)))
    run = simulate(scene, q0, v0, t_end=1.5, dt=dt, method=GeneralizedAlpha(rho_inf=0.9), on_failure="stop")
    folded = float(np.ptp(_upright(run, windows=1), axis=1).max())
    return judged(name, run, [Check("out of parallel by [rad]", folded, 1e-8)])


def _upright(run: Trajectory, windows: int = 2) -> np.ndarray:
    """Angles of the upright rods, shape (n + 1, windows + 1) [rad]."""
    model = run.scene.model
    return run.q[:, [model.idx_qs[model.getJointId(f"up{i}")] for i in range(windows + 1)]]


def _energy(run: Trajectory) -> Check:
    total = run.energy.total
    return Check("energy off by", float(np.abs(total - total[0]).max() / np.ptp(run.energy.kinetic)), 1e-3)
