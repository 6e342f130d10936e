"""One rigid body in space: free flight, and the tippe top of section 10.6 on its body and on its stick.

The top: an impact, then a smooth motion with Coulomb-Contensou friction, in which the contact eliminates the height,
z = R - a cos theta of the ball that is on the ground. Where the stick touches the ground, an impact throws the body
off it, and the top slips on. It is followed until all three rows of (157) come to rest, the normal force vanishes, or
the body touches the ground again. Independent of the package.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from .integration import PRECISE, ends_integration

MASS, INERTIA = 6e-3, np.array([8e-7, 8e-7, 7e-7])
R_1, R_2, A_1, A_2 = 1.5e-2, 5e-3, 3e-3, 1.6e-2
MU, GRAVITY = 0.3, 9.81
THETA, HEIGHT, SPIN = 0.1, 1.2015e-2, 180.0
DRILL = 3 * np.pi * 5e-4 / 16
"""Lever of the drilling friction (157) [m]."""
SHORT = 0.5  # a motion that is asked for up to here is integrated no further [s]
UP = np.array([0.0, 0.0, 1.0])


class Ball(NamedTuple):
    """A round end of the top: its radius, and how far its centre is from S along the axis [m]."""

    R: float
    a: float


BODY, STICK = Ball(R_1, A_1), Ball(R_2, A_2)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The product a x b; numpy's is slow for single vectors."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def rotation(p: np.ndarray) -> np.ndarray:
    """Matrix A_IK of the unit quaternion (x, y, z, w)."""
    x, y, z, w = p
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def spin(p: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Rate of the quaternion (x, y, z, w) at the angular velocity omega in the body frame [rad/s]."""
    return 0.5 * np.append(p[3] * omega + cross(p[:3], omega), -p[:3] @ omega)


def free_body(
    t: np.ndarray, q0: np.ndarray, v0: np.ndarray, inertia: np.ndarray, gravity: float = 9.81
) -> tuple[np.ndarray, np.ndarray]:
    """Rigid body in free flight, by Euler's equations; a free flyer with its frame in the centre of mass.

    Args:
        t: times, increasing [s], shape (n,).
        q0: position and quaternion (x, y, z, w), shape (7,).
        v0: linear and angular velocity in the body frame, shape (6,).
        inertia: principal moments of inertia [kg m^2], shape (3,).
        gravity: along -z [m/s^2].

    Returns:
        q (n, 7) and v (n, 6).
    """

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        p, omega = y[:4], y[4:]
        return np.concatenate([spin(p, omega), cross(inertia * omega, omega) / inertia])

    turn = solve_ivp(rate, (0.0, t[-1]), np.concatenate([q0[3:], v0[3:]]), **PRECISE).sol(t).T
    p = turn[:, :4] / np.linalg.norm(turn[:, :4], axis=1, keepdims=True)
    start = rotation(q0[3:]) @ v0[:3]
    fall = np.array([0.0, 0.0, -gravity])
    velocity = start + t[:, None] * fall
    local = np.array([rotation(a).T @ b for a, b in zip(p, velocity, strict=True)])
    return np.hstack([q0[:3] + t[:, None] * start + t[:, None] ** 2 / 2 * fall, p]), np.hstack([local, turn[:, 4:]])


@dataclass
class Contact:
    """Directions of the contact of a ball, in the velocities (v_S in the frame I, Omega in the frame K).

    Attributes:
        A: A_IK.
        ball: the one that touches the ground.
        W_N: (6,), gap velocity W_N.u.
        W_F: (3, 6), friction velocities (157) W_F u.
    """

    A: np.ndarray
    ball: Ball = BODY

    def __post_init__(self) -> None:
        centre = self.ball.a * UP  # in K
        down = self.A.T @ UP * -self.ball.R
        self.W_N = np.concatenate([UP, cross(centre, self.A[2])])
        arm = centre + down
        tangents = [np.concatenate([np.eye(3)[i], cross(arm, self.A[i])]) for i in (0, 1)]
        self.W_F = np.array([*tangents, np.concatenate([np.zeros(3), DRILL * self.A[2]])])


def impact(p: np.ndarray, u: np.ndarray, ball: Ball = BODY) -> np.ndarray:
    """Velocity after the impact that starts a contact: e_N = e_F = 0, all rows keep slipping."""
    contact, weight = Contact(rotation(p), ball), np.concatenate([np.full(3, MASS), INERTIA])
    after = u
    for _ in range(100):
        slip = contact.W_F @ after
        W = (contact.W_N - MU * slip @ contact.W_F / np.linalg.norm(slip)) / weight
        before, after = after, u - W * (contact.W_N @ u) / (contact.W_N @ W)
        if np.abs(after - before).max() < 1e-15 * np.abs(u).max():
            return after
    raise RuntimeError("the impact has no solution that slips")


def accelerations(p: np.ndarray, u: np.ndarray, ball: Ball = BODY) -> tuple[np.ndarray, float]:
    """u_dot, shape (6,), and the normal force that keeps the gap of a ball closed [N]."""
    contact, weight = Contact(rotation(p), ball), np.concatenate([np.full(3, MASS), INERTIA])
    omega = u[3:]
    slip = contact.W_F @ u
    free = np.concatenate([-GRAVITY * UP, cross(INERTIA * omega, omega) / INERTIA])
    W = (contact.W_N - MU * slip @ contact.W_F / np.linalg.norm(slip)) / weight
    # g_N_ddot = W_N.u_dot + vertical part of omega x (omega x centre)
    turning = contact.A[2] @ cross(omega, cross(omega, ball.a * UP))
    la_N = -(contact.W_N @ free + turning) / (contact.W_N @ W)
    return free + W * la_N, la_N


def full_state(y: np.ndarray, ball: Ball = BODY) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, unit quaternion and u of y = (x, y, quaternion, v_x, v_y, Omega), with a ball on the ground."""
    p = y[2:6] / np.linalg.norm(y[2:6])
    A = rotation(p)
    v_z = -A[2] @ cross(y[8:], ball.a * UP)
    return np.array([y[0], y[1], ball.R - ball.a * A[2, 2]]), p, np.array([y[6], y[7], v_z, *y[8:]])


def rate(_: float, y: np.ndarray, ball: Ball) -> np.ndarray:
    """The differential equation of y."""
    p, u = full_state(y, ball)[1:]
    u_dot, _ = accelerations(p, u, ball)
    return np.concatenate([u[:2], spin(p, u[3:]), u_dot[:2], u_dot[3:]])


def sticks(_: float, y: np.ndarray, ball: Ball) -> float:
    """Speed of slip and drilling; the direction of friction is lost where it vanishes."""
    p, u = full_state(y, ball)[1:]
    return np.linalg.norm(Contact(rotation(p), ball).W_F @ u) - 1e-6


def lifts_off(_: float, y: np.ndarray, ball: Ball) -> float:
    """Normal force."""
    p, u = full_state(y, ball)[1:]
    return accelerations(p, u, ball)[1]


def other_lands(_: float, y: np.ndarray, ball: Ball) -> float:
    """Gap of the ball that is in the air; it grows from zero where that has just been thrown off."""
    other = STICK if ball is BODY else BODY
    r, p = full_state(y, ball)[:2]
    return r[2] + other.a * rotation(p)[2, 2] - other.R


def slips_on(t: float, t_end: float, y: np.ndarray, ball: Ball) -> Any:
    """The solution of `solve_ivp` from t on, with a ball on the ground."""
    events = (sticks, lifts_off, other_lands)
    for event in events:
        ends_integration(event, -1)
    return solve_ivp(rate, (t, t_end), y, events=events, args=(ball,), **PRECISE)


def reduced(r: np.ndarray, p: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The integrated y of a motion, see `full_state`."""
    return np.concatenate([r[:2], p, u[:2], u[3:]])


@cache
def slide(t_end: float = 2.0) -> tuple[float, Any]:
    """Time of the first impact, and the solution of `solve_ivp` from there on, on the body."""
    t_1 = float(np.sqrt(2 * (HEIGHT + A_1 * np.cos(THETA) - R_1) / GRAVITY))
    r, p, u = fall(t_1)
    return t_1, slips_on(t_1, t_end, reduced(r, p, impact(p, u)), BODY)


@cache
def stand(t_end: float) -> Any:
    """The solution of `solve_ivp` on the stick, which begins with its impact.

    Raises:
        RuntimeError: that impact does not throw the body off the ground.
    """
    before = slide()[1]
    r, p, u = full_state(before.y[:, -1])
    u = impact(p, u, STICK)
    if not Contact(rotation(p), BODY).W_N @ u > 0.0:
        raise RuntimeError("the body stays on the ground in the impact of the stick")
    return slips_on(before.t[-1], t_end, reduced(r, p, u), STICK)


def fall(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, quaternion and u before the impact: the top falls and spins about its axis of symmetry."""
    p, half = np.array([np.sin(THETA / 2), 0.0, 0.0, np.cos(THETA / 2)]), SPIN * t / 2
    turned = np.array([p[0] * np.cos(half), -p[0] * np.sin(half), p[3] * np.sin(half), p[3] * np.cos(half)])
    position = np.array([0.0, 0.0, HEIGHT - GRAVITY * t**2 / 2])
    return position, turned, np.array([0.0, 0.0, -GRAVITY * t, 0.0, 0.0, SPIN])


def tippe_top(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Section 10.6: on the body up to 1.371 s, then on the stick until something else happens; NaN from then on.

    Args:
        t: times [s], shape (n,).

    Returns:
        q (n, 7) and v (n, 6), the linear velocity in the frame of the world, the angular one in that of the body.
    """
    t_1, first = slide(SHORT) if np.max(t) < SHORT else slide()
    arcs, starts = [(first, BODY)], [t_1]
    if np.max(t) >= first.t[-1]:
        arcs.append((stand(float(np.ceil(np.max(t)))), STICK))
        starts.append(first.t[-1])
    q, v = np.full((len(t), 7), np.nan), np.full((len(t), 6), np.nan)
    for i, s in enumerate(t):
        if s < t_1:
            r, p, u = fall(s)
        else:
            solved, ball = arcs[int(np.searchsorted(starts, s, side="right")) - 1]
            if s > solved.t[-1]:
                break
            r, p, u = full_state(solved.sol(s), ball)
        q[i], v[i] = [*r, *p], u
    return q, v
