"""Places along rods and cables: the ends of their elements, and nodes that are found by their place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError

AT_NODE = 1e-9  # distance from a node, in parts of the whole, that is none: as of numbers that are printed


def ends_of_elements(what: str, given: Sequence[float] | None, elements: int) -> np.ndarray:
    """Places of the ends of the elements, shape (elements + 1,), evenly where none are given.

    Raises:
        SceneError: they do not increase from 0 to 1.
    """
    if given is None:
        return np.linspace(0.0, 1.0, elements + 1)
    found = checks.array(what, given, (elements + 1,))
    if found[0] != 0.0 or found[-1] != 1.0 or np.diff(found).min() <= 0.0:
        raise checks.fail(what, given, "increasing numbers from 0 to 1")
    return found


def node_at(what: str, xi: float, places: np.ndarray) -> int:
    """Number of the node at xi.

    Args:
        what: "rod" or "cable".
        xi: in [0, 1].
        places: of the nodes, shape (n,).

    Raises:
        SceneError: there is none.
    """
    xi = checks.number(f"{what}: xi", xi, 0.0, 1.0)
    nearest = int(np.argmin(np.abs(places - xi)))
    if abs(places[nearest] - xi) > AT_NODE:
        raise SceneError(
            f"the {what} has no node at xi = {xi:g}; the nearest is at {places[nearest]:.6g}. "
            "Choose another number of elements, or `boundaries` with an element that ends there"
        )
    return nearest
