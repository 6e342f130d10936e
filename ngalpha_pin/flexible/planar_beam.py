"""The planar Euler-Bernoulli beam: large displacements, stretch and bending, B-spline shape functions.

S. R. Eugster, J. Harsch: A variational formulation of classical nonlinear beam theories [16], and J. Harsch,
S. R. Eugster: Finite element analysis of planar nonlinear classical beam theories [25] of the paper.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.engine import BeamTable, internal_forces
from ngalpha_pin.errors import SceneError
from ngalpha_pin.numerics.band import BandAssembly, BandMatrix

from .spline import MOST, SplineBasis
from .strains import strain_gradients, strains

STANDS = 1e-9  # speed along a curve, in parts of the largest, that is none: it is exact at each point
ARC_POINTS = 20  # Gauss points per element for the mass and the length of a curve


class InternalForces(NamedTuple):
    """Forces with which a beam resists its deformation, and their derivatives.

    Attributes:
        f: shape (n,) [N]; the equation of motion is M a + f = loads.
        K, D: data of the band matrices df/dq and df/dv; D is None without damping.
    """

    f: np.ndarray
    K: np.ndarray
    D: np.ndarray | None


class SectionForces(NamedTuple):
    """Axial force [N] and bending moment [N m] at some places of a beam, shape (m,) each."""

    N: np.ndarray
    M: np.ndarray


class PlanarBeam:
    """A beam in a plane. Its coordinates are the control points (x_0, y_0, x_1, y_1, ...) of its centreline there.

    The strain energy is the integral of EA (stretch - 1)^2 / 2 + EI (curvature - reference curvature)^2 / 2 over the
    undeformed length, with the stretch |r'| and the curvature theta' per undeformed length.

    Args:
        length: of a straight beam [m]; leave it out with `curve`.
        EA: axial stiffness [N].
        EI: bending stiffness [N m^2].
        line_density: mass per undeformed length [kg/m].
        degree: of the shape functions, at least 2.
        elements: number of elements.
        gauss: Gauss points per element; by default degree + 1.
        damping: retardation time of a Kelvin-Voigt material, N = EA (strain + damping d/dt strain), M likewise [s].
        curve: undeformed centreline as a function of xi in [0, 1], (m,) -> (m, 2) [m], interpolated by the shape
            functions; or its control points, shape (elements + degree, 2) [m]. By default a straight line from the
            origin along the first axis.
        plane: placement of the plane of the beam in the world; its x and y axes are those of the coordinates. By
            default the vertical plane of the world's x and z.

    Attributes:
        nv: number of coordinates (and of velocities).
        q_ref: the undeformed beam, shape (nv,).
        M: constant mass matrix, `BandMatrix`.
        node_mass: mass that moves with each control point, shape (nv / 2,) [kg].
        length: of the undeformed centreline [m].
        radius: of a solid round section with this EI / EA [m], for drawing.

    Raises:
        SceneError: a parameter is out of range.
    """

    def __init__(
        self,
        length: float | None = None,
        *,
        EA: float,
        EI: float,
        line_density: float,
        degree: int = 3,
        elements: int = 8,
        gauss: int | None = None,
        damping: float = 0.0,
        curve: Callable[[np.ndarray], np.ndarray] | np.ndarray | None = None,
        plane: pin.SE3 | None = None,
    ):
        for what, value in (("EA", EA), ("EI", EI), ("line_density", line_density)):
            checks.number(f"PlanarBeam: {what}", value, 0.0, above=True)
        checks.number("PlanarBeam: damping", damping, 0.0, unit="seconds")
        gauss = _check_mesh(degree, elements, gauss)
        if (length is None) == (curve is None):
            raise SceneError("PlanarBeam: give either the length of a straight beam or a curve")
        if length is not None:
            checks.number("PlanarBeam: length", length, 0.0, above=True, unit="metres")
        self.EA, self.EI, self.line_density, self.damping = float(EA), float(EI), float(line_density), float(damping)
        self.degree, self.elements, self.gauss = degree, elements, gauss
        self.plane = _vertical_plane() if plane is None else checks.placement("PlanarBeam: plane", plane)
        self.basis = SplineBasis(degree, elements)
        self.nv = 2 * self.basis.n
        self.q_ref = self._control_points(length, curve).ravel()
        self.radius = 2.0 * float(np.sqrt(EI / EA))
        self._assembly = BandAssembly(elements, 2 * (degree + 1), 2)
        self._places = np.arange(elements)[:, None] + np.arange(degree + 1)
        self._set_gauss_points()
        self._set_mass()

    def __repr__(self) -> str:
        return (
            f"PlanarBeam(length={self.length:.6g}, EA={self.EA:.6g}, EI={self.EI:.6g}, "
            f"line_density={self.line_density:.6g}, degree={self.degree}, elements={self.elements})"
        )

    @property
    def mass(self) -> float:
        """[kg]."""
        return self.line_density * self.length

    def configuration(self, position: Sequence[float] | np.ndarray = (0.0, 0.0), angle: float = 0.0) -> np.ndarray:
        """The undeformed beam, turned about the origin of its plane and then moved, shape (nv,).

        Args:
            position: translation in the plane, shape (2,) [m].
            angle: counter-clockwise in the axes of the plane [rad].
        """
        c, s = np.cos(angle), np.sin(angle)
        turned = self.q_ref.reshape(-1, 2) @ np.array([[c, s], [-s, c]])
        return (turned + np.asarray(position, dtype=float)).ravel()

    def rigid_velocity(self, q: np.ndarray, linear: Sequence[float] = (0.0, 0.0), angular: float = 0.0) -> np.ndarray:
        """Velocities of a beam at q that moves as a rigid body, shape (nv,).

        Args:
            q: control points, shape (nv,).
            linear: velocity of the origin of the plane, as if it belonged to the beam, shape (2,) [m/s].
            angular: angular velocity [rad/s].
        """
        x = q.reshape(-1, 2)
        return (np.asarray(linear, dtype=float) + angular * np.column_stack((-x[:, 1], x[:, 0]))).ravel()

    def centreline(self, q: np.ndarray, xi: np.ndarray, order: int = 0) -> np.ndarray:
        """The centreline, or its derivative of some order by xi, in the plane, shape (m, 2) [m]."""
        shapes = self.basis.values(np.atleast_1d(xi), order)[order]
        control = q.reshape(-1, 2)[self.basis.element(np.atleast_1d(xi))[:, None] + np.arange(self.degree + 1)]
        return np.einsum("ma,mak->mk", shapes, control)

    def points(self, q: np.ndarray, xi: np.ndarray) -> np.ndarray:
        """The centreline in the world, shape (m, 3) [m]."""
        return self.centreline(q, xi) @ self.plane.rotation[:, :2].T + self.plane.translation

    def strain_energy(self, q: np.ndarray) -> float:
        """[J]."""
        strain = strains(*self._derivatives(q)) - self._strain_ref
        return float(0.5 * np.sum(self._stiffness * strain**2))

    def kinetic_energy(self, v: np.ndarray) -> float:
        """[J]."""
        return 0.5 * float(v @ (self.M @ v))

    def internal_forces(self, q: np.ndarray, v: np.ndarray) -> InternalForces:
        """Elastic and viscous forces at (q, v) with their derivatives, as the engine finds them."""
        f, K, D = internal_forces(*self._at_gauss_points, self.damping, q, v)
        return InternalForces(f, K, D if self.damping else None)

    @property
    def table(self) -> Any:
        """The beam as the engine takes it."""
        arrays = [x.ravel().tolist() for x in self._at_gauss_points]
        sizes = self.elements, self.gauss, self.degree + 1
        return BeamTable(*sizes, *arrays, self.damping, self.M.data.T.ravel().tolist())

    def section_forces(self, q: np.ndarray, v: np.ndarray, xi: np.ndarray) -> SectionForces:
        """Axial force and bending moment at the places xi.

        Args:
            q: control points, shape (nv,).
            v: their velocities, shape (nv,).
            xi: shape (m,).
        """
        xi = np.atleast_1d(np.asarray(xi, dtype=float))
        ref = strains(self.centreline(self.q_ref, xi, 1), self.centreline(self.q_ref, xi, 2))
        strain, G = strain_gradients(self.centreline(q, xi, 1), self.centreline(q, xi, 2))
        x_dot = np.concatenate((self.centreline(v, xi, 1), self.centreline(v, xi, 2)), axis=-1)
        total = (strain - ref + self.damping * np.einsum("mki,mi->mk", G, x_dot)) / ref[:, :1]
        return SectionForces(self.EA * total[:, 0], self.EI * total[:, 1])

    def _control_points(
        self, length: float | None, curve: Callable[[np.ndarray], np.ndarray] | np.ndarray | None
    ) -> np.ndarray:
        """Control points of the undeformed centreline, shape (n, 2)."""
        if curve is None:
            return self.basis.interpolate(lambda xi: np.column_stack((length * xi, np.zeros_like(xi))))
        if callable(curve):
            return self.basis.interpolate(lambda xi: _checked_points(curve(xi), len(xi)))
        return _checked_points(curve, self.basis.n)

    @property
    def _at_gauss_points(self) -> tuple[np.ndarray, ...]:
        """Derivatives of the shape functions, stiffness and reference of the strains."""
        return self._shapes[1], self._shapes[2], self._stiffness, self._strain_ref

    def _derivatives(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivative at the Gauss points, shape (elements, gauss, 2) each."""
        local = x.reshape(-1, 2)[self._places]
        return self._shapes[1] @ local, self._shapes[2] @ local

    def _set_gauss_points(self) -> None:
        n, g, p1 = self.elements, self.gauss, self.degree + 1
        xi, weight = self.basis.gauss(g)
        self._shapes = self.basis.values(xi.ravel(), 2).reshape(3, n, g, p1)
        t, c = self._derivatives(self.q_ref)
        speed = np.linalg.norm(t, axis=-1)
        if not (np.isfinite(speed).all() and speed.min() > STANDS * speed.max()):
            raise SceneError("PlanarBeam: the curve stands still somewhere, so its undeformed length is zero there")
        self._strain_ref = strains(t, c)
        self._stiffness = np.array([self.EA, self.EI]) * (weight / speed)[..., None]

    def _set_mass(self) -> None:
        """Constant consistent mass matrix and length."""
        n, p1 = self.elements, self.degree + 1
        xi, weight = self.basis.gauss(ARC_POINTS)
        shapes = self.basis.values(xi.ravel(), 1).reshape(2, n, -1, p1)
        local = self.q_ref.reshape(-1, 2)[self._places]
        ds = weight * np.linalg.norm(shapes[1] @ local, axis=-1)
        self.length = float(ds.sum())
        element = self.line_density * np.einsum("eg,ega,egb->eab", ds, shapes[0], shapes[0])
        self.M = BandMatrix(self._assembly.matrix(np.einsum("eab,kl->eakbl", element, np.eye(2))))
        nodes = self.line_density * np.einsum("eg,ega->ea", ds, shapes[0])
        self.node_mass = np.bincount(self._places.ravel(), nodes.ravel(), self.basis.n)


def _vertical_plane() -> pin.SE3:
    return pin.SE3(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), np.zeros(3))


def _checked_points(points: np.ndarray, n: int) -> np.ndarray:
    return checks.array("PlanarBeam: curve", points, (n, 2))


def _check_mesh(degree: int, elements: int, gauss: int | None) -> int:
    """The number of Gauss points, after a check of all three."""
    checks.integer("PlanarBeam: degree", degree, 2, 20)
    checks.integer("PlanarBeam: elements", elements, 1, MOST)
    gauss = checks.integer("PlanarBeam: gauss", degree + 1 if gauss is None else gauss, 1, 100)
    # two strains at each Gauss point have to leave nothing but the three rigid motions without stiffness
    if 2 * gauss * elements < 2 * (elements + degree) - 3:
        raise SceneError(
            f"PlanarBeam: {elements} elements with {gauss} Gauss points are too few for degree {degree}: "
            "the beam could deform without resistance; take more of either"
        )
    return gauss
