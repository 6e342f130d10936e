"""Reference motions, independent of the package: closed forms, and event-driven integration to round-off.

Every function takes the times t (n,) in [s] and returns (q, v), each with one row per time, in the coordinates of the
module of the same name in robots/. Velocities are right-continuous: at the time of an impact they are those after it.
A reference that ends at an event gives NaN after it.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk
from spinning_body import free_body, tippe_top
from walled_ball import Arc, WalledBall, sample

__all__ = [
    "ball_in_corner",
    "ball_in_cylinder",
    "free_body",
    "painleve_rod",
    "pendulum",
    "rotating_ball",
    "sliding_block",
    "tippe_top",
]

Motion = tuple[np.ndarray, np.ndarray]
"""(q, v): shapes (n, nq) and (n, nv)."""

PRECISE = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "dense_output": True}


def rotating_ball_arcs(
    omega: float = 50.0, e_N: float = 0.0, mu: float = 0.2, height: float = 1.0, t_end: float = 3.0
) -> list[Arc]:
    """Section 10.1: free fall, impacts with friction (also infinitely many), slip, stick."""
    ball = WalledBall(np.array([[0.0, 1.0]]), np.array([mu]), np.array([e_N]))
    return ball.arcs(np.array([0.0, height, 0.0]), np.array([0.0, 0.0, omega]), t_end)


def rotating_ball(t: np.ndarray, **parameters: float) -> Motion:
    """Section 10.1, sampled; parameters as in `rotating_ball_arcs`."""
    return sample(rotating_ball_arcs(t_end=np.max(t), **parameters), t)


def ball_in_corner_arcs(t_end: float = 3.0) -> list[Arc]:
    """Section 10.2 with the paper's parameters; wall 0 is "right", wall 1 is "left"."""
    s = np.sqrt(0.5)
    ball = WalledBall(np.array([[-s, s], [s, s]]), np.array([0.3, 0.3]), np.array([0.5, 0.0]))
    return ball.arcs(np.array([-0.5, 1.0, 0.0]), np.zeros(3), t_end)


def ball_in_corner(t: np.ndarray) -> Motion:
    """Section 10.2, sampled."""
    return sample(ball_in_corner_arcs(np.max(t)), t)


def sliding_block(t: np.ndarray, angle: float, mu: float, speed: float = 0.0, gravity: float = 9.81) -> Motion:
    """Block on an incline, started in contact: it slides, may stop, and then sticks or slides back.

    Args:
        t: times [s], shape (n,).
        angle: of the incline [rad].
        mu: friction coefficient [-].
        speed: initial, positive downhill [m/s].
        gravity: [m/s^2].

    Returns:
        The distance travelled downhill, shape (n, 1) [m], and its rate, shape (n, 1) [m/s].
    """
    pull, grip = gravity * np.sin(angle), mu * gravity * np.cos(angle)
    first = pull - grip * np.sign(speed) if speed else max(pull - grip, 0.0)
    then = max(pull - grip, 0.0)
    stop = -speed / first if speed * first < 0 else np.inf
    t_1 = np.minimum(t, stop)
    t_2 = t - t_1
    s = speed * t_1 + first * t_1**2 / 2 + then * t_2**2 / 2
    return s[:, None], np.where(t < stop, speed + first * t, then * t_2)[:, None]


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


def ball_in_cylinder(t: np.ndarray) -> Motion:
    """Section 10.3: slip and stick along the wall, by the angle psi of the centre and the angle phi of the ball."""
    times, _, arcs = ball_in_cylinder_arcs(float(t[-1]))
    y = np.array([arcs[max(np.searchsorted(times, s, side="right") - 1, 0)](s) for s in t])
    psi, phi, psi_dot, phi_dot = y.T
    x, z = 0.9 * np.cos(psi), 1.0 + 0.9 * np.sin(psi)
    v = np.column_stack([-0.9 * np.sin(psi) * psi_dot, 0.9 * np.cos(psi) * psi_dot, phi_dot])
    return np.column_stack([x, z, np.cos(phi), np.sin(phi)]), v


@cache
def ball_in_cylinder_arcs(t_end: float) -> tuple[list[float], list[float], list]:
    """Slip and stick: start [s], sign of the slip (0: stick), and the function t -> (psi, phi, psi_dot, phi_dot)."""
    g, mu, R, rho, m = 9.81, 0.1, 0.1, 0.9, 1.0
    inertia = 0.4 * m * R**2

    def forces(y: np.ndarray, slip: float) -> tuple[float, float]:
        la_N = m * (rho * y[2] ** 2 - g * np.sin(y[0]))
        return la_N, -slip * mu * la_N if slip else 2 / 7 * m * g * np.cos(y[0])

    def rate(_: float, y: np.ndarray, slip: float) -> list[float]:
        la_F = forces(y, slip)[1]
        return [y[2], y[3], (la_F / m - g * np.cos(y[0])) / rho, R * la_F / inertia]

    def slip_ends(_: float, y: np.ndarray, slip: float) -> float:
        # it starts at zero and grows with the sign of the slip
        return slip * (rho * y[2] + R * y[3]) if slip else 1.0

    def stick_ends(_: float, y: np.ndarray, slip: float) -> float:
        la_N, la_F = forces(y, slip)
        return 1.0 if slip else mu * la_N - abs(la_F)

    for event in (slip_ends, stick_ends):
        event.terminal, event.direction = True, -1

    t, y, slip = 0.0, np.array([np.pi, 0.0, 0.0, 0.0]), 1.0
    starts, slips, arcs = [], [], []
    while t < t_end:
        part = solve_ivp(rate, (t, t_end), y, args=(slip,), events=(slip_ends, stick_ends), **PRECISE)
        starts.append(float(t))
        slips.append(float(slip))
        arcs.append(part.sol)
        t, y = part.t[-1], part.y[:, -1].copy()
        y[3] = -rho * y[2] / R if t < t_end else y[3]
        la_N, la_F = forces(y, 0.0)
        slip = 0.0 if slip and abs(la_F) <= mu * la_N else -np.sign(la_F)
    return starts, slips, arcs


def painleve_rod(t: np.ndarray) -> Motion:
    """Section 10.4: the rod slides on its tip until the normal force blows up; NaN from then on."""
    slide = painleve_slide()
    t_c = slide.t[-1]
    y = np.where(np.asarray(t) < t_c, slide.sol(np.minimum(t, t_c)), np.nan)
    x, z, phi, *v = y
    return np.column_stack([x, z, np.cos(phi), np.sin(phi)]), np.column_stack(v)


@cache
def painleve_slide():
    """The solution of `solve_ivp` for (x, z, phi) and rates; its last time is that of the blow-up."""
    g, mu, length, m = 10.0, 5 / 3, 1.0, 1.0
    inertia = m * length**2 / 3

    def compliance(phi: float) -> float:
        # the normal acceleration of the tip per normal force while it slides
        return 1 / m + length**2 / inertia * np.cos(phi) * (np.cos(phi) - mu * np.sin(phi))

    def rate(_: float, y: np.ndarray) -> list[float]:
        phi, phi_dot = y[2], y[5]
        la_N = (g - length * np.sin(phi) * phi_dot**2) / compliance(phi)
        torque = length * la_N * (mu * np.sin(phi) - np.cos(phi))
        return [*y[3:], -mu * la_N / m, la_N / m - g, torque / inertia]

    def blows_up(_: float, y: np.ndarray) -> float:
        return compliance(y[2]) - 1e-9

    blows_up.terminal = True
    phi = np.radians(31.0)
    return solve_ivp(rate, (0.0, 2.0), [0.0, length * np.sin(phi), phi, 30.0, 0.0, 0.0], events=blows_up, **PRECISE)
