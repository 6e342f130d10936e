"""A step through the moment at which contacts let go of what they hold: it ends there, and goes on without them.

Up to that moment the normal force of such a contact is a smooth function of the length of the step, and vanishes there;
beyond it the contact is open and has none. So it is approached from before, by the roots of polynomials through the
forces at the ends of repeated smooth steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ngalpha_pin.initialization.initial import consistent_state, resting_contacts, without_lost
from ngalpha_pin.integrators.attempt import attempt
from ngalpha_pin.integrators.impact_splitting import Located, go_on
from ngalpha_pin.step.contact_history import join_percussions
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.adhesion import LETS_GO, holds, lets_go, sticky
from ngalpha_pin.system.state import SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

# smooth steps to get there, degree of the polynomials, and by which part of what their root has moved, and at least of
# the step, one ends before it
MAX_SEARCH, DEGREE, EARLY, LEAST = 40, 3, 0.1, 1e-14
OPEN = 1e-12  # force, in parts of the adhesion, that is the rounding of none


def through_release(
    parameters: Parameters,
    system: System,
    state: State,
    dt: float,
    trial: StepResult,
    rest_of_step: Callable[[State, float], StepResult],
) -> StepResult | None:
    """The step through the first release, and on to its end; None where it is not located.

    Args:
        parameters: of the method for the smooth parts.
        system: compiled scene.
        state: start of the step.
        dt: step [s].
        trial: the step in one piece, in which contacts let go.
        rest_of_step: goes on from the state just after it.
    """
    located = _before_release(parameters, system, state, dt, trial)
    if located is None:
        return None
    before = located.before
    if system.slots.n:
        system.slots.restore(before.slots)
    return go_on(system, state, dt, located, _anew(system, before, before.holding), rest_of_step, SolvedBy.RELEASE)


def without_hold(system: System, state: State) -> State:
    """The start of a step without the contacts that do not press in it any more, because what acts has jumped."""
    return state if not len(lets_go(system, state)) else _anew(system, state, state.holding)


def with_holds(system: System, result: StepResult) -> StepResult:
    """A step at whose end contacts begin to hold, or have let go in a step that was captured."""
    state = result.state
    if not system.contacts.adheres or not result.converged:
        return result
    new = np.setdiff1d(sticky(system, state.contacts[state.P_N > 0.0]), state.holding)
    if len(new):
        system.place(state.q)
        new = np.intersect1d(new, resting_contacts(system, state.q, state.v)[0].index)
    if not len(new) and not len(lets_go(system, state)):
        return result
    after = _anew(system, state, np.union1d(state.holding, new))
    return replace(result, state=join_percussions(system, state, replace(after, whole=state.whole)))


def _anew(system: System, state: State, holding: np.ndarray) -> State:
    """The state with accelerations and forces that agree with those of some contacts that can hold."""
    gone = lets_go(system, state)
    actuation = holds(state.actuation, np.setdiff1d(holding, gone))
    after = without_lost(system, consistent_state(system, state.t, state.q, state.v, actuation))
    return replace(after, near=state.near, clearance=state.clearance, sampled=state.sampled, dt=0.0)


def _before_release(
    parameters: Parameters, system: System, state: State, dt: float, trial: StepResult
) -> Located | None:
    """The moment at which the first contact presses no more."""
    watched, n_iter = lets_go(system, trial.state), trial.n_iter
    low, high, early, root = 0.0, dt, np.inf, np.inf
    times, forces = [0.0], [_forces(system, state, watched)]
    h = 0.5 * dt
    for _ in range(MAX_SEARCH):
        part = attempt(parameters, system, state, h, until_closing=True, features=trial.state)
        n_iter += part.n_iter
        if not part.converged or len(part.closing):
            return None
        now = _forces(system, part.state, watched)
        if (now > OPEN).all():
            if now.min() <= LETS_GO:
                return Located(part.state, h, n_iter, part.parts)
            low, before = h, root
            times.append(h)
            forces.append(now)
            root = first_release(np.array(times[-DEGREE - 1 :]), np.array(forces[-DEGREE - 1 :]), low)
            early = max(EARLY * abs(root - before), LEAST * dt) if np.isfinite(before) else EARLY * (root - low)
        else:
            high, early = h, 10.0 * early
        h = root - early
        if not low < h < high:
            h = 0.5 * (low + high)
    return None


def _forces(system: System, state: State, contacts: np.ndarray) -> np.ndarray:
    """What some contacts press, in parts of their adhesion, zero where a state does not know them, shape (k,)."""
    every = np.zeros(system.contacts.n)
    every[state.contacts] = state.la_N
    return every[contacts] / system.contacts.adhesion[contacts]


def first_release(times: np.ndarray, forces: np.ndarray, low: float) -> float:
    """Where the first of some polynomials through known forces vanishes after a time; infinity where none does."""
    first = np.inf
    if len(times) < 2:
        return first
    size = float(times[-1] - times[0])
    for column in forces.T:
        c = np.polyfit((times - times[-1]) / size, column, len(times) - 1)
        roots = np.roots(c)
        ahead = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real * size + times[-1] > low)]
        first = min(first, float(ahead.min(initial=np.inf)) * size + float(times[-1]))
    return first
