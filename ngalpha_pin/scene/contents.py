"""What a file declares, and what becomes of it."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import Literal, NamedTuple

Fate = Literal["used", "approximated", "left out", "no effect"]


class Entry(NamedTuple):
    """One kind of thing in a file.

    Attributes:
        what: the kind, as the file calls it, e.g. "joint stiffness".
        number: how many of them.
        fate: "no effect" is of what has no part in the motion, as cameras.
        reason: why it is not used as it is, and the names of what is concerned.
    """

    what: str
    number: int
    fate: Fate
    reason: str = ""


class Contents(list[Entry]):
    """What the files of a scene declare, an entry for each kind; printed as lines."""

    def __str__(self) -> str:
        if not self:
            return "no file"
        whats = [f"{entry.what}: {entry.number}" for entry in self]
        width = max(map(len, whats))
        fates = [f"{entry.fate}{f': {entry.reason}' if entry.reason else ''}" for entry in self]
        return "\n".join(f"{what:<{width}}  {fate}" for what, fate in zip(whats, fates, strict=True))


def warn_of(name: str, entries: Iterable[Entry]) -> None:
    """One warning that names every kind that a file declares and that does not act as declared."""
    kinds = [f"{d.what} ({d.number}) {d.fate}: {d.reason}" for d in entries if d.fate in ("left out", "approximated")]
    if kinds:
        warnings.warn(f"{name}: {'; '.join(kinds)}", stacklevel=4)


def listed(names: Iterable[str], most: int = 4) -> str:
    """Some names, and how many more there are."""
    names = list(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
