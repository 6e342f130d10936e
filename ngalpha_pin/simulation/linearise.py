"""The derivative of one step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ngalpha_pin.initialization.initial import consistent_state
from ngalpha_pin.integrators.method import Method
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.sensitivities.parameters import columns_of, parameters_of
from ngalpha_pin.sensitivities.start import check_differentiable
from ngalpha_pin.sensitivities.statuses import Status
from ngalpha_pin.sensitivities.step_maps import start_map, step_map, take
from ngalpha_pin.sensitivities.steps import Steps
from ngalpha_pin.sensitivities.tangent import from_vector
from ngalpha_pin.simulation.inputs import checked_dt, checked_method, checked_scene, checked_state, checked_torque
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System


@dataclass(frozen=True, eq=False)
class Linearisation:
    """The derivative of one step.

    What a step depends on is more than q and v: the method remembers x = (q, v, a, a_bar, la, la_bar of the contacts
    of the state, tau_f, tau_f_bar, length of the last part), s numbers. `A_qv` is for those who have q and v alone: the
    accelerations and forces at the start are those that agree with the motion.

    Attributes:
        state: the end of the step.
        A: derivative of x at the end by x at the start, shape (s1, s0).
        B: by the generalized force that is held in the step, shape (s1, nv of the tree).
        P: by the parameters, shape (s1, p).
        A_qv, B_qv, P_qv: of (q, v) at the end by (q, v) at the start, shape (2 nv, 2 nv), by the force, shape (2 nv, nv
            of the tree), and by the parameters, shape (2 nv, p).
        names: of the parameters.
        status: of the derivative.
        contacts: names of the contacts that the status is about.
        approach: smallest speed with which a gap closes in the step [m/s].
    """

    state: State
    A: np.ndarray
    B: np.ndarray
    P: np.ndarray
    A_qv: np.ndarray
    B_qv: np.ndarray
    P_qv: np.ndarray
    names: tuple[str, ...]
    status: Status
    contacts: tuple[str, ...]
    approach: float


def linearise(
    scene: Scene,
    state: State,
    dt: float,
    tau: np.ndarray | None = None,
    parameters: Sequence[str] = (),
    method: Method | None = None,
) -> Linearisation:
    """One step and its derivative by its start, by the force that is held in it, and by parameters.

    Args:
        scene: what moves.
        state: start of the step, e.g. `simulator.initial_state(q0, v0)` or `trajectory.final_state`.
        dt: step [s].
        tau: generalized force on the tree that is held from the start of the step on, shape (nv,) of the model [N or
            N m]; None holds what the state holds.
        parameters: names, see `Sensitivities`.
        method: by default `GeneralizedAlpha()`.

    Raises:
        SceneError: the scene has no derivatives, or an input cannot be used.
        NotConverged: the step has no solution.
    """
    system, dt = System(checked_scene(scene)), checked_dt(dt)
    alpha = check_differentiable(system, checked_method(method))
    checked_state(system, state)
    torque, found, n = checked_torque(tau, scene.model.nv), parameters_of(scene, parameters), scene.model.nv
    labels = tuple(label for parameter in found for label in parameter.labels)
    system.plain = False
    if system.slots.n:
        system.slots.restore(state.slots)
    taken = take(alpha, system, state, dt, torque if len(torque) else None)
    columns = columns_of(system, scene, found, n, n + len(labels), 0)
    steps = Steps(system, alpha.parameters, columns)
    by_step = step_map(steps, columns, taken, n)
    nv, end = system.nv, 2 * system.nv
    if system.slots.n:
        system.slots.restore(state.slots)
    system.place(state.q)
    restarted = consistent_state(system, state.t, state.q, state.v, state.actuation)
    by_motion = start_map(steps, columns, restarted, n)
    S = from_vector(system, restarted.contacts, by_motion).of(system, state.contacts).as_vector()
    of_motion = by_step.A[:end] @ S
    return Linearisation(
        taken.result.state, by_step.A, by_step.B, by_step.P, of_motion[:, : 2 * nv], by_step.B[:end],
        by_step.P[:end] + of_motion[:, 2 * nv :], labels, by_step.report.status, by_step.report.names,
        by_step.report.approach,
    )  # fmt: skip
