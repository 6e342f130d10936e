"""Where the time of a step goes: own time of the groups of functions that it consists of."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import coal
import pinocchio as pin

from ngalpha_pin.collision.broad_phase import Proximity
from ngalpha_pin.collision.manifold import Slots
from ngalpha_pin.constraints.constraint_set import ConstraintRows, Constraints
from ngalpha_pin.contact.feature_rows import FeatureRows
from ngalpha_pin.contact.laws import ContactResidual
from ngalpha_pin.contact.point_rows import Rows
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.integrators import attempt
from ngalpha_pin.step import linearised_round as contact_round
from ngalpha_pin.step import newton_matrix
from ngalpha_pin.step.compiled import CompiledEquations
from ngalpha_pin.step.crowd import CrowdEquations
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.system.system import System

GROUPS = (
    "Pinocchio", "coal", "features of shapes", "forces", "constraints", "kinematics", "laws", "kernel, R(x)", "solve",
    "equations", "choice of contacts", "new state", "rest",
)  # fmt: skip


class Stopwatch:
    """Own time of groups of functions: what one of another group takes inside of them is not counted."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._running = ["rest"]
        self._since = time.perf_counter()

    def switch(self, group: str | None) -> None:
        """Enter a group, or with None go back to the one that called."""
        now = time.perf_counter()
        self.seconds[self._running[-1]] += now - self._since
        self._since = now
        if group is None:
            self._running.pop()
        else:
            self._running.append(group)

    def watch(self, group: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, timed."""

        def timed(*args: Any, **kwargs: Any) -> Any:
            self.switch(group)
            try:
                return function(*args, **kwargs)
            finally:
                self.switch(None)

        return timed


@contextmanager
def watched() -> Iterator[Stopwatch]:
    """Put a stopwatch on the functions that a step consists of."""
    functions: list[tuple[str, Any, tuple[str, ...]]] = [
        ("Pinocchio", pin, ("integrate", "dIntegrate", "forwardKinematics")),
        ("Pinocchio", pin, ("computeRNEADerivatives", "computeJointJacobiansTimeVariation")),
        ("coal", coal, ("distance", "collide")),
        ("features of shapes", Slots, ("load", "add_missing", "deepest", "contents", "restore")),
        ("features of shapes", Proximity, ("within", "bounds", "look")),
        ("forces", System, ("loads",)),
        ("constraints", Constraints, ("rows",)),
        ("constraints", ConstraintRows, ("whole", "derivatives")),
        ("kinematics", Rows, ("__init__", "move", "derivatives")),
        ("kinematics", FeatureRows, ("__init__", "move", "derivatives")),
        ("laws", ContactResidual, ("__init__", "jacobian")),
        ("solve", newton_matrix, ("correction",)),
        ("equations", StepEquations, ("__init__", "evaluate", "start", "spent", "bars")),
        ("equations", CompiledEquations, ("__init__", "evaluate", "spent", "bars")),
        ("choice of contacts", attempt, ("ContactSearch", "_chosen", "memory")),
        ("new state", attempt, ("_end",)),
        ("solve", contact_round, ("forces_of_closed_contacts", "solve_contact_problem")),
        ("solve", CrowdEquations, ("corrected", "round")),
    ]
    if kernel.library is not None:
        functions += [
            ("kernel, R(x)", kernel.library, ("nga_find_gaps", "nga_rebound", "nga_evaluate")),
            ("solve", kernel.library, ("nga_correct", "nga_advance", "nga_linearise")),
        ]
    stopwatch = Stopwatch()
    patches = [
        mock.patch.object(owner, name, stopwatch.watch(group, getattr(owner, name)))
        for group, owner, names in functions
        for name in names
    ]
    for patch in patches:
        patch.start()
    try:
        yield stopwatch
    finally:
        for patch in patches:
            patch.stop()


def shares(work: Callable[[], object]) -> dict[str, float]:
    """Parts of the time of some work that each group takes [-]; watching makes it slower, most where calls are short.

    Args:
        work: e.g. a run.
    """
    with watched() as stopwatch:
        work()
        stopwatch.switch(None)
    total = sum(stopwatch.seconds.values())
    return {group: stopwatch.seconds[group] / total for group in GROUPS}
