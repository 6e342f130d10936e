"""One step of the method whose size is controlled by two half steps, for what has no smooth phases."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.collision.manifold import SLOTS, TOUCH
from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.integrators.method import Method, attempted
from ngalpha_pin.system.state import SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

# a step after another is at most and at least this many times as long; safety of the controller; its local order
GROW, SHRINK, SAFETY, ORDER = 4.0, 0.2, 0.85, 3


class CapturedStep(NamedTuple):
    """What became of one controlled step.

    Attributes:
        parts: the two half steps.
        next_size: for the step after [s].
        rejected: sizes that were tried in vain.
        accurate: the tolerance is met.
        failure: a step that did not converge at the smallest size, or None.
    """

    parts: tuple[StepResult, ...]
    next_size: float
    rejected: int
    accurate: bool
    failure: StepResult | None


def captured_step(
    method: Method, system: System, state: State, h: float, smallest: float, rtol: float, atol: float
) -> CapturedStep:
    """A step of at most h, shorter where the whole step and its halves differ by more than the tolerance."""
    rejected = 0
    while True:
        whole = attempted(method, system, state, h)
        first = attempted(method, system, state, h / 2)
        second = attempted(method, system, first.state, h / 2) if first.converged else first
        failed = [part for part in (whole, first, second) if not part.converged]
        # a step that the method has halved itself says nothing beside its halves
        compared = not failed and whole.solved_by is not SolvedBy.HALVED
        error = _difference(whole.state, second.state, rtol, atol) if compared else np.inf
        if error <= 1.0 and _hits_nothing(system, (first, second), rtol, atol):
            error = np.inf
        if h <= smallest and failed:
            return CapturedStep((), h, rejected, False, failed[0])
        factor = min(GROW, max(SHRINK, SAFETY * max(error, TINY) ** (-1 / ORDER)))
        if error <= 1.0 or h <= smallest:
            return CapturedStep((first, second), max(smallest, h * factor), rejected, bool(error <= 1.0), None)
        rejected += 1
        h = max(smallest, h * min(factor, 0.5))


def _hits_nothing(system: System, parts: tuple[StepResult, ...], rtol: float, atol: float) -> bool:
    """An impact of shapes that are apart by more than the tolerance.

    A step meets features that it has foreseen at its start. Where shapes have turned away from them, the plane of a
    face goes on beyond its edge, for the step and for its halves alike.
    """
    first, last, length = system.contacts.n_fixed, system.contacts.n_points, system.contacts.length
    for hit in (hit for part in parts for hit in part.impacts):
        hits = hit.contacts[(hit.contacts >= first) & (hit.contacts < last)] - first
        if len(hits):
            system.place(hit.q)
            allowed = atol + (rtol + TOUCH) * length
            if any(system.slots.proximity.look(system.data, i) > allowed for i in np.unique(hits // SLOTS)):
                return True
    return False


def _difference(one: State, two: State, rtol: float, atol: float) -> float:
    """Largest difference of q and v, in units of the tolerance."""
    return max(float((np.abs(a - b) / (atol + rtol * np.abs(b))).max()) for a, b in ((one.q, two.q), (one.v, two.v)))
