"""The exceptions of the package: one base class, each message says what to do."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any


class NgalphaError(Exception):
    """Base class of every error this package raises on purpose.

    Attributes:
        trajectory: where a run was under way, the `Trajectory` up to there; otherwise None.
    """

    trajectory: Any = None


class Interrupted(KeyboardInterrupt):
    """A run that Ctrl-C has ended.

    Attributes:
        trajectory: the `Trajectory` up to there.
    """

    trajectory: Any = None


class SceneError(NgalphaError, ValueError):
    """The scene, an initial value or an option cannot be used as given."""


class UnknownName(SceneError):
    """A name of a geometry, frame or joint that the scene does not have."""

    def __init__(self, kind: str, name: str, known: Iterable[str]):
        known, name = list(known), str(name)
        close = get_close_matches(name, known, n=3)
        hint = f"did you mean {', '.join(map(repr, close))}?" if close else f"known: {', '.join(known[:12]) or 'none'}"
        super().__init__(f"no {kind} named {name!r}; {hint}")


class Penetration(SceneError):
    """The initial configuration q0 has penetrating contacts."""


class NotConverged(NgalphaError):
    """A time step has no solution to the tolerance on any rung of the solver ladder.

    Attributes:
        t: time at the start of the step that failed [s].
        contacts: names of the contacts that were involved.
    """

    def __init__(self, message: str, t: float, contacts: tuple[str, ...] = ()):
        super().__init__(message)
        self.t = t
        self.contacts = contacts
