"""Samples of the sampled controls of a scene: when they are due, and what is held from then on.

A state has one row for each of them: how many samples it has taken, the force that it holds, and the state of its law.
Sample n is due at n / rate; that one has been taken says the number, not the rounding of times.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

# a sample this near to the start of a run, in parts of its period, is taken there
AT_START = 1e-9


def sampled_shape(system: System) -> tuple[int, int]:
    """Shape of `State.sampled`: rows of equal length, with room for the longest state of a law."""
    controls = system.samplers
    own = max((len(c.state) for c in controls if c.state is not None), default=0)
    return len(controls), (1 + system.tree.nv + own) if controls else 0


def due(system: System, state: State, until: float) -> np.ndarray:
    """All times of samples that are still to be taken up to a time, increasing, shape (n,) [s]."""
    pairs = zip(system.samplers, state.sampled, strict=True)
    times = [np.arange(row[0], np.floor(until * c.rate) + 1.0) / c.rate for c, row in pairs]
    return np.unique(np.concatenate(times)) if times else np.zeros(0)


def begun(system: System, state: State) -> State:
    """The state at the start of a run, with nothing held yet and a first sample of all sampled controls due."""
    rows = np.zeros(sampled_shape(system))
    for control, row in zip(system.samplers, rows, strict=True):
        row[0] = state.t * control.rate
        if control.state is not None:
            row[1 + system.tree.nv :][: len(control.state)] = control.state
    return replace(state, sampled=rows)


def with_samples(system: System, state: State, until: float, tau: np.ndarray | None = None) -> State:
    """The state with all samples taken that are due up to a time; its accelerations are those of before.

    Args:
        system: compiled scene.
        state: its motion and contact forces are what the laws see.
        until: time [s], not much later than that of the state.
        tau: what a `Simulator` holds beside the samples, shape (nv,) or (0,).
    """
    nv, rows = system.tree.nv, state.sampled.copy()
    q, v = state.q[: system.tree.nq], state.v[:nv]
    forces: dict[str, np.ndarray] | None = None
    for control, row in zip(system.samplers, rows, strict=True):
        if row[0] > until * control.rate:
            continue
        forces = contact_forces(system, state) if forces is None else forces
        s = 0 if control.state is None else len(control.state)
        row[1 : 1 + nv], row[1 + nv : 1 + nv + s] = control.at(state.t, q, v, dict(forces), row[1 + nv : 1 + nv + s])
        row[0] = np.floor(row[0] + AT_START) + 1.0
    return replace(state, sampled=rows, tau=held(system, rows, tau))


def held(system: System, sampled: np.ndarray, tau: np.ndarray | None = None) -> np.ndarray:
    """All of what is held, shape (nv,), or (0,) where there is nothing.

    Args:
        system: compiled scene.
        sampled: see `State`.
        tau: what a `Simulator` holds beside the samples, shape (nv,) or (0,).
    """
    beside = np.zeros(0) if tau is None else tau
    if not len(sampled):
        return beside
    total = sampled[:, 1 : 1 + system.tree.nv].sum(axis=0)
    return total + beside if len(beside) else total


def contact_forces(system: System, state: State) -> dict[str, np.ndarray]:
    """Force on the body of each contact point that carries one, in the world, shape (3,) [N], by name.

    Limits of joints are left out. Of a method with percussions alone it is the mean over the last step.
    """
    la = np.concatenate((state.la_N, state.la_F))
    if not state.la_N.any() and state.P_N.any() and state.dt > 0.0:
        la = np.concatenate((state.P_N, state.P_F)) / state.dt
    sub, k = system.contacts.subset(state.contacts).points, len(state.contacts)
    if not sub.k or not la[:k].any():
        return {}
    if system.slots.n:
        system.slots.restore(state.slots)
    system.place(state.q)
    rows = system.point_rows(sub)
    total = la[: sub.k, None] * rows.normals
    np.add.at(total, sub.of_F, la[k : k + sub.m, None] * np.asarray(rows.directions[sub.k :]))
    return {name: total[i] for i, name in enumerate(sub.names) if la[i] != 0.0}
