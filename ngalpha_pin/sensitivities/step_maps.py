"""Whole steps as linear maps of what the method remembers: they can be multiplied from either side."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.integrators.method import failure
from ngalpha_pin.integrators.restart import after_jump
from ngalpha_pin.sensitivities.columns import Columns
from ngalpha_pin.sensitivities.steps import Report, Steps
from ngalpha_pin.sensitivities.tangent import from_vector
from ngalpha_pin.system.state import State, StepResult
from ngalpha_pin.system.system import System


class Taken(NamedTuple):
    """A step that was taken.

    Attributes:
        start: as it was given.
        begun: with the force that is held in it; the same one where no force is given.
        result: of the method.
    """

    start: State
    begun: State
    result: StepResult


class StepMap(NamedTuple):
    """The derivative of a step.

    Attributes:
        A: by what is remembered at its start (see `Tangent.as_vector`), shape (s1, s0).
        B: by the force that is held in it, shape (s1, nv of the tree); (s1, 0) where none is given.
        P: by the parameters, shape (s1, p).
        report: of the step.
    """

    A: np.ndarray
    B: np.ndarray
    P: np.ndarray
    report: Report


def take(method: GeneralizedAlpha, system: System, state: State, dt: float, tau: np.ndarray | None) -> Taken:
    """A step with a force that is held from its start on.

    Raises:
        NotConverged: it has no solution.
    """
    begun = state if tau is None else after_jump(system, _holding(state, tau))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        result = method.step(system, begun, dt)
    if not result.converged:
        raise failure(method, system, begun, dt, result)
    return Taken(state, begun, result)


def step_map(steps: Steps, columns: Columns, taken: Taken, torques: int) -> StepMap:
    """The map of a step.

    Args:
        steps: of the scene; their columns are replaced.
        columns: those of the torques and, behind them, of the parameters.
        taken: the step.
        torques: number of columns of the torques.
    """
    state, system = taken.start, steps.geometry.system
    sub = system.contacts.subset(state.contacts)
    s = 4 * system.nv + 2 * (sub.k + sub.m + system.joint_friction.f) + 1
    S = from_vector(system, state.contacts, np.eye(s, s + columns.p))
    steps.columns = columns.after(s)
    if taken.begun is not state and taken.begun.memory is not state.memory:
        S = steps.begun_anew(taken.begun, S)
    end, report = steps.through(taken.result.parts, S)
    J = end.of(system, taken.result.state.contacts).as_vector()
    return StepMap(J[:, :s], J[:, s : s + torques], J[:, s + torques :], report)


def start_map(steps: Steps, columns: Columns, state: State, torques: int) -> np.ndarray:
    """What is remembered at a consistent start by q0, v0 and the parameters: shape (s0, 2 nv + p)."""
    nv = steps.geometry.system.nv
    steps.columns = columns.after(2 * nv)
    p = 2 * nv + columns.p
    S = steps.start(state, np.eye(nv, p), np.eye(nv, p, nv)).of(steps.geometry.system, state.contacts)
    J = S.as_vector()
    return np.delete(J, slice(2 * nv, 2 * nv + torques), axis=1)


def _holding(state: State, tau: np.ndarray) -> State:
    return replace(state, tau=tau)
