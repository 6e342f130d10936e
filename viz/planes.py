"""Half-spaces as finite pieces of their surface, each cut where another one begins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import coal
import numpy as np
import pinocchio as pin

if TYPE_CHECKING:
    from ngalpha_pin import Scene

REACH = 3.0  # half the side of a drawn piece, in diagonals of the motion
CELLS = 40  # grid cells along it, about


@dataclass(frozen=True)
class Plane:
    """A piece of a plane.

    Attributes:
        name: of the geometry.
        joint: it is attached to; 0 is the world.
        center: about which the piece lies, in the joint's frame [m], shape (3,).
        normal: out of the material, shape (3,).
        axes: two unit vectors in the plane, shape (2, 3).
        polygon: its convex outline, in order [m], shape (n, 3).
        radius: half the side of the piece before it was cut [m].
        cell: side of a grid cell [m]: 1, 2 or 5 times a power of ten.
    """

    name: str
    joint: int
    center: np.ndarray
    normal: np.ndarray
    axes: np.ndarray
    polygon: np.ndarray
    radius: float
    cell: float


def planes(scene: Scene, low: np.ndarray, high: np.ndarray) -> list[Plane]:
    """Visible pieces of every half-space of a scene.

    Args:
        scene: with the half-spaces.
        low: lower corner of the box of the motion [m], shape (3,).
        high: upper corner [m], shape (3,).
    """
    geometries = [g for g in scene.declared_shapes.geometryObjects if is_plane(g)]
    surfaces = [(g, *_surface(g)) for g in geometries]
    center, radius = (low + high) / 2, REACH * max(float(np.linalg.norm(high - low)), 1e-3)
    pieces = []
    for geometry, point, normal in surfaces:
        middle = center if geometry.parentJoint == 0 else point
        middle = middle - normal * (normal @ (middle - point))
        axes = _axes(normal)
        square = middle + radius * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) @ axes
        polygon = square
        for other, other_point, other_normal in surfaces:
            if other is not geometry and other.parentJoint == geometry.parentJoint == 0:
                polygon = cut(polygon, other_point, other_normal)
        if len(polygon) < 3:  # behind another plane altogether: show where it is all the same
            polygon = square
        cell = nice(2 * radius / CELLS)
        pieces.append(Plane(geometry.name, geometry.parentJoint, middle, normal, axes, polygon, radius, cell))
    return pieces


def is_plane(geometry: pin.GeometryObject) -> bool:
    """Whether the geometry is a half-space or a plane."""
    return isinstance(geometry.geometry, (coal.Halfspace, coal.Plane))


def cut(polygon: np.ndarray, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The part of a convex polygon on the side of a plane that its normal points to.

    Args:
        polygon: corners in order [m], shape (n, 3).
        point: of the plane [m], shape (3,).
        normal: of the plane, shape (3,).

    Returns:
        Corners of the rest [m], shape (m, 3); none if nothing is left.
    """
    height = (polygon - point) @ normal
    rest = []
    for k, (corner, h) in enumerate(zip(polygon, height, strict=True)):
        before, h_before = polygon[k - 1], height[k - 1]
        if h * h_before < 0:
            rest.append(before + (corner - before) * h_before / (h_before - h))
        if h >= 0:
            rest.append(corner)
    return np.array(rest).reshape(-1, 3)


def grid_segments(plane: Plane) -> np.ndarray:
    """Ends of the grid lines inside the polygon [m], two rows per line, shape (2 n, 3)."""
    ends = []
    inside = (plane.polygon - plane.center) @ plane.axes.T
    for axis in (0, 1):
        low, high = inside[:, axis].min(), inside[:, axis].max()
        for offset in plane.cell * np.arange(np.ceil(low / plane.cell), np.floor(high / plane.cell) + 1):
            # a line leaves a convex polygon where its edges cross the offset
            height = inside[:, axis] - offset
            crossing = [
                corner + (following - corner) * h / (h - h_next)
                for corner, following, h, h_next in zip(
                    plane.polygon, np.roll(plane.polygon, -1, axis=0), height, np.roll(height, -1), strict=True
                )
                if h * h_next < 0
            ]
            if len(crossing) == 2:
                ends += crossing
    return np.array(ends).reshape(-1, 3)


def nice(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above a positive value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(k for k in (1, 2, 5) if k * power <= value * (1 + 1e-12)) * power)


def _surface(geometry: pin.GeometryObject) -> tuple[np.ndarray, np.ndarray]:
    shape, placement = geometry.geometry, geometry.placement
    normal = placement.rotation @ shape.n
    return placement.translation + shape.d * normal, normal


def _axes(normal: np.ndarray) -> np.ndarray:
    """Two unit vectors across the normal, the first one along x where possible: (2, 3)."""
    along = np.eye(3)[0 if abs(normal[0]) < 0.9 else 1]
    first = along - normal * (normal @ along)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])
