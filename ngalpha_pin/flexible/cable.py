"""Cables: straight segments that carry tension and nothing else, between nodes that are bodies of the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.engine import CableForces

from .spline import MOST
from .strand import StrandNodes, ends_of_elements

Curve = Callable[[np.ndarray], np.ndarray] | np.ndarray


class CableForce(NamedTuple):
    """Tension in a cable, shape (..., m) [N]."""

    N: np.ndarray


class Cable(StrandNodes):
    """A cable or rope without bending and torsion, which may be slack.

    A segment of the length l carries N = EA (strain + damping strain rate) where that pulls, and nothing where it would
    push. A cable that does not stretch, EA = infinity, has a distance of its nodes that is at most l instead: where it
    goes taut there is an impact.

    Args:
        length: without force [m].
        EA: stiffness [N]; infinity is a cable that does not stretch.
        line_density: [kg/m].
        radius: for contacts and pictures [m].
        elements: number of segments.
        boundaries: places xi of the nodes, shape (elements + 1,), from 0 to 1; None is evenly.
        damping: retardation time of Kelvin and Voigt [s].

    Attributes:
        places: xi of the nodes, shape (n,).
        lengths: of the segments, shape (n - 1,) [m].
        node_length: share of every node in the length, shape (n,) [m].
        node_mass: shape (n,) [kg].

    Raises:
        SceneError: an argument is out of range.
    """

    NODES, NODE_NQ, NODE_NV = 1, 3, 3

    def __init__(
        self,
        length: float,
        EA: float,
        line_density: float,
        radius: float = 0.0,
        elements: int = 20,
        *,
        boundaries: Sequence[float] | None = None,
        damping: float = 0.0,
    ):
        self.length = checks.number("Cable: length", length, 0.0, above=True)
        self.EA = EA if EA == np.inf else checks.number("Cable: EA", EA, 0.0, above=True)
        self.line_density = checks.number("Cable: line_density", line_density, 0.0, above=True)
        self.radius = checks.number("Cable: radius", radius, 0.0)
        self.damping = checks.number("Cable: damping", damping, 0.0)
        self.elements = checks.integer("Cable: elements", elements, 1, MOST)
        self.places = ends_of_elements("Cable: boundaries", boundaries, self.elements)
        self.lengths = self.length * np.diff(self.places)
        self.node_length = np.zeros(self.nodes)
        for end in (0, 1):
            self.node_length[end : self.elements + end] += self.lengths / 2.0
        self.node_mass = self.line_density * self.node_length
        self.forces = self._law()

    def __repr__(self) -> str:
        return f"Cable(length={self.length:.6g}, EA={self.EA:.6g}, line_density={self.line_density:.6g})"

    @property
    def stretches(self) -> bool:
        """EA is finite."""
        return bool(np.isfinite(self.EA))

    @property
    def q_ref(self) -> np.ndarray:
        """The straight cable along the x-axis of the world, without force, shape (nq,)."""
        return np.outer(self.length * self.places, (1.0, 0.0, 0.0)).ravel()

    def inertia(self, node: int) -> pin.Inertia:
        """The share of a node in the cable."""
        return pin.Inertia(float(self.node_mass[node]), np.zeros(3), np.zeros((3, 3)))

    def configuration(self, placement: pin.SE3 | None = None) -> np.ndarray:
        """The straight cable without force, moved, shape (nq,).

        Args:
            placement: of the axes along whose x-axis it lies; None is the world.
        """
        pose = pin.SE3.Identity() if placement is None else checks.placement("cable: placement", placement)
        return (self.q_ref.reshape(-1, 3) @ pose.rotation.T + pose.translation).ravel()

    def through(self, points: Curve) -> np.ndarray:
        """A configuration with the nodes on a curve, shape (nq,).

        Args:
            points: a function of xi in [0, 1], (m,) -> (m, 3) [m], or the nodes, shape (n, 3). Segments longer than
                without force are stretched.
        """
        given = checks.result("Cable: points", points, self.places) if callable(points) else points
        return checks.array("Cable: points", given, (self.nodes, 3)).ravel()

    def points(self, q: np.ndarray, xi: np.ndarray) -> np.ndarray:
        """The centreline in the world, shape (m, 3) [m].

        Args:
            q: shape (nq,).
            xi: shape (m,).
        """
        xi, r = np.atleast_1d(np.asarray(xi, dtype=float)), q.reshape(-1, 3)
        return np.column_stack([np.interp(xi, self.places, r[:, e]) for e in range(3)])

    def section_forces(self, q: np.ndarray, v: np.ndarray, xi: np.ndarray) -> CableForce:
        """Tension at xi by strain and its rate, constant in each segment.

        That of a cable that does not stretch is a contact force: `Trajectory.section_forces` has it.

        Args:
            q: shape (nq,).
            v: shape (nv,).
            xi: shape (m,).
        """
        return CableForce(self.forces.tensions(np.ascontiguousarray(q), np.ascontiguousarray(v))[self.segment(xi)])

    def segment(self, xi: np.ndarray) -> np.ndarray:
        """Numbers of the segments at places xi, shape (m,)."""
        xi = np.atleast_1d(np.asarray(xi, dtype=float))
        return np.clip(np.searchsorted(self.places, xi, "right") - 1, 0, self.elements - 1)

    def to_plain(self) -> dict[str, Any]:
        """Everything that makes the cable, for JSON."""
        names = ("length", "EA", "line_density", "radius", "elements", "damping")
        return {name: getattr(self, name) for name in names} | {"boundaries": self.places.tolist()}

    @classmethod
    def from_plain(cls, entry: dict[str, Any]) -> Cable:
        """The inverse of `to_plain`."""
        return cls(**entry)

    def _law(self) -> CableForces:
        return CableForces(self.lengths.tolist(), self.EA if self.stretches else 0.0, self.damping)
