"""What the adapters share: joints of Pinocchio in the words of other simulators, and what those cannot express."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.scene import Scene

HINGES = ("RX", "RY", "RZ", "RevoluteUnaligned")
SLIDES = ("PX", "PY", "PZ", "PrismaticUnaligned")


def joint_kind(model: pin.Model, j: int) -> str:
    """What a joint is elsewhere: free, ball, angle (cos and sin here), translation, hinge or slide.

    Raises:
        SceneError: none of them.
    """
    kind = model.joints[j].shortname().removeprefix("JointModel")
    known = {"FreeFlyer": "free", "Spherical": "ball", "Translation": "translation"}
    if kind in known:
        return known[kind]
    if kind.startswith(("RUB", "RevoluteUnbounded")):
        return "angle"
    if kind in HINGES:
        return "hinge"
    if kind in SLIDES:
        return "slide"
    raise SceneError(f"joint {model.names[j]!r} of type {kind} has no counterpart")


def joint_axis(model: pin.Model, j: int) -> np.ndarray:
    """Axis of a joint with one degree of freedom, in its own frame, shape (3,)."""
    data = model.joints[j].createData()
    q = pin.neutral(model)[model.idx_qs[j] :][: model.nqs[j]]
    model.joints[j].calc(data, q)
    column = np.asarray(data.S).ravel()
    return column[:3] if np.linalg.norm(column[:3]) > 0.5 else column[3:]


def principal_axes(inertia: pin.Inertia) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments, shape (3,) [kg m^2], and their axes as the columns of a rotation matrix."""
    values, axes = np.linalg.eigh(inertia.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return np.maximum(values, 0.0), axes


def touching(scene: Scene) -> list[str]:
    """Names of the geometries that contacts name, sorted.

    Raises:
        SceneError: one of them is touched from its inside.
    """
    names = {name for pair in scene.contacts for name in (pair.geometry_a, pair.geometry_b)}
    if scene.hollow & names:
        raise SceneError("it has no shape that is touched from its inside")
    return sorted(names)


def no_beams(scene: Scene) -> None:
    """Raise a SceneError where the scene has beams."""
    if scene.beams:
        raise SceneError("the beams of this package are not carried over")


def wxyz(xyzw: np.ndarray) -> list[float]:
    """A quaternion with its scalar first."""
    return [float(xyzw[3]), *map(float, xyzw[:3])]
