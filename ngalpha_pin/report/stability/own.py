"""Cases of a scene of the user's own: the same run with other steps and another damping of the method."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.simulation.simulate import simulate

from .row import Case, Row, judged

Loader = Callable[[], tuple[Scene, np.ndarray, np.ndarray]]
"""Builds the scene, q0 and v0; it is called in a process of its own, as every case is run in one."""
STEPS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)  # in parts of dt
RHO_INF = (0.0, 0.9, 1.0)  # beside the one of all steps
RHO = 0.5
T_END = 0.5  # [s]


def own_cases(name: str, load: Loader, t_end: float, dt: float) -> Iterator[Case]:
    """The cases.

    Args:
        name: of the scene.
        load: builds it.
        t_end: end of the runs [s].
        dt: the middle one of the steps [s]; those that do not go into the run twice are left out.
    """
    for part in STEPS:
        if 2 * part * dt <= t_end:
            yield _case(name, load, t_end, part * dt, RHO, part < 1.0)
    for rho in RHO_INF:
        yield _case(name, load, t_end, dt, rho, False)


def _case(name: str, load: Loader, t_end: float, dt: float, rho: float, long: bool) -> Case:
    title = f"{name} for {t_end:g} s with dt = {dt:g}, rho_inf = {rho:g}"
    return Case(title, partial(_run, title, load, t_end, dt, rho), long)


def _run(title: str, load: Loader, t_end: float, dt: float, rho: float) -> Row:
    scene, q0, v0 = load()
    method = GeneralizedAlpha(rho_inf=rho)
    return judged(title, simulate(scene, q0, v0, t_end=t_end, dt=dt, method=method, on_failure="stop"), [])
