"""A step through the moment at which a compliant contact begins or ceases to push: it ends there, and goes on.

The normal force has a kink there: where the gap opens, and where the damper would pull. A step over it is of second
order as well, but with an error that depends on where in the step the kink falls. The moment is the root of
what vanishes there at the ends of repeated steps; the part ends just behind it.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from ngalpha_pin.common.tolerances import CLOSED
from ngalpha_pin.integrators.attempt import attempt
from ngalpha_pin.integrators.joining import SHORT
from ngalpha_pin.integrators.piece import Cut, Piece
from ngalpha_pin.system.state import SolvedBy, State, StepResult
from ngalpha_pin.system.system import System


def kinks(system: System, start: State, end: State) -> np.ndarray:
    """Compliant contacts that touch at the start of a step and push at one of its ends alone."""
    table = system.contacts
    near = start.contacts[table.soft[start.contacts]]
    pushed, pushes = (np.isin(near, state.contacts[state.la_N > 0.0]) for state in (start, end))
    near, pushed = near[pushed != pushes], pushed[pushed != pushes]
    if not len(near):
        return near
    depth, push = _signs(system, start, near)
    return near[(depth > CLOSED * table.yardstick[near]) & np.where(pushed, push > 0.0, push < 0.0)]


def _signs(system: System, state: State, contacts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Depth of some compliant contacts and what is positive as long as their laws push, shape (k,) each."""
    sub = system.contacts.subset(contacts)
    rows = system.contact_rows_at(sub, state.q, state.v, state.t)
    depth, rate = -rows.g_N, -rows.rate[: sub.k]
    pairs = zip(sub.compliances, depth.tolist(), rate.tolist(), strict=True)
    return depth, np.array([law.smooth(d, r)[1] for law, d, r in pairs])


def cut_at_kink(piece: Piece, trial: StepResult, contacts: np.ndarray) -> Cut | None:
    """The moment just behind the first kink; None where a step fails, or it is at the end of the step.

    Args:
        piece: the step.
        trial: the step in one piece.
        contacts: whose forces have kinks, see `kinks`.
    """
    _, system, state, dt = piece
    begins = _signs(system, state, contacts)
    idle = begins[1] < 0.0

    def watched(state: State) -> np.ndarray:
        """What is positive up to the kink of each contact, in parts of what it is at the start."""
        depth, push = (now / np.abs(start) for now, start in zip(_signs(system, state, contacts), begins, strict=True))
        return np.where(idle, -push, np.minimum(depth, push))

    n_iter, found = trial.n_iter, {0.0: float(watched(state).min()), dt: float(watched(trial.state).min())}
    part = trial

    def sign(h: float) -> float:
        nonlocal n_iter, part
        if h not in found:
            part = attempt(piece._replace(dt=h), until_closing=True, features=trial.state)
            n_iter += part.n_iter
            found[h] = float(watched(part.state).min()) if part.converged and not len(part.closing) else np.nan
        return found[h]

    try:
        h = float(brentq(sign, 0.0, dt, xtol=0.5 * SHORT * dt)) + SHORT * dt
    except ValueError:  # a step has failed
        return None
    return Cut(part.state, h, n_iter, part.parts, SolvedBy.RELEASE) if h < dt and sign(h) <= 0.0 else None
