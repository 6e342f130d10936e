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

from ngalpha_pin.contact.laws import IndexSets
from ngalpha_pin.step_equations.equations import StepEquations
from ngalpha_pin.step_equations.options import LawOptions
from ngalpha_pin.system.regime import ENUMERATED

MAX_ITER = 12
# of one contact: how many of the sets A, B, C it is in, and whether it sticks on velocity and on acceleration level
NORMAL, FRICTION = (0, 1, 2, 3), ((False, False), (True, False), (True, True))


def consistent_sets(equations: StepEquations, laws: LawOptions) -> tuple[np.ndarray | None, int]:
    """An x that solves the equations of a step with any index sets, or None, and the number of Newton corrections."""
    sub, count = equations.sub, 0
    if not 0 < sub.k <= ENUMERATED:
        return None, 0
    free = StepEquations(equations.system, equations.parameters, equations.state, equations.dt, sub, equations.memory)
    for sets in _choices(np.isin(np.arange(sub.k), sub.of_F)):
        evaluation = free.evaluate(free.start(), replace(laws, sets=sets))
        for _ in range(MAX_ITER):
            if evaluation.error <= 1.0 or not np.isfinite(evaluation.error):
                break
            count += 1
            evaluation, _ = free.corrected(evaluation)
        if evaluation.error <= 1.0 and free.evaluate(evaluation.x, laws).error <= 1.0:
            return evaluation.x, count
    return None, count


def _choices(with_friction: np.ndarray) -> Iterator[IndexSets]:
    """All index sets of a few contacts, those with most contacts closed first."""
    states = [
        [(normal, friction) for normal in NORMAL[::-1] for friction in (FRICTION if has and normal else FRICTION[:1])]
        for has in with_friction
    ]
    for choice in product(*states):
        level = np.array([normal for normal, _ in choice])
        stick, stick_a = np.array([friction for _, friction in choice]).T
        yield IndexSets(level >= 1, level >= 2, level >= 3, stick, stick_a)
