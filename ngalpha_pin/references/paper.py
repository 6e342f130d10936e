"""The planar benchmarks of the paper, sections 10.1 to 10.4, from event to event."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from .integration import PRECISE, Motion, ends_integration
from .walled_ball import Arc, WalledBall, sample


def rotating_ball_arcs(
    omega: float = 50.0, e_N: float = 0.0, mu: float = 0.2, height: float = 1.0, t_end: float = 3.0
) -> list[Arc]:
    """Section 10.1: free fall, impacts with friction (also infinitely many), slip, stick."""
    ball = WalledBall(np.array([[0.0, 1.0]]), np.array([mu]), np.array([e_N]))
    return ball.arcs(np.array([0.0, height, 0.0]), np.array([0.0, 0.0, omega]), t_end)


def rotating_ball(t: np.ndarray, **parameters: float) -> Motion:
    """Section 10.1, sampled; parameters as in `rotating_ball_arcs`."""
    return sample(cached_ball_arcs(t_end=float(np.ceil(np.max(t))), **parameters), t)


cached_ball_arcs = cache(rotating_ball_arcs)


def ball_in_corner_arcs(
    t_end: float = 3.0,
    alpha: float = np.pi / 4,
    beta: float = np.pi / 4,
    e_N_right: float = 0.5,
    e_N_left: float = 0.0,
    mu: float = 0.3,
    x: float = -0.5,
    height: float = 1.0,
) -> list[Arc]:
    """Section 10.2; wall 0 is "right", wall 1 is "left", parameters as in `robots.ball_in_corner`."""
    normals = np.array([[-np.sin(alpha), np.cos(alpha)], [np.sin(beta), np.cos(beta)]])
    ball = WalledBall(normals, np.array([mu, mu]), np.array([e_N_right, e_N_left]))
    return ball.arcs(np.array([x, height, 0.0]), np.zeros(3), t_end)


def ball_in_corner(t: np.ndarray, **parameters: float) -> Motion:
    """Section 10.2, sampled; parameters as in `ball_in_corner_arcs`."""
    return sample(cached_corner_arcs(float(np.ceil(np.max(t))), **parameters), t)


cached_corner_arcs = cache(ball_in_corner_arcs)


def ball_in_cylinder(t: np.ndarray) -> Motion:
    """Section 10.3: slip and stick along the wall, by the angle psi of the centre and the angle phi of the ball."""
    # whole seconds, so that other times find the same arcs again
    times, _, arcs = ball_in_cylinder_arcs(float(np.ceil(t[-1])))
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
        ends_integration(event, -1)

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

    ends_integration(blows_up)
    phi = np.radians(31.0)
    return solve_ivp(rate, (0.0, 2.0), [0.0, length * np.sin(phi), phi, 30.0, 0.0, 0.0], events=blows_up, **PRECISE)
