"""Motions in closed form: a box on an incline, a pendulum."""

from __future__ import annotations

import numpy as np
from scipy.special import ellipj, ellipk

from .integration import Motion

HALF = 0.1
"""Half of the edge of the box on the incline [m]."""


def box_on_incline(
    t: np.ndarray, angle: float = np.radians(20.0), mu: float = 0.5, speed: float = -1.0, gravity: float = 9.81
) -> Motion:
    """Box on an incline, started in contact: it slides, may stop, and then sticks or slides back.

    Args:
        t: times [s], shape (n,).
        angle: of the incline [rad].
        mu: friction coefficient [-].
        speed: initial, positive downhill [m/s].
        gravity: [m/s^2].

    Returns:
        q of shape (n, 7) and v of shape (n, 6); their first entries are the distance travelled downhill and its rate.
    """
    pull, grip = gravity * np.sin(angle), mu * gravity * np.cos(angle)
    first = pull - grip * np.sign(speed) if speed else max(pull - grip, 0.0)
    then = max(pull - grip, 0.0)
    stop = -speed / first if speed * first < 0 else np.inf
    t_1 = np.minimum(t, stop)
    t_2 = t - t_1
    q, v = np.zeros((len(t), 7)), np.zeros((len(t), 6))
    q[:, 0] = speed * t_1 + first * t_1**2 / 2 + then * t_2**2 / 2
    q[:, 2], q[:, 6] = HALF, 1.0
    v[:, 0] = np.where(t < stop, speed + first * t, then * t_2)
    return q, v


def pendulum(t: np.ndarray, amplitude: float, frequency: float) -> Motion:
    """Pendulum released at rest, by elliptic functions.

    Args:
        t: times [s], shape (n,).
        amplitude: initial angle from the downward vertical, in (0, pi) [rad].
        frequency: of small oscillations, sqrt(m g l / I) about the pivot [rad/s].

    Returns:
        The angle, shape (n, 1) [rad], and its rate, shape (n, 1) [rad/s].
    """
    k = np.sin(amplitude / 2)
    sn, cn, _, _ = ellipj(ellipk(k**2) + frequency * np.asarray(t), k**2)
    return 2 * np.arcsin(k * sn)[:, None], (2 * k * frequency * cn)[:, None]
