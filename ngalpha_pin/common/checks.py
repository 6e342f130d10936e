"""What a user declares, checked: numbers, arrays, names, functions, placements, paths.

Every check returns the value in the type that the package computes with, or raises a SceneError that names the
argument, says what was expected and what came. `what` is the argument with its owner, e.g. "Spring a-b: stiffness".
"""

from __future__ import annotations

import os
import reprlib
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError

T = TypeVar("T")
# a rotation matrix that is further from R^T R = I than this is none: files write seven digits
ROTATION = 1e-6
# more digits than this of a value say nothing
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60
SHAPES = {0: "a number", 1: "a vector", 2: "a matrix"}


def shown(value: Any) -> str:
    """A value for a message: short, with its type where that says more."""
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of shape {value.shape}" if value.size > 6 else f"the array {value.tolist()}"
    if isinstance(value, (int, float, np.number)) and not isinstance(value, bool):
        return f"{value}" if not isinstance(value, int) or abs(value) < 1e15 else "a huge integer"
    if callable(value):
        return f"the function {getattr(value, '__name__', type(value).__name__)}"
    try:
        return f"{_SHORT.repr(value)}, a {type(value).__name__}" if value is not None else "None"
    except Exception:  # of the value's own repr
        return f"a {type(value).__name__}"


def fail(what: str, value: Any, expected: str) -> SceneError:
    """The error of a value that is not what was expected."""
    return SceneError(f"{what} = {shown(value)}: expected {expected}")


def number(
    what: str, value: Any, low: float = -np.inf, high: float = np.inf, above: bool = False, unit: str = ""
) -> float:
    """A finite number.

    Args:
        what: name of the argument.
        value: what came.
        low: lower bound; the number may be equal to it.
        high: upper bound, likewise.
        above: it must be larger than `low`.
        unit: of the number, for the message.
    """
    found = _as_float(value)
    if found is None or not np.isfinite(found) or not low <= found <= high or (above and found == low):
        raise fail(what, value, _range(low, high, above, unit))
    return found


def _as_float(value: Any) -> float | None:
    """The number that a value is, or None: not a text, a truth value or an array, which float() takes as well."""
    if isinstance(value, (str, bytes, bytearray, bool, np.bool_)) or getattr(value, "ndim", 0) != 0:
        return None
    try:
        return float(value)
    except OverflowError:
        return np.inf
    except Exception:  # whatever an object does when it is asked for a number
        return None


def _range(low: float, high: float, above: bool, unit: str) -> str:
    of = f" of {unit}" if unit else ""
    if np.isfinite(high):
        return f"a finite number{of} in {'(' if above else '['}{low:g}, {high:g}]"
    if low == 0.0:
        return f"a positive number{of}" if above else f"a finite number{of}, not negative"
    return f"a finite number{of}" + (f" {'above' if above else 'of at least'} {low:g}" if np.isfinite(low) else "")


def integer(what: str, value: Any, low: int | None = None, high: int | None = None) -> int:
    """An integer within bounds."""
    fits = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not fits or (low is not None and value < low) or (high is not None and value > high):
        bounds = f" of at least {low}" if low is not None else ""
        raise fail(what, value, f"an integer{bounds}{f' and at most {high}' if high is not None else ''}")
    return int(value)


def cores() -> int:
    """Cores that this process may use."""
    usable = getattr(os, "sched_getaffinity", None)
    return len(usable(0)) if usable is not None else os.cpu_count() or 1


def flag(what: str, value: Any) -> bool:
    """True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise fail(what, value, "True or False")
    return bool(value)


def array(what: str, value: Any, shape: tuple[int | None, ...], finite: bool = True) -> np.ndarray:
    """An array of its own with finite numbers.

    Args:
        what: name of the argument.
        value: what came.
        shape: None stands for any length.
        finite: no NaN and no infinity.
    """
    wanted = f"{SHAPES.get(len(shape), 'an array')} of shape ({_lengths(shape)})"
    try:
        given = np.asarray(value)
        found = np.array(given, dtype=float) if given.dtype.kind in "iufO" else None
    except Exception:  # ragged lists, and whatever objects do when they are asked for numbers
        found = None
    if found is None or _has_text(given):
        raise fail(what, value, f"{'finite ' if finite else ''}numbers, {wanted}")
    if found.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, found.shape, strict=True)):
        raise SceneError(f"{what} has shape {found.shape}: expected {wanted}")
    if finite and not np.isfinite(found).all():
        where = [int(i) for i in np.argwhere(~np.isfinite(found))[0]]
        raise SceneError(f"{what}{where or ''} = {found[tuple(where)]} is not finite")
    return found


def _has_text(given: np.ndarray) -> bool:
    return given.dtype.kind == "O" and any(isinstance(x, (str, bytes)) for x in given.ravel())


def _lengths(shape: tuple[int | None, ...]) -> str:
    return ", ".join("n" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "")


def number_or_array(what: str, value: Any, low: float) -> np.ndarray:
    """A finite number or an array of some, none of them below a bound; shape () or (n,)."""
    found = array(what, value, (None,) if _as_float(value) is None else ())
    if (found < low).any():
        raise fail(what, found, f"finite numbers of at least {low:g}" if low else "finite numbers, not negative")
    return found


def vector(what: str, value: Any, n: int = 3) -> np.ndarray:
    """A finite vector of length n."""
    return array(what, value, (n,))


def direction(what: str, value: Any) -> np.ndarray:
    """The unit vector along a vector of length 3 that is not zero."""
    found = vector(what, value)
    largest = np.abs(found).max()
    if largest == 0.0:
        raise fail(what, found, "a direction, not zero")
    found /= largest  # so that the square of neither a tiny nor a huge one is lost
    return found / np.linalg.norm(found)


def name(what: str, value: Any) -> str:
    """A text that can name something."""
    if not isinstance(value, str) or not value:
        raise fail(what, value, "a name, a text that is not empty")
    if "\0" in value or not value.isascii() and not _encodes(value):
        raise SceneError(f"{what} = {value!r}: expected a name in UTF-8 without zeros")
    return str(value)


def _encodes(text: str) -> bool:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def choice(what: str, value: Any, known: Collection[str]) -> str:
    """One of some words."""
    if not isinstance(value, str) or value not in known:
        raise SceneError(f"{what} {shown(value)} is unknown; choose one of {', '.join(known)}")
    return value


def path(what: str, value: Any) -> Path:
    """A path of a file or folder; whether it is there is the matter of who opens it."""
    if not isinstance(value, (str, os.PathLike)) or value == "":
        raise fail(what, value, "a path, a text or a pathlib.Path")
    text = os.fspath(value)
    if not isinstance(text, str) or "\0" in text:
        raise fail(what, value, "a path as text without zeros")
    return Path(text)


def result(what: str, given: Callable[..., Any], *arguments: Any) -> Any:
    """What a function of the user's own gives; an error that names it where it fails."""
    try:
        return function(what, given, "of the user's own")(*arguments)
    except SceneError:
        raise
    except Exception as error:
        raise SceneError(f"{what}: the function failed with {error!r}") from error


def dimensions(what: str, value: Any) -> int:
    """Of how many axes an array of the value would be, 0 of a number."""
    try:
        return np.ndim(value)
    except Exception:  # ragged lists, and whatever objects do when they are asked
        raise fail(what, value, "a number or an array of numbers") from None


def function(what: str, value: Any, of: str) -> Callable[..., Any]:
    """Something to call; `of` says with what and what for, e.g. "of time that returns a pin.SE3"."""
    if not callable(value) or isinstance(value, type):
        raise fail(what, value, f"a function {of}")
    return value


def instance(what: str, value: Any, kind: type[T] | tuple[type[T], ...], expected: str = "") -> T:
    """A value of one of some types."""
    if not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        raise fail(what, value, expected or " or ".join(f"a {k.__name__}" for k in kinds))
    return value


def instances(what: str, value: Any, kind: type[T], expected: str) -> list[T]:
    """Values of one type, e.g. in a list; `expected` says what each of them is."""
    try:
        found = list(value)
    except Exception:  # whatever an object does when it is asked for its items
        raise fail(what, value, f"a list, each of it {expected}") from None
    return [instance(f"{what} {i}", x, kind, expected) for i, x in enumerate(found)]


def placement(what: str, value: Any) -> pin.SE3:
    """A pose, a `pin.SE3` that is finite and whose matrix is a rotation; None is the identity."""
    if value is None:
        return pin.SE3.Identity()
    found = instance(what, value, pin.SE3, "a pin.SE3")
    R = found.rotation
    if not np.isfinite(found.translation).all():
        raise SceneError(f"{what} has the translation {found.translation.tolist()}: expected finite numbers")
    if not np.abs(R.T @ R - np.eye(3)).max() <= ROTATION or np.linalg.det(R) < 0.0:
        raise SceneError(f"{what} has the matrix {R.round(6).tolist()}, which is no rotation; see pin.SE3.normalize")
    return found
