"""Which force of a scene jumps near a step that did not converge."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ngalpha_pin.scene.sampled_control import SampledControl
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

SAMPLES = 96  # along the motion of the step, and as far before and behind it
HALVINGS = 40  # of the interval that holds the jump: to rounding of the way
REMAINS = 0.5  # part of the change between two samples that is left in the last interval; a slope leaves 1e-12 of it


def jumping_force(system: System, state: State, dt: float, tried: State) -> str:
    """The first force of the scene that jumps along the motion of a step, and what to do; "" where none does.

    It is looked at on the line from the start of the step to where the solver has ended, and as far beyond both: what
    a force with a jump makes of the velocity may lie on either side of it. The time is that of the end: a jump in time
    is no reason to fail.
    """
    ends = (*state.q, *state.v, *tried.q, *tried.v)
    forces = [force for force in (*system.forces, *system.controls) if not isinstance(force, SampledControl)]
    if not forces or not np.isfinite(ends).all():
        return ""
    n, nq = system.tree.nv, system.tree.nq
    way, still = system.difference(state.q, tried.q), np.zeros(len(state.v))
    for force in forces:

        def value(s: float, force: Any = force) -> np.ndarray:
            t, tau = state.t + dt, np.zeros(n)
            q, v = system.integrate(state.q, s * way), state.v + s * (tried.v - state.v)
            system.dynamics(t, q, v, still)  # some forces act where bodies are
            force.add_to(t, q[:nq], v[:n], tau, np.zeros((n, n)), np.zeros((n, n)))
            return tau

        if _jumps(value):
            return (
                f"; {getattr(force, 'name', type(force).__name__)} jumps with q or v there, so that no step is short "
                "enough: dry friction of joints is the model's lowerDryFrictionLimit and upperDryFrictionLimit, a "
                "controller that switches is a SampledControl"
            )
    return ""


def _jumps(value: Callable[[float], np.ndarray]) -> bool:
    """A function of [-1, 2] jumps where it changes the most."""
    places = np.linspace(-1.0, 2.0, SAMPLES + 1)
    values = np.array([value(float(s)) for s in places])
    if not np.isfinite(values).all():
        return False
    changes = np.abs(np.diff(values, axis=0)).max(axis=1)
    i = int(np.argmax(changes))
    if changes[i] == 0.0:
        return False
    low, high, at_low, at_high = places[i], places[i + 1], values[i], values[i + 1]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        there = value(float(middle))
        if np.abs(there - at_low).max() > np.abs(at_high - there).max():
            high, at_high = middle, there
        else:
            low, at_low = middle, there
    return bool(np.abs(at_high - at_low).max() > REMAINS * changes[i])
