"""A coordinate made of joint coordinates: one of them, or the sum of several, each with its factor.

It is what springs, gears, actuators and the fixed tendons of MJCF act on. A continuous joint, whose q is (cos, sin),
counts by its angle, which is known up to whole turns.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName

TURN = 2 * np.pi


Joints = str | Mapping[str, float]
"""The name of a joint, or factors by the names of several."""


def joint_factors(what: str, joints: Joints) -> Joints:
    """What a user gave for a joint, checked.

    Raises:
        SceneError: it is neither a name nor finite factors, other than zero, by name.
    """
    if not isinstance(joints, Mapping):
        return checks.name(what, joints)
    factors = {checks.name(what, name): checks.number(f"{what}: factor of {name}", x) for name, x in joints.items()}
    for name, factor in factors.items():
        if not factor:
            raise checks.fail(f"{what}: factor of {name}", factor, "a number other than 0")
    return factors


def names_in(joints: Joints) -> list[str]:
    """The joints that take part."""
    return [joints] if isinstance(joints, str) else list(joints)


class JointSum:
    """The sum of factor times coordinate over some joints of a model.

    Args:
        owner: what it belongs to, for messages.
        joints: name of a joint with one coordinate, or factors by name; the sum over none is zero.
        model: that has the joints.

    Attributes:
        row: its derivative by v, shape (nv,).
        period: what is added to it by a whole turn of a continuous joint, inf where it has no such joint.

    Raises:
        UnknownName: a joint is not there. SceneError: it has several coordinates, or a continuous joint is
            one of several.
    """

    def __init__(self, owner: str, joints: Joints, model: pin.Model):
        factors = {joints: 1.0} if isinstance(joints, str) else dict(joints)
        self.row, self.period = np.zeros(model.nv), np.inf
        self._plain: list[tuple[int, float]] = []
        self._turns: int | None = None
        for name, factor in factors.items():
            if not model.existJointName(name):
                raise UnknownName("joint", name, list(model.names)[1:])
            j = model.getJointId(name)
            if model.nvs[j] != 1:
                raise SceneError(f"{owner}: joint {name!r} has {model.nvs[j]} coordinates, only one is possible")
            self.row[model.idx_vs[j]] += factor
            if model.nqs[j] == 1:
                self._plain.append((model.idx_qs[j], float(factor)))
                continue
            if len(factors) > 1:
                raise SceneError(f"{owner}: the continuous joint {name!r} cannot be summed with others")
            self._turns, self._factor, self.period = model.idx_qs[j], float(factor), TURN * abs(float(factor))

    @property
    def parts(self) -> tuple[list[int], list[float]]:
        """Places in q and factors; where there is a period, those of cosine and sine, and the factor of the angle."""
        if self._turns is not None:
            return [self._turns, self._turns + 1], [self._factor]
        return [place for place, _ in self._plain], [factor for _, factor in self._plain]

    def value(self, q: np.ndarray) -> float:
        """The sum at q, of a continuous joint in the turn about 0 [rad or m]."""
        if self._turns is not None:
            return self._factor * float(np.arctan2(q[self._turns + 1], q[self._turns]))
        return float(sum(factor * q[i] for i, factor in self._plain))

    def size(self, q: np.ndarray) -> float:
        """The largest part of the sum, whose rounding is felt in it [rad or m]."""
        return max(
            (abs(factor * q[i]) for i, factor in self._plain), default=0.0 if self._turns is None else self.period
        )

    def nearest(self, difference: float) -> float:
        """A difference of two values, without whole turns."""
        return nearest(difference, self.period)


def nearest(difference: float, period: float) -> float:
    """The number next to zero that differs by a multiple of the period."""
    return difference if np.isinf(period) else difference - period * round(difference / period)
