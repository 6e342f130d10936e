"""Names that match a pattern, and what to say where none does."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from fnmatch import fnmatchcase

from ngalpha_pin.errors import UnknownName
from ngalpha_pin.scene.contents import listed


def matching(kind: str, pattern: str, names: Sequence[str]) -> list[str]:
    """The name that is meant, or those that match a pattern, in their order.

    Parts are called NAME 0, NAME 1 and so on, and NAME is all of them.

    Upper and lower case count as the same where no name is exactly the pattern; where that adds names, a warning says
    so.

    Raises:
        UnknownName: there is none.
    """
    if pattern in names:
        return [pattern]
    parts = [name for name in names if name.startswith(f"{pattern} ") and name[len(pattern) + 1 :].isdecimal()]
    if parts:
        return parts
    found = [name for name in names if fnmatchcase(name.lower(), pattern.lower())]
    exact = [name for name in found if fnmatchcase(name, pattern)]
    if not found:
        raise UnknownName(kind, pattern, names)
    if exact != found:
        others = listed(name for name in found if name not in exact)
        warnings.warn(f"{kind} {pattern!r} matches {others} only without regard to case", stacklevel=4)
    return found
