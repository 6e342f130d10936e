"""Loads the compiled module, and only with the libraries that it was built against.

The libraries of pin and coal have no version in their file names: with another one the engine would be loaded as well,
and read their memory where something else lies.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import coal
import pinocchio

# what pip installs where the version of a library is another one; Eigen has headers alone
DISTRIBUTIONS = {"pinocchio": "pin", "coal": "coal"}
AGAIN = "install this package again: pip install --force-reinstall ngalpha-pin"


def loaded() -> dict[str, str]:
    """Versions of the libraries in this process."""
    return {"pinocchio": pinocchio.__version__, "coal": coal.__version__}


def load() -> Any:
    """The compiled module.

    Raises:
        ImportError: it is missing, does not fit the libraries, or was built against others; the message says what to
            install.
    """
    try:
        engine: Any = import_module(f"{__package__}._engine")
    except ImportError as error:
        have = ", ".join(f"{name} {version}" for name, version in loaded().items())
        raise ImportError(f"the compiled engine cannot be loaded with {have}: {error}; {AGAIN}") from error
    found = mismatch(engine.versions(), loaded())
    if found:
        raise ImportError(found)
    return engine


def mismatch(built: Mapping[str, str], there: Mapping[str, str]) -> str:
    """Which libraries differ in more than the last part of their versions, and what to install; empty for none."""
    wrong = [name for name in DISTRIBUTIONS if built[name].split(".")[:2] != there[name].split(".")[:2]]
    if not wrong:
        return ""
    what = ", ".join(f"{name} {built[name]}, but {there[name]} is loaded" for name in wrong)
    wanted = " ".join(f"'{DISTRIBUTIONS[name]}=={'.'.join(built[name].split('.')[:2])}.*'" for name in wrong)
    return f"the compiled engine was built against {what}; pip install {wanted}, or {AGAIN}"
