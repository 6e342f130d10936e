"""Cross-sections of rods: their stiffness, and their inertia per length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError

TERMS = 40  # of the series of the torsion of a rectangle; the last one is 1e-9 of the sum
ROUNDED = 1e-9  # what moments of inertia of a thin section may miss by digits that are not printed
STEEP = 1e-12  # smallest eigenvalue of a stiffness in parts of its diagonal


@dataclass(frozen=True, init=False, eq=False)
class Section:
    """A cross-section, with the x-axis along the rod and the axes y and z as its principal axes of inertia.

    Attributes:
        stiffness: forces (N, Q_y, Q_z, M_x, M_y, M_z) per strain, symmetric, shape (6, 6) [N or N m^2].
        line_density: mass per length [kg/m].
        line_inertia: moments of inertia per length about x, y and z, shape (3,) [kg m].
        radius: for drawing, and for contacts where none is given [m]; 0 where the section says none.
    """

    stiffness: np.ndarray
    line_density: float
    line_inertia: np.ndarray
    radius: float

    def __init__(
        self,
        EA: float | None = None,
        GA: Sequence[float] | None = None,
        GJ: float | None = None,
        EI: Sequence[float] | None = None,
        *,
        line_density: float,
        line_inertia: Sequence[float],
        stiffness: np.ndarray | None = None,
        radius: float = 0.0,
    ):
        """Stiffnesses one by one, or all of them as a matrix.

        Args:
            EA: of stretch [N].
            GA: of shear along y and z, shape (2,) [N].
            GJ: of torsion [N m^2].
            EI: of bending about y and z, shape (2,) [N m^2].
            line_density: [kg/m].
            line_inertia: shape (3,) [kg m].
            stiffness: shape (6, 6), instead of the four.
            radius: [m].

        Raises:
            SceneError: a number is not positive, the matrix is not symmetric and positive definite, or the moments of
                inertia are those of no body.
        """
        if stiffness is None:
            given = {"EA": (EA, 1), "GA": (GA, 2), "GJ": (GJ, 1), "EI": (EI, 2)}
            diagonal = np.concatenate([_positive(f"Section: {n}", x, size) for n, (x, size) in given.items()])
            stiffness = np.diag(diagonal)
        elif any(x is not None for x in (EA, GA, GJ, EI)):
            raise SceneError("Section: give either EA, GA, GJ and EI or the matrix stiffness, not both")
        else:
            stiffness = checks.array("Section: stiffness", stiffness, (6, 6))
            size = np.sqrt(np.abs(np.diag(stiffness)))
            scaled = stiffness / np.outer(np.where(size > 0, size, 1.0), np.where(size > 0, size, 1.0))
            if np.abs(scaled - scaled.T).max() > STEEP or np.linalg.eigvalsh(scaled).min() <= STEEP:
                raise SceneError("Section: stiffness must be symmetric and positive definite")
        inertia = _positive("Section: line_inertia", line_inertia, 3)
        if 2.0 * inertia.max() > inertia.sum() * (1.0 + ROUNDED):
            raise SceneError(
                f"Section: line_inertia = {inertia.tolist()} is that of no body: one exceeds the other two"
            )
        values = (
            stiffness,
            checks.number("Section: line_density", line_density, 0.0, above=True),
            inertia,
            checks.number("Section: radius", radius, 0.0),
        )
        for name, value in zip(("stiffness", "line_density", "line_inertia", "radius"), values, strict=True):
            object.__setattr__(self, name, value)

    @classmethod
    def round(cls, radius: float, E: float, nu: float, density: float) -> Section:
        """A solid circle; shear factor by G. R. Cowper, doi:10.1115/1.3625046.

        Args:
            radius: [m].
            E: Young's modulus [Pa].
            nu: Poisson's ratio [-].
            density: [kg/m^3].
        """
        return cls.tube(radius, 0.0, E, nu, density)

    @classmethod
    def tube(cls, outer: float, inner: float, E: float, nu: float, density: float) -> Section:
        """A circular tube; shear factor by G. R. Cowper, doi:10.1115/1.3625046.

        Args:
            outer: radius [m].
            inner: radius [m], less than the outer one.
            E: [Pa].
            nu: [-].
            density: [kg/m^3].
        """
        outer = checks.number("Section: outer radius", outer, 0.0, above=True)
        inner = checks.number("Section: inner radius", inner, 0.0)
        if inner >= outer:
            raise SceneError(f"Section: the inner radius {inner:g} m must be less than the outer one, {outer:g} m")
        m2 = (inner / outer) ** 2
        shear = 6 * (1 + nu) * (1 + m2) ** 2 / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)
        area, bending = np.pi * (outer**2 - inner**2), np.pi / 4 * (outer**4 - inner**4)
        return cls._of(area, (shear, shear), 2 * bending, (bending, bending), (E, nu, density), outer)

    @classmethod
    def rectangle(cls, width: float, height: float, E: float, nu: float, density: float) -> Section:
        """A rectangle; torsion by the series of Saint-Venant, shear factor by Cowper.

        Args:
            width: along y [m].
            height: along z [m].
            E: [Pa].
            nu: [-].
            density: [kg/m^3].
        """
        width = checks.number("Section: width", width, 0.0, above=True)
        height = checks.number("Section: height", height, 0.0, above=True)
        long, short = max(width, height), min(width, height)
        n = 2 * np.arange(TERMS) + 1
        series = np.sum(np.tanh(0.5 * np.pi * n * long / short) / n**5.0)
        torsion = long * short**3 / 3 * (1 - 192 * short / (np.pi**5 * long) * series)
        shear = 10 * (1 + nu) / (12 + 11 * nu)
        bending = width * height**3 / 12, height * width**3 / 12
        return cls._of(width * height, (shear, shear), torsion, bending, (E, nu, density), 0.5 * short)

    @classmethod
    def _of(
        cls,
        area: float,
        shear: tuple[float, float],
        torsion: float,
        bending: tuple[float, float],
        material: tuple[float, float, float],
        radius: float,
    ) -> Section:
        """Of one material (E, nu, density)."""
        E, nu, density = material
        E = checks.number("Section: E", E, 0.0, above=True)
        density = checks.number("Section: density", density, 0.0, above=True)
        nu = checks.number("Section: nu", nu, -0.99, 0.5)
        G = 0.5 * E / (1 + nu)
        return cls(
            E * area,
            (G * area * shear[0], G * area * shear[1]),
            G * torsion,
            (E * bending[0], E * bending[1]),
            line_density=density * area,
            line_inertia=(density * sum(bending), density * bending[0], density * bending[1]),
            radius=radius,
        )


def _positive(what: str, given: object, n: int) -> np.ndarray:
    """Positive numbers, shape (n,)."""
    if given is None:
        raise SceneError(f"{what} is missing")
    values = np.full(1, checks.number(what, given, 0.0, above=True)) if n == 1 else checks.array(what, given, (n,))
    if values.min() <= 0.0:
        raise checks.fail(what, given, "positive numbers")
    return values
