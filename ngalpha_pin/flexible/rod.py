"""Rods in space: large displacements, stretch, shear, bending and torsion, on nodes that are bodies of the model.

E. Reissner, J. C. Simo: the geometrically exact rod; nodes (r, p) with a unit quaternion each, three an element, and
two Gauss points, which neither lock nor leave a motion without stiffness. The forces are the exact gradient of the
quadrature of the strain energy: a free rod keeps momentum and, to the order of the step, energy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicSpline

from ngalpha_pin.common import checks
from ngalpha_pin.engine import RodForces
from ngalpha_pin.errors import SceneError

from .section import Section
from .spline import MOST
from .strand import StrandNodes, ends_of_elements

Curve = Callable[[np.ndarray], np.ndarray] | np.ndarray

SAMPLES = 20  # of a curve between two nodes, on which frames are carried along
STANDS = 1e-6  # speed along a curve, in parts of the largest, that is none: a spline leaves that of a cusp
# cosine that a tangent lacks of the vertical where another direction goes across; sine of what points along the rod
UPRIGHT, ALONG = 1e-6, 1e-9
SHARP = 0.5 * np.pi  # largest turn of a curve within an element [rad]
SECTION = ("stiffness", "line_density", "line_inertia", "radius")
LOBATTO = np.array([1.0, 4.0, 1.0]) / 6.0  # shares of an element in the inertia of its nodes


class RodSectionForces(NamedTuple):
    """Forces and moments in the axes of the section, x along the rod, shape (..., m) each [N and N m]."""

    N: np.ndarray
    Q_y: np.ndarray
    Q_z: np.ndarray
    M_x: np.ndarray
    M_y: np.ndarray
    M_z: np.ndarray


class Rod(StrandNodes):
    """A rod in space.

    Args:
        length: of a straight rod [m], or
        curve: the undeformed centreline: a smooth function of xi in [0, 1], (m,) -> (m, 3) [m], or the nodes, shape
            (2 elements + 1, 3), or their poses, shape (2 elements + 1, 7).
        section: its cross-section.
        elements: number of elements of three nodes each.
        boundaries: places xi of the ends of the elements, shape (elements + 1,), from 0 to 1; None is evenly. Every
            boundary and every middle is a node that can be named.
        damping: of Kelvin and Voigt, stress = C (strain + damping strain rate) [s].
        twist: turn of the undeformed section about the centreline against a frame that does not twist, at the end of
            the rod and linear in between, or a function of xi, (m,) -> (m,) [rad].
        normal: direction near the z-axis of the first section; None is the vertical, or x for a vertical rod.

    Attributes:
        places: xi of the nodes, shape (n,).
        reference: pose of every node (r, p) of the undeformed rod, p = (x, y, z, w), shape (n, 7).
        length: of the undeformed rod, along its elements [m].
        node_length: share of every node in the length, shape (n,) [m].
        node_mass: shape (n,) [kg].

    Raises:
        SceneError: an argument is out of range, or the curve stands still, has a cusp or turns too far in an element.
    """

    NODES, NODE_NQ, NODE_NV = 2, 7, 6

    def __init__(
        self,
        length: float | None = None,
        section: Section | None = None,
        elements: int = 8,
        *,
        curve: Curve | None = None,
        boundaries: Sequence[float] | None = None,
        damping: float = 0.0,
        twist: float | Callable[[np.ndarray], np.ndarray] = 0.0,
        normal: Sequence[float] | None = None,
    ):
        if (length is None) == (curve is None):
            raise SceneError("Rod: give either its length or its curve")
        self.section = checks.instance("Rod: section", section, Section, "a Section(...)")
        self.elements = checks.integer("Rod: elements", elements, 1, MOST)
        self.damping = checks.number("Rod: damping", damping, 0.0)
        self.boundaries = ends_of_elements("Rod: boundaries", boundaries, self.elements)
        self.places = np.interp(np.arange(self.nodes) / 2, np.arange(self.elements + 1), self.boundaries)
        if curve is None:
            total = checks.number("Rod: length", length, 0.0, above=True)
            curve = total * np.outer(self.places, (1.0, 0.0, 0.0))
        posed = not callable(curve) and np.shape(curve) == (self.nodes, 7)
        self.reference = _poses(curve) if posed else self._frames(curve, twist, normal)
        self.forces = self._law()
        lengths = np.array(self.forces.lengths())
        self.length = float(lengths.sum())
        self.node_length = np.zeros(self.nodes)
        for k, share in enumerate(LOBATTO):
            np.add.at(self.node_length, 2 * np.arange(self.elements) + k, share * lengths)
        self.node_mass = self.section.line_density * self.node_length

    def __repr__(self) -> str:
        return f"Rod(length={self.length:.6g}, elements={self.elements}, line_density={self.section.line_density:.6g})"

    @property
    def radius(self) -> float:
        """Of the section, for contacts and pictures [m]."""
        return float(self.section.radius)

    @property
    def q_ref(self) -> np.ndarray:
        """The undeformed rod, shape (nq,)."""
        return self.reference.ravel()

    def inertia(self, node: int) -> pin.Inertia:
        """The share of a node in the rod, in its own axes."""
        moments = np.diag(self.section.line_inertia * self.node_length[node])
        return pin.Inertia(float(self.node_mass[node]), np.zeros(3), moments)

    def configuration(self, placement: pin.SE3 | None = None) -> np.ndarray:
        """The undeformed rod, moved, shape (nq,).

        Args:
            placement: of the frame in which the rod is declared; None leaves it there.
        """
        if placement is None:
            return self.q_ref.copy()
        checks.instance("rod: placement", placement, pin.SE3, "a pin.SE3")
        turn = pin.Quaternion(placement.rotation)
        found = self.reference.copy()
        found[:, :3] = found[:, :3] @ placement.rotation.T + placement.translation
        for node in found:
            node[3:] = (turn * pin.Quaternion(node[3:])).coeffs()
        return found.ravel()

    def through(
        self,
        points: Curve,
        twist: float | Callable[[np.ndarray], np.ndarray] = 0.0,
        normal: Sequence[float] | None = None,
    ) -> np.ndarray:
        """A configuration with the nodes on a curve and the sections across it, shape (nq,).

        Args:
            points: as the `curve` of the rod.
            twist: as that of the rod.
            normal: as that of the rod.
        """
        return self._frames(points, twist, normal).ravel()

    def rigid_velocity(
        self, q: np.ndarray, linear: Sequence[float] = (0.0, 0.0, 0.0), angular: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> np.ndarray:
        """Velocities of a rod at q that moves as a rigid body, shape (nv,).

        Args:
            q: shape (nq,).
            linear: velocity of the origin of the world, as if it belonged to the rod, shape (3,) [m/s].
            angular: in the axes of the world, shape (3,) [rad/s].
        """
        omega, found = np.asarray(angular, dtype=float), np.zeros((self.nodes, 6))
        for node, v in zip(q.reshape(-1, 7), found, strict=True):
            v[:3] = np.asarray(linear, dtype=float) + np.cross(omega, node[:3])
            v[3:] = pin.Quaternion(node[3:]).toRotationMatrix().T @ omega
        return found.ravel()

    def points(self, q: np.ndarray, xi: np.ndarray) -> np.ndarray:
        """The centreline in the world, shape (m, 3) [m].

        Args:
            q: shape (nq,).
            xi: shape (m,).
        """
        xi = np.atleast_1d(np.asarray(xi, dtype=float))
        element = np.clip(np.searchsorted(self.boundaries, xi, "right") - 1, 0, self.elements - 1)
        start = self.boundaries[element]
        x = 2.0 * (xi - start) / (self.boundaries[element + 1] - start) - 1.0
        shapes = np.stack((0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)))
        r = q.reshape(-1, 7)[:, :3]
        return sum(N[:, None] * r[2 * element + k] for k, N in enumerate(shapes))

    def section_forces(self, q: np.ndarray, v: np.ndarray, xi: np.ndarray) -> RodSectionForces:
        """Forces and moments in the sections at xi, linear in each element through its Gauss points.

        Args:
            q: shape (nq,).
            v: shape (nv,).
            xi: shape (m,).
        """
        xi = np.atleast_1d(np.asarray(xi, dtype=float))
        values = self.forces.section_forces(np.ascontiguousarray(q), np.ascontiguousarray(v)).reshape(-1, 2, 6)
        at = np.array(self.forces.gauss_places()).reshape(-1, 2)
        element = np.clip(np.searchsorted(self.boundaries, xi, "right") - 1, 0, self.elements - 1)
        part = ((xi - at[element, 0]) / (at[element, 1] - at[element, 0]))[:, None]
        found = (1.0 - part) * values[element, 0] + part * values[element, 1]
        return RodSectionForces(*found.T)

    def to_plain(self) -> dict[str, Any]:
        """Everything that makes the rod, for JSON."""
        section = {name: np.array(getattr(self.section, name)).tolist() for name in SECTION}
        own = {"boundaries": self.boundaries.tolist(), "reference": self.reference.tolist(), "damping": self.damping}
        return {"section": section, **own}

    @classmethod
    def from_plain(cls, entry: dict[str, Any]) -> Rod:
        """The inverse of `to_plain`."""
        reference, boundaries = np.array(entry["reference"]), entry["boundaries"]
        section, elements = Section(**entry["section"]), len(boundaries) - 1
        return cls(None, section, elements, curve=reference, boundaries=boundaries, damping=entry["damping"])

    def _law(self) -> RodForces:
        stiffness = self.section.stiffness.ravel().tolist()
        return RodForces(self.places.tolist(), stiffness, self.q_ref.tolist(), self.damping)

    def _frames(
        self, curve: Curve, twist: float | Callable[[np.ndarray], np.ndarray], normal: Sequence[float] | None
    ) -> np.ndarray:
        """Nodes on a curve, with frames that are carried along it without twist and then turned, shape (n, 7)."""
        fine = np.interp(np.arange(SAMPLES * (self.nodes - 1) + 1) / SAMPLES, np.arange(self.nodes), self.places)
        if callable(curve):
            points = checks.array("Rod: curve", checks.result("Rod: curve", curve, fine), (len(fine), 3))
        else:
            points = CubicSpline(self.places, checks.array("Rod: curve", curve, (self.nodes, 3)))(fine)
        tangents = CubicSpline(fine, points)(fine, 1)
        speed = np.linalg.norm(tangents, axis=1)
        if speed.min() <= STANDS * speed.max() or speed.max() == 0.0:
            raise SceneError("Rod: the curve stands still or has a cusp; its points must move on along it")
        tangents /= speed[:, None]
        turns = np.arccos(np.clip(np.sum(tangents[1:] * tangents[:-1], axis=1), -1.0, 1.0))
        turned = turns.reshape(self.elements, -1).sum(axis=1).max()
        if turned > SHARP:
            raise SceneError(
                f"Rod: the curve turns by {np.degrees(turned):.0f} degrees in one element; take more elements "
                f"(at most {np.degrees(SHARP):.0f} degrees each), or round off the corner"
            )
        angles = (
            checks.result("Rod: twist", twist, self.places)
            if callable(twist)
            else checks.number("Rod: twist", twist) * self.places
        )
        angles = checks.array("Rod: twist", angles, (self.nodes,))
        z = carried(points, tangents, _across(tangents[0], normal))[::SAMPLES]
        found = np.zeros((self.nodes, 7))
        found[:, :3] = points[::SAMPLES]
        for node, x, up, angle in zip(found, tangents[::SAMPLES], z, angles, strict=True):
            frame = np.column_stack((x, np.cross(up, x), up)) @ pin.utils.rotate("x", float(angle))
            node[3:] = pin.Quaternion(frame).normalized().coeffs()
        for before, node in zip(found[:-1], found[1:], strict=True):
            node[3:] *= np.copysign(1.0, before[3:] @ node[3:])
        return found


def _poses(given: Any) -> np.ndarray:
    """Poses (r, p) of nodes, with unit quaternions, shape (n, 7)."""
    found = checks.array("Rod: curve", given, (len(given), 7))
    size = np.linalg.norm(found[:, 3:], axis=1)
    if np.abs(size - 1.0).max() > checks.ROTATION:
        raise SceneError("Rod: curve: the quaternions of its poses must have unit length")
    return found


def carried(points: np.ndarray, tangents: np.ndarray, first: np.ndarray) -> np.ndarray:
    """A direction across a curve, carried along it without twist by two reflections a step, shape (m, 3).

    W. Wang, B. Juettler, D. Zheng, Y. Liu: Computation of rotation minimizing frames, doi:10.1145/1330511.1330513.
    """
    found = np.empty_like(points)
    found[0] = z = first
    for i, (step, t, end) in enumerate(zip(np.diff(points, axis=0), tangents[:-1], tangents[1:], strict=True)):
        size = step @ step
        z, t = (x - 2.0 * (step @ x) / size * step for x in (z, t))
        step = end - t
        z = z - 2.0 * (step @ z) / (step @ step) * step
        z = z - (z @ end) * end
        found[i + 1] = z = z / np.linalg.norm(z)
    return found


def _across(tangent: np.ndarray, normal: Sequence[float] | None) -> np.ndarray:
    """The unit vector across the tangent that is nearest to the normal."""
    if normal is None:
        wanted = np.array([0.0, 0.0, 1.0]) if abs(tangent[2]) < 1.0 - UPRIGHT else np.array([1.0, 0.0, 0.0])
    else:
        wanted = checks.vector("Rod: normal", normal)
    across = wanted - (wanted @ tangent) * tangent
    size = np.linalg.norm(across)
    if size <= ALONG * np.linalg.norm(wanted):
        raise SceneError("Rod: normal points along the rod; it must point across it")
    return across / size
