"""Bodies that deform, as tubes around a centreline that changes from step to step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ngalpha_pin.errors import SceneError

if TYPE_CHECKING:
    from ngalpha_pin import Trajectory

SIDES = 16  # of the polygon that stands for the circle
COLOR = (0.36, 0.46, 0.58, 1.0)


@dataclass(frozen=True)
class Tube:
    """A tube at F steps.

    Attributes:
        name: of the body.
        points: centreline in the world [m], shape (F, n, 3).
        radius: [m].
    """

    name: str
    points: np.ndarray
    radius: float


def tubes(trajectory: Trajectory, index: np.ndarray) -> tuple[Tube, ...]:
    """The deforming bodies of a run at chosen steps.

    They are read from `trajectory.tubes`, which only runs with such bodies have: a name, the centreline in the world,
    shape (n + 1, n_points, 3) [m], and a radius [m] for each.

    Args:
        trajectory: any run.
        index: steps, shape (F,).

    Raises:
        SceneError: a centreline of the wrong shape, or a radius that is not positive.
    """
    found = []
    for name, points, radius in getattr(trajectory, "tubes", ()):
        points = np.asarray(points, dtype=float)
        if points.ndim != 3 or points.shape[::2] != (len(trajectory.t), 3) or points.shape[1] < 2:
            raise SceneError(
                f"tube {name!r}: its points have shape {points.shape}, not ({len(trajectory.t)}, n, 3) with n >= 2"
            )
        if not (np.isfinite(radius) and radius > 0):
            raise SceneError(f"tube {name!r}: radius = {radius} must be positive")
        found.append(Tube(str(name), points[index], float(radius)))
    return tuple(found)


def tube_surface(points: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """The surface around one centreline, closed at its ends.

    The circles lie across the curve; each is turned as little as possible against the one before it.

    Args:
        points: shape (n, 3) [m].
        radius: [m].

    Returns:
        Vertices, shape (n * SIDES + 2, 3) [m], and triangles, shape (2 n * SIDES, 3).
    """
    tangents = np.gradient(points, axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-300)
    across = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    rings = np.empty((len(points), SIDES, 3))
    for k, (point, tangent) in enumerate(zip(points, tangents, strict=True)):
        across = across - tangent * (tangent @ across)
        across = across / max(np.linalg.norm(across), 1e-300)
        circle = np.outer(np.cos(angle), across) + np.outer(np.sin(angle), np.cross(tangent, across))
        rings[k] = point + radius * circle
    first = np.arange((len(points) - 1) * SIDES)
    side = np.roll(np.arange(SIDES), -1)[first % SIDES] + first // SIDES * SIDES
    walls = [np.stack([first, side, side + SIDES], axis=1), np.stack([first, side + SIDES, first + SIDES], axis=1)]
    ends = len(points) * SIDES
    rim, following = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    last = ends - SIDES
    caps = [
        np.stack([np.full(SIDES, ends), following, rim], axis=1),
        np.stack([np.full(SIDES, ends + 1), last + rim, last + following], axis=1),
    ]
    return np.concatenate([rings.reshape(-1, 3), points[[0, -1]]]), np.concatenate([*walls, *caps])
