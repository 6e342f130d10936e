"""What a `pin.Model` says of its joints beyond the tree: limits, dry friction, damping, armature, effort."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import UnknownName

# larger numbers are how files and Pinocchio write "no limit"
NO_LIMIT = 1e300


@dataclass(frozen=True)
class JointLaws:
    """Which properties of the joints act; all of them by default.

    Attributes:
        limits: positions stay within `model.lowerPositionLimit` and `upperPositionLimit`, as unilateral constraints.
            Joints with more than one coordinate and limits that are infinite or empty (lower >= upper) have none.
        friction: dry friction within `model.lowerDryFrictionLimit` and `upperDryFrictionLimit`, set-valued.
        damping: the torque -model.damping v.
        armature: inertia of the rotors, `model.armature`.
        effort: controls (`JointPD`, `Control`, the tau of `Simulator.step`) stay within `model.lowerEffortLimit` and
            `upperEffortLimit`; an upper limit of zero, the default of a URDF joint, is none.
        e_N: restitution coefficient of the limits [-], a number or one per joint name.
    """

    limits: bool = True
    friction: bool = True
    damping: bool = True
    armature: bool = True
    effort: bool = True
    e_N: float | Mapping[str, float] = field(default=0.0)

    def __post_init__(self) -> None:
        """Check types and ranges; the names are those of a model."""
        for what in ("limits", "friction", "damping", "armature", "effort"):
            checks.flag(f"JointLaws: {what}", getattr(self, what))
        for name, e_N in self.e_N.items() if isinstance(self.e_N, Mapping) else [("every joint", self.e_N)]:
            checks.number(f"JointLaws: e_N of {name}", e_N, 0.0, 1.0)

    def restitution(self, model: pin.Model) -> dict[str, float]:
        """Coefficient of every joint.

        Raises:
            UnknownName: e_N names a joint that is not there.
        """
        given = dict(self.e_N) if isinstance(self.e_N, Mapping) else {name: self.e_N for name in model.names}
        for name in given:
            if name not in model.names:
                raise UnknownName("joint", name, list(model.names)[1:])
        return {name: given.get(name, 0.0) for name in model.names}


class JointLimit(NamedTuple):
    """One end of the range of a joint, g_N = sign (q - value).

    Attributes:
        name: e.g. "knee lower limit".
        joint: its index.
        q, dof: places of its coordinate in q and in v.
        sign: +1 for a lower, -1 for an upper limit.
        value: the limit [rad or m].
        yardstick: size of gaps that counts as one, 1 rad or the range of a joint that slides [rad or m].
        e_N: restitution coefficient [-].
    """

    name: str
    joint: int
    q: int
    dof: int
    sign: float
    value: float
    yardstick: float
    e_N: float


def joint_limits(model: pin.Model, laws: JointLaws) -> list[JointLimit]:
    """The limits that the model states, in the order of its joints."""
    if not laws.limits:
        return []
    restitution, found = laws.restitution(model), []
    for j in range(1, model.njoints):
        if model.nqs[j] != 1 or model.nvs[j] != 1:
            continue
        name, q, dof = model.names[j], model.idx_qs[j], model.idx_vs[j]
        lower, upper = float(model.lowerPositionLimit[q]), float(model.upperPositionLimit[q])
        if not lower < upper:
            continue
        slides = model.joints[j].shortname().startswith("JointModelP")
        size = min(1.0, upper - lower) if slides else 1.0
        for side, sign, value in (("lower", 1.0, lower), ("upper", -1.0, upper)):
            if abs(value) < NO_LIMIT:
                found.append(JointLimit(f"{name} {side} limit", j, q, dof, sign, value, size, restitution[name]))
    return found


def within_limits(model: pin.Model, q: np.ndarray) -> np.ndarray:
    """The configuration nearest to q within the limits that the model states, shape (nq,)."""
    q = q.copy()
    for limit in joint_limits(model, JointLaws()):
        q[limit.q] = limit.sign * max(limit.sign * q[limit.q], limit.sign * limit.value)
    return q


def effort_bounds(model: pin.Model, laws: JointLaws) -> tuple[np.ndarray, np.ndarray] | None:
    """Lower and upper bound of the controls, shape (nv,) each [N m or N]; None where there is none."""
    lower, upper = np.array(model.lowerEffortLimit), np.array(model.upperEffortLimit)
    none = (upper <= 0.0) | (lower >= upper)
    lower[none | (lower < -NO_LIMIT)], upper[none | (upper > NO_LIMIT)] = -np.inf, np.inf
    if not laws.effort or not np.isfinite([lower, upper]).any():
        return None
    return lower, upper


def own_motions(model: pin.Model, joint: int) -> np.ndarray:
    """Twists of a joint per unit of each of its own coordinates, in its frame at the neutral position, shape (6, n).

    Of the joint alone: a `pin.Data` of the model has tensors of size nv^3, 4 GB for 64 free bodies.
    """
    kind = model.joints[joint]
    data = kind.createData()
    kind.calc(data, pin.neutral(model))
    return np.array(data.S).reshape(6, kind.nv)


def linear_coordinates(model: pin.Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which coordinates are lengths: a mask over v, shape (nv,), and the places of lengths and of the others in q."""
    slides = np.zeros(model.nv, dtype=bool)
    lengths: list[int] = []
    angles: list[int] = []
    for j in range(1, model.njoints):
        q, v, n = model.idx_qs[j], model.idx_vs[j], model.nvs[j]
        S = own_motions(model, j)
        slides[v : v + n] = ~(np.abs(S[3:]) > 0.0).any(axis=0)
        first = int(slides[v : v + n].sum())  # positions come first in the joints that have them
        lengths += range(q, q + first)
        angles += range(q + first, q + model.nqs[j])
    return slides, np.array(lengths, dtype=int), np.array(angles, dtype=int)
