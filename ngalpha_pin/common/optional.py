"""Packages that only some functions need: imported when used, and missed with the command that installs them."""

from __future__ import annotations

import warnings
from importlib import import_module
from types import ModuleType

from ngalpha_pin.errors import NgalphaError


class MissingPackageError(NgalphaError, ImportError):
    """A package or program that only this function needs is not installed."""


def require(module: str, purpose: str, command: str) -> ModuleType:
    """Import a module that is not needed by the rest of the package.

    Args:
        module: name of the module.
        purpose: what it is needed for, as in "{purpose} needs matplotlib".
        command: the command that installs it.

    Raises:
        MissingPackageError: it cannot be imported.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of the packages it imports in turn
            return import_module(module)
    except ImportError as error:
        raise MissingPackageError(f"{purpose} needs {module.partition('.')[0]}: {command}") from error
