"""The exceptions of the package: one base class, each message says what to do."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from difflib import SequenceMatcher, get_close_matches
from typing import Any

ALIKE = 0.6  # part of a word of a pattern that a name has in one piece to count as near


class NgalphaError(Exception):
    """Base class of every error this package raises on purpose.

    Attributes:
        trajectory: where a run was under way, the `Trajectory` up to there; otherwise None.
    """

    trajectory: Any = None

    def __reduce__(self) -> tuple[Any, ...]:
        """From process to process as it is: errors of subclasses are not made from their message alone."""
        return _restored, (type(self), self.args, vars(self))


def _restored(kind: type[NgalphaError], args: tuple[Any, ...], attributes: dict[str, Any]) -> NgalphaError:
    error = kind.__new__(kind)
    error.args = args
    vars(error).update(attributes)
    return error


class Interrupted(KeyboardInterrupt):
    """A run, or a sweep of some, that Ctrl-C has ended.

    Attributes:
        trajectory: the `Trajectory` up to there.
        results: of a sweep, the Dataset of the runs that are done.
    """

    trajectory: Any = None
    results: Any = None


class NotWritten(NgalphaError, OSError):
    """A file could not be written; one that was there is as before."""


class SceneError(NgalphaError, ValueError):
    """The scene, an initial value or an option cannot be used as given."""


class UnknownName(SceneError):
    """A name of a geometry, frame or joint that the scene does not have."""

    def __init__(self, kind: str, name: str, known: Iterable[str]):
        known, name = list(dict.fromkeys(known)), str(name)
        pattern = any(c in name for c in "*?[")
        close = nearest_names(name, known)
        more = f" (of {len(known)})" if len(known) > len(close) else ""
        if pattern:
            hint = f"the nearest: {', '.join(map(repr, close))}{more}" if close else _first(known)
            super().__init__(f"no {kind} matches {name!r}; {hint}")
        else:
            hint = f"did you mean {', '.join(map(repr, close))}?" if close else _first(known)
            super().__init__(f"no {kind} named {name!r}; {hint}")


def nearest_names(name: str, known: Sequence[str], most: int = 5) -> list[str]:
    """Names that are much like another one or like the words of a pattern, the nearest first."""
    words = [word for word in re.split(r"[*?\[\]]+", name.lower()) if word]
    whole = name.lower()
    close = get_close_matches(whole, {n.lower() for n in known}, n=most)
    found = [n for like in close for n in known if n.lower() == like]

    def shared(other: str) -> float:
        parts = [SequenceMatcher(None, word, other.lower()).find_longest_match().size / len(word) for word in words]
        return min(parts, default=0.0)

    if whole.strip("*?[]") != whole:
        found += sorted((n for n in known if n not in found and shared(n) >= ALIKE), key=lambda n: -shared(n))
    return found[:most]


def _first(known: Sequence[str], most: int = 12) -> str:
    more = f" and {len(known) - most} more" if len(known) > most else ""
    return f"known: {', '.join(known[:most]) or 'none'}{more}"


class Penetration(SceneError):
    """The initial configuration q0 has penetrating contacts."""


class NotConverged(NgalphaError):
    """A time step has no solution to the tolerance on any rung of the solver ladder.

    Attributes:
        t: time at the start of the step that failed [s].
        contacts: names of the contacts that were involved.
        results: of `Simulator.steps`, those of the steps before it.
    """

    results: Sequence[Any] = ()

    def __init__(self, message: str, t: float, contacts: tuple[str, ...] = ()):
        super().__init__(message)
        self.t = t
        self.contacts = contacts
