"""Counts the calls of Pinocchio's and coal's functions: what a step really computes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import wraps
from types import ModuleType
from typing import Any
from unittest import mock

import coal
import pinocchio as pin

# of the thousand functions of the libraries those that compute: the others build or look things up
COMPUTES = {
    "pin": (
        "aba", "appendModel", "buildReducedModel", "compute", "crba", "dDifference", "dIntegrate", "difference",
        "distance", "forward", "frames", "get", "impulse", "integrate", "normalize", "rnea", "update",
    ),
    "coal": ("collide", "compute", "distance"),
}  # fmt: skip


@contextmanager
def counted_calls() -> Iterator[Counter[str]]:
    """Count calls as long as the context lasts; names are `pin.integrate`, `coal.distance` and so on."""
    counts: Counter[str] = Counter()
    modules: tuple[tuple[str, ModuleType], ...] = (("pin", pin), ("coal", coal))
    with ExitStack() as stack:
        for prefix, module in modules:
            for name in dir(module):
                function = getattr(module, name)
                if name.startswith(COMPUTES[prefix]) and callable(function) and not isinstance(function, type):
                    counted = _counted(function, f"{prefix}.{name}", counts)
                    stack.enter_context(mock.patch.object(module, name, counted))
        yield counts


def _counted(function: Callable[..., Any], name: str, counts: Counter[str]) -> Callable[..., Any]:
    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        counts[name] += 1
        return function(*arguments, **options)

    return call
