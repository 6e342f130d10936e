"""Rolling without slip: the disc in steady precession and in free motion, the ball on a turntable."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from .integration import PRECISE, Motion
from .spinning_body import UP, cross, rotation, spin

RADIUS, GRAVITY = 0.1, 9.81
DISC = RADIUS**2 * np.array([0.25, 0.25, 0.5])
"""Moments of inertia of the thin disc per mass [m^2]."""


def rolling_disc(t: np.ndarray, theta: float = 1.0, rho: float = 0.5) -> Motion:
    """The disc in steady precession, in closed form; parameters as in `robots.rolling_disc`.

    The centre runs along a circle at the rate Omega, the disc turns about its axis at -Omega (rho / r + cos theta).
    """
    s, c = np.sin(theta), np.cos(theta)
    # divided by the mass: C / (m r) = r / 2, A / m = r^2 / 4
    rate = np.sqrt(GRAVITY * RADIUS * c / (s * (1.5 * RADIUS * rho + RADIUS**2 / 4 * c)))
    own = -rate * (rho / RADIUS + c)
    around, turned = rate * t, own * t
    zero = np.zeros_like(around)
    x, y = rho * np.cos(around), rho * np.sin(around)
    # Euler angles z-y-z: the precession, the inclination, the own rotation
    half_sum, half_difference = (around + turned) / 2, (around - turned) / 2
    turn = np.column_stack([
        -np.sin(theta / 2) * np.sin(half_difference), np.sin(theta / 2) * np.cos(half_difference),
        np.cos(theta / 2) * np.sin(half_sum), np.cos(theta / 2) * np.cos(half_sum),
    ])  # fmt: skip
    omega = np.column_stack([-rate * s * np.cos(turned), rate * s * np.sin(turned), zero + rate * c + own])
    q = np.column_stack([x, y, zero + RADIUS * s, turn])
    return q, np.column_stack([-rate * y, rate * x, zero, omega])


def free_rolling_disc(t: np.ndarray, q0: np.ndarray, v0: np.ndarray) -> Motion:
    """The disc that rolls freely on the plane z = 0, by its differential equation.

    Args:
        t: times [s], shape (n,).
        q0: position of the centre and quaternion (x, y, z, w), shape (7,); the rim touches the plane.
        v0: velocity of the centre in the frame I and angular velocity in that of the disc, shape (6,); only the
            latter counts, the former follows from rolling.

    Returns:
        q (n, 7) and v (n, 6) in the same coordinates.
    """
    y0 = np.concatenate([q0[:2], q0[3:], v0[3:]])
    solved = solve_ivp(_rate, (0.0, float(np.max(t)) + 1e-9), y0, **PRECISE).sol(t).T
    q, v = np.empty((len(t), 7)), np.empty((len(t), 6))
    for i, y in enumerate(solved):
        p = y[2:6] / np.linalg.norm(y[2:6])
        A = rotation(p)
        arm = _arm(A[:, 2])
        q[i], v[i] = [*y[:2], -arm[2], *p], [*cross(arm, A @ y[6:]), *y[6:]]
    return q, v


def _arm(n: np.ndarray) -> np.ndarray:
    """From the centre to the contact point; n is the axis of the disc."""
    down = n * n[2] - UP
    return RADIUS * down / np.linalg.norm(down)


def _rate(_: float, y: np.ndarray) -> np.ndarray:
    """The differential equation of (x, y, quaternion, Omega), per mass: angular momentum about the contact point.

    With the arm c from the centre to the contact the centre moves with c x omega, so that
    (I + c.c 1 - c c^T) omega_dot = -omega x (I omega) + c x (c_dot x omega + g e_z).
    """
    p = y[2:6] / np.linalg.norm(y[2:6])
    A, Omega = rotation(p), y[6:]
    omega, n = A @ Omega, A[:, 2]
    n_dot = cross(omega, n)
    down, down_dot = n * n[2] - UP, n_dot * n[2] + n * n_dot[2]
    size = np.linalg.norm(down)
    arm = RADIUS * down / size
    arm_dot = RADIUS * (down_dot / size - down * (down @ down_dot) / size**3)
    inertia = A @ np.diag(DISC) @ A.T
    turned = -cross(omega, inertia @ omega) + cross(arm, cross(arm_dot, omega) + GRAVITY * UP)
    omega_dot = np.linalg.solve(inertia + arm @ arm * np.eye(3) - np.outer(arm, arm), turned)
    # seen from the disc, omega and Omega change at the same rate
    return np.concatenate([cross(arm, omega)[:2], spin(p, Omega), A.T @ omega_dot])


def turntable(t: np.ndarray, rate: float = 3.0, speed: float = 0.1, x: float = 0.15, j: float = 0.4) -> Motion:
    """The ball on the turntable; parameters as in `robots.turntable`.

    The centre runs along a circle at j / (1 + j) of the rate of the table, in closed form; the attitude of the ball is
    integrated from its angular velocity, which is known at every time.
    """
    slow = j / (1.0 + j) * rate
    rho = speed / slow
    angle = slow * np.asarray(t)
    c, s = np.cos(angle), np.sin(angle)
    q, v = np.zeros((len(angle), 8)), np.zeros((len(angle), 7))
    q[:, 0], q[:, 1], q[:, 2] = x - rho + rho * c, rho * s, RADIUS
    v[:, 0], v[:, 1] = -speed * s, speed * c
    q[:, 7], v[:, 6] = rate * t, rate
    q[:, 3:7] = _attitude(float(np.max(t)) + 1e-9, rate, slow, rho, x)(t).T
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    omega = _spin_of_ball(angle, rate, slow, rho, x)
    v[:, 3:6] = [rotation(p).T @ w for p, w in zip(q[:, 3:7], omega, strict=True)]
    return q, v


def _spin_of_ball(angle: np.ndarray, rate: float, slow: float, rho: float, x: float) -> np.ndarray:
    """Angular velocity in the frame I: the lowest point goes with the table, nothing turns about the vertical."""
    faster = (rate - slow) * rho
    along_x, along_y = rate * (x - rho) + faster * np.cos(angle), faster * np.sin(angle)
    return np.column_stack([along_x, along_y, np.zeros_like(along_x)]) / RADIUS


@cache
def _attitude(t_end: float, rate: float, slow: float, rho: float, x: float):
    """The function t -> quaternion."""

    def turning(s: float, p: np.ndarray) -> np.ndarray:
        omega = _spin_of_ball(np.array([slow * s]), rate, slow, rho, x)[0]
        return spin(p, rotation(p / np.linalg.norm(p)).T @ omega)

    return solve_ivp(turning, (0.0, t_end), [0.0, 0.0, 0.0, 1.0], **PRECISE).sol
