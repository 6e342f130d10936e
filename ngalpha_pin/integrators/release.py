"""A step through the moment at which contacts let go of what they hold: it ends there, and goes on without them.

Up to that moment the normal force of such a contact is a smooth function of the length of the step, and vanishes there;
beyond it the contact is open and has none. So it is approached from before, by lines through the forces at the
ends of repeated smooth steps.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.integrators.attempt import attempt
from ngalpha_pin.integrators.piece import Cut, Piece
from ngalpha_pin.system.adhesion import LETS_GO, lets_go
from ngalpha_pin.system.state import SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

# smooth steps to get there, and by which part of what the root of the lines has moved, and at least of the step, one
# ends before it
MAX_SEARCH, EARLY, LEAST = 40, 0.1, 1e-14
OPEN = 1e-12  # force, in parts of the adhesion, that is the rounding of none


def cut_at_release(piece: Piece, trial: StepResult) -> Cut | None:
    """The moment at which the first contact presses no more; None where it is not located.

    Args:
        piece: the step.
        trial: the step in one piece, in which contacts let go.
    """
    _, system, state, dt = piece
    watched, n_iter = lets_go(system, trial.state), trial.n_iter
    low, high, early, root = 0.0, dt, np.inf, np.inf
    times, forces = [0.0], [_forces(system, state, watched)]
    h = 0.5 * dt
    for _ in range(MAX_SEARCH):
        part = attempt(piece._replace(dt=h), until_closing=True, features=trial.state)
        n_iter += part.n_iter
        if not part.converged or len(part.closing):
            return None
        now = _forces(system, part.state, watched)
        if (now > OPEN).all():
            if now.min() <= LETS_GO:
                return Cut(part.state, h, n_iter, part.parts, SolvedBy.RELEASE)
            low, before = h, root
            times.append(h)
            forces.append(now)
            root = first_release(times, forces)
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


def first_release(times: list[float], forces: list[np.ndarray]) -> float:
    """Where the first of some forces vanishes on the line through its last two values; infinity where none falls."""
    rate = (forces[-1] - forces[-2]) / (times[-1] - times[-2])
    falls = rate < 0.0
    return times[-1] + float((-forces[-1][falls] / rate[falls]).min(initial=np.inf))
