"""Work of dampers, by the way that they go in each step.

Its force at the mean velocity, along the displacement, is the least that a linear damper takes on the way. Where a
stiff damper stops within a step what an impact has set in motion, that is nearly all, and a trapezoid of its power at
both ends makes a multiple of all energy that there was; of vibrations that are quicker than a step it is nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ngalpha_pin.scene.forces import BoundForce
from ngalpha_pin.system.system import System

if TYPE_CHECKING:
    from ngalpha_pin.results.recorded import Recorded


def stored_and_damped(system: System, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces of what stores energy, at rest, and what their velocity and dampers of joints add, shape (nv,) each.

    Args:
        system: compiled scene.
        t: time [s].
        q: configuration of the tree, shape (nq,).
        v: velocity of the tree, shape (nv,).
    """
    nv = len(v)
    at_rest, K, D = np.zeros(nv), np.zeros((nv, nv)), np.zeros((nv, nv))
    stored, damped = np.zeros(nv), np.zeros(nv)
    for force in storing(system):
        elastic, tau = np.zeros(nv), np.zeros(nv)
        force.add_to(t, q, at_rest, elastic, K, D)
        force.add_to(t, q, v, tau, K, D)
        stored, damped = stored + elastic, damped + tau - elastic
    if system.damping is not None:
        damped = damped - system.damping * v
    return stored, damped


def storing(system: System) -> list[BoundForce]:
    """The forces of a scene that have an energy."""
    return [force for force in (*system.forces, *system.controls) if force.energy is not None]


def work_of_dampers(trajectory: Recorded) -> np.ndarray:
    """Work of dampers in each step, along straight ways between its ends and the impacts in it, shape (n,) [J]."""
    system, impacts = trajectory.system, trajectory.impacts
    work = np.zeros(len(trajectory.t) - 1)
    if not trajectory.replay.damping.any():
        return work
    for i in range(len(work)):
        inside = np.flatnonzero(impacts.step == i + 1)
        times = [trajectory.t[i], *impacts.t[inside], trajectory.t[i + 1]]
        places = [trajectory.q[i], *impacts.q[inside], trajectory.q[i + 1]]
        for j in range(len(times) - 1):
            work[i] += _work(system, times[j], times[j + 1] - times[j], places[j], places[j + 1])
    return work


def _work(system: System, t: float, h: float, first: np.ndarray, last: np.ndarray) -> float:
    """On a straight way from one configuration to another [J]."""
    if h <= 0.0:
        return 0.0
    way = system.difference(first, last)
    q, v = system.integrate(first, way / 2.0), way / h
    if system.forces_at_bodies:
        system.dynamics(t + h / 2.0, q, v, np.zeros_like(v))
    nq, nv = system.scene.model.nq, system.scene.model.nv
    power = float(stored_and_damped(system, t + h / 2.0, q[:nq], v[:nv])[1] @ v[:nv])
    if system.beams is not None:
        power += system.beams.damping_power(q, v)
    return h * power
