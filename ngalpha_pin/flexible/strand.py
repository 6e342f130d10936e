"""What rods and cables have in common: nodes at places along them, which share the mass, and a compiled force law."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError

AT_NODE = 1e-9  # distance from a node, in parts of the whole, that is none: as of numbers that are printed


class StrandNodes:
    """The nodes of a rod or a cable.

    Attributes:
        elements: number of elements.
        places: xi of the nodes, shape (n,).
        node_mass: shape (n,) [kg].
        forces: the force law of the engine.
    """

    NODES: ClassVar[int]  # that an element has more than the one before
    NODE_NQ: ClassVar[int]  # coordinates of a node
    NODE_NV: ClassVar[int]  # velocities of a node

    elements: int
    places: np.ndarray
    node_mass: np.ndarray
    forces: Any

    def __getstate__(self) -> dict[str, object]:
        """For pickle: the compiled law is made again."""
        return {name: value for name, value in vars(self).items() if name != "forces"}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        self.forces = self._law()

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return self.NODES * self.elements + 1

    @property
    def nq(self) -> int:
        """Coordinates of all nodes."""
        return self.NODE_NQ * self.nodes

    @property
    def nv(self) -> int:
        """Velocities of all nodes."""
        return self.NODE_NV * self.nodes

    @property
    def mass(self) -> float:
        """[kg]."""
        return float(self.node_mass.sum())

    def node(self, xi: float) -> int:
        """Number of the node at xi, in [0, 1].

        Raises:
            SceneError: there is none.
        """
        kind = type(self).__name__.lower()
        xi = checks.number(f"{kind}: xi", xi, 0.0, 1.0)
        nearest = int(np.argmin(np.abs(self.places - xi)))
        if abs(self.places[nearest] - xi) > AT_NODE:
            raise SceneError(
                f"the {kind} has no node at xi = {xi:g}; the nearest is at {self.places[nearest]:.6g}. "
                "Choose another number of elements, or `boundaries` with an element that ends there"
            )
        return nearest

    def strain_energy(self, q: np.ndarray) -> float:
        """[J]; q has the shape (nq,)."""
        return float(self.forces.energy(np.ascontiguousarray(q)))

    def _law(self) -> Any:
        """The force law of the engine."""
        raise NotImplementedError


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
