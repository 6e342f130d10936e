"""The table of stiff and extreme cases: each row is a run, the numbers that judge it, and the reason of a failure."""

from collections.abc import Iterator

from . import contacts, invariants, loops, scales
from .row import Case, Check, Row, made

__all__ = ["Case", "Check", "Row", "cases", "made"]


def cases(quick: bool = False, only: str = "") -> Iterator[Case]:
    """The cases of the table, in its order.

    Args:
        quick: leave out those that take long.
        only: those whose name contains this.
    """
    for group in (scales, contacts, loops, invariants):
        for case in group.cases():
            if only.lower() in case.name.lower() and not (quick and case.long):
                yield case
