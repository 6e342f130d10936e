"""The last resort for one or two contacts: Newton on prescribed index sets, one choice after the other.

Where forces are impulsive without a collision (10.4) the solution lies on index sets that no iteration of prox
functions comes near. With the sets held, the equations are smooth; a solution counts if the prox functions find the
same sets there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from ngalpha_pin.contact.cones import Cones
from ngalpha_pin.contact.laws import IndexSets
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.newton import semi_smooth_newton
from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.system.regime import ENUMERATED

MAX_ITER = 12  # Newton corrections with one choice: on the right sets it is quadratic
# of one contact: how many of the sets A, B, C it is in, and whether a cone sticks on velocity and acceleration level
NORMAL, FRICTION = (0, 1, 2, 3), ((False, False), (True, False), (True, True))


def consistent_sets(equations: StepEquations, laws: LawOptions) -> tuple[np.ndarray | None, int]:
    """An x that solves the equations of a step with any index sets, or None, and the number of Newton corrections."""
    sub, count = equations.sub, 0
    if not 0 < sub.k <= ENUMERATED:
        return None, 0
    for sets in _choices(sub.cones):
        start = equations.evaluate(equations.start(), replace(laws, sets=sets))
        evaluation, converged, n, _ = semi_smooth_newton(equations, start, MAX_ITER)
        count += n
        if converged and equations.evaluate(evaluation.x, laws).error <= 1.0:
            return evaluation.x, count
    return None, count


def _choices(cones: Cones) -> Iterator[IndexSets]:
    """All index sets of a few contacts, those with most contacts closed first."""
    of_contact = [np.flatnonzero(cones.contact == i) for i in range(cones.k)]
    states = [
        [
            (normal, friction)
            for normal in NORMAL[::-1]
            for friction in product(*(FRICTION if cones.rows[c] and normal else FRICTION[:1] for c in own))
        ]
        for own in of_contact
    ]
    order = np.argsort(np.concatenate(of_contact))
    for choice in product(*states):
        level = np.array([normal for normal, _ in choice])
        stick, stick_a = np.array([one for _, friction in choice for one in friction])[order].T
        yield IndexSets(level >= 1, level >= 2, level >= 3, stick, stick_a)
