"""A planar ball and flat walls with friction and restitution, from event to event; exact to round-off.

Between events every acceleration is constant, so that the motion is a list of parabolas; the contact laws are solved by
trying all their cases. Independent of the package.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import linprog

ROUND_OFF = 1e-12
"""Speeds [m/s] and accelerations [m/s^2] below this are zero."""
SLACK = 1e-13
"""Of inequalities; a tenth of the above."""


@dataclass(frozen=True)
class Arc:
    """A stretch of motion with constant acceleration.

    Attributes:
        t: its start [s]; it lasts until the next arc starts.
        q, v, a: (x, z, phi) at the start and derivatives, shapes (3,).
        la_N, la_F: contact forces during the arc, one per wall [N].
        La_N, La_F: percussions at its start, one per wall [N s].
    """

    t: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    la_N: np.ndarray
    la_F: np.ndarray
    La_N: np.ndarray
    La_F: np.ndarray


@dataclass
class WalledBall:
    """A planar ball and walls through the origin: g_N = n.(x, z) - R, gamma_F = t.(v_x, v_z) + R phi_dot.

    Attributes:
        normals: unit normals of the walls in the x-z plane, shape (n_walls, 2); t is n turned by -90 degrees.
        mu, e_N: friction and restitution of each wall [-], shapes (n_walls,).
        radius, mass, gravity: [m], [kg], [m/s^2].
    """

    normals: np.ndarray
    mu: np.ndarray
    e_N: np.ndarray
    radius: float = 0.1
    mass: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        n, zero = self.normals, np.zeros(len(self.normals))
        self.W_N = np.column_stack([n[:, 0], n[:, 1], zero])
        self.W_F = np.column_stack([n[:, 1], -n[:, 0], zero + self.radius])
        self.M = self.mass * np.array([1.0, 1.0, 0.4 * self.radius**2])

    def gaps(self, q: np.ndarray) -> np.ndarray:
        """g_N of every wall [m]."""
        return self.W_N @ q - self.radius

    def arcs(self, q: np.ndarray, v: np.ndarray, t_end: float) -> list[Arc]:
        """Go from event to event: impact, lift-off, slip to stick.

        Args:
            q: (x, z, phi) at t = 0, without contact.
            v: its derivative.
            t_end: no arc starts later than this [s].
        """
        t, n = 0.0, len(self.normals)
        touching = np.zeros(n, dtype=bool)
        arcs: list[Arc] = []
        while t <= t_end:
            v, La_N, La_F = self.impact(v, touching)
            leaving = touching & (self.W_N @ v > ROUND_OFF)
            closed = touching & ~leaving
            a, la_N, la_F = self.acceleration(v, closed)
            leaving |= closed & (self.W_N @ a > ROUND_OFF)
            closed &= ~leaving
            arcs.append(Arc(t, q, v, a, la_N, la_F, La_N, La_F))

            times = np.concatenate([self.closing_times(q, v, a, closed, leaving), self.stopping_times(v, a, closed)])
            tau = times.min()
            if not np.isfinite(tau):
                break
            t, q, v = t + tau, q + tau * v + tau**2 / 2 * a, v + tau * a
            touching = closed | (times[:n] <= tau)
            # a wall that is touched is touched to the last digit
            for k in np.flatnonzero(touching):
                q = q - self.W_N[k] * self.gaps(q)[k]
        return arcs

    def impact(self, v: np.ndarray, touching: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Newton's and Coulomb's impact laws (43), (47), e_F = 0: velocity after it and percussions."""
        speed = self.W_N @ v
        # at the end of infinitely many bounces
        e_N = np.where(speed > -100 * ROUND_OFF, 0.0, self.e_N)
        if not (touching & (speed < -ROUND_OFF)).any():
            return v, np.zeros(len(speed)), np.zeros(len(speed))
        return self.inclusion(v, touching, e_N * speed, np.zeros(len(speed)))

    def acceleration(self, v: np.ndarray, closed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Signorini's and Coulomb's laws at the acceleration level: acceleration and forces."""
        slip = self.W_F @ v
        sign = np.where(np.abs(slip) > ROUND_OFF, np.sign(slip), 0.0)
        free = np.array([0.0, -self.gravity, 0.0])
        return self.inclusion(free, closed, np.zeros(len(slip)), sign)

    def inclusion(
        self, free: np.ndarray, active: np.ndarray, b: np.ndarray, sign: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Find x = free + M^-1 W p with 0 <= W_N x + b, p_N >= 0 complementary, and friction, trying all cases.

        The cases of a contact are "open", "stick", and slip with sign +1 or -1; a sign that is given leaves no stick.
        The motion x is unique, or this raises; the forces need not be.
        """
        options = [
            ("open",) if not is_active else ("open", s) if s else ("open", "stick", 1.0, -1.0)
            for is_active, s in zip(active, sign, strict=True)
        ]
        W, n = np.vstack([self.W_N, self.W_F]), len(active)
        found = []
        for case in product(*options):
            rows, P = self.unknowns(case)
            G = W[rows] @ (P.T @ W / self.M).T
            c = -np.append(b, np.zeros(n))[rows] - W[rows] @ free
            p = np.linalg.lstsq(G, c, rcond=1e-12)[0] if rows else np.zeros(0)
            x = free + W.T @ P @ p / self.M
            moves = [self.motion_fits(x, int(k), case[k], b[k], sign[k]) for k in np.flatnonzero(active)]
            if np.abs(G @ p - c).max(initial=0.0) < 1e-10 and all(moves):
                forces = self.forces_in_cone(p, P, G, c)
                if forces is not None:
                    found.append((x, forces[:n], forces[n:]))
        if not found or max(np.abs(x - found[0][0]).max() for x, *_ in found) > 1e-9:
            raise RuntimeError(f"the contact laws have {len(found)} solutions")
        return found[0]

    def unknowns(self, case: tuple[str | float, ...]) -> tuple[list[int], np.ndarray]:
        """Rows of (W_N, W_F) whose motion is prescribed, and P with (p_N, p_F) = P p, as many columns as rows."""
        n = len(case)
        closed, sticking = [k for k in range(n) if case[k] != "open"], [k for k in range(n) if case[k] == "stick"]
        P = np.eye(2 * n)[:, closed + [n + k for k in sticking]]
        for column, k in enumerate(closed):
            if case[k] != "stick":
                P[n + k, column] = -float(case[k]) * self.mu[k]
        return closed + [n + k for k in sticking], P

    def motion_fits(self, x: np.ndarray, k: int, case: str | float, b: float, sign: float) -> bool:
        """Whether the motion x obeys the inequalities of the case."""
        if case == "open":
            return self.W_N[k] @ x + b >= -SLACK
        return case == "stick" or sign != 0 or case * (self.W_F[k] @ x) >= -SLACK

    def forces_in_cone(self, p: np.ndarray, P: np.ndarray, G: np.ndarray, c: np.ndarray) -> np.ndarray | None:
        """(p_N, p_F) in the friction cones with G p = c, starting from the shortest p, or None."""
        one, mu = np.eye(len(self.mu)), np.diag(self.mu)
        cone = np.block([[-one, 0 * one], [-mu, one], [-mu, -one]]) @ P
        if len(p) and (cone @ p).max() > SLACK:
            if np.linalg.matrix_rank(G, tol=1e-12) == len(p):
                return None
            # scaled, because the tolerance of linprog is absolute
            size = np.abs(c).max() or 1.0
            result = linprog(np.zeros(len(p)), cone, np.zeros(len(cone)), G, c / size, bounds=(None, None))
            if not result.success:
                return None
            p = size * result.x
        return P @ p

    def closing_times(
        self, q: np.ndarray, v: np.ndarray, a: np.ndarray, closed: np.ndarray, leaving: np.ndarray
    ) -> np.ndarray:
        """Time until every gap that is open closes [s]."""
        g = np.where(leaving, 0.0, self.gaps(q))
        g_dot, g_ddot = self.W_N @ v, self.W_N @ a
        times = np.full(len(g), np.inf)
        for k in np.flatnonzero(~closed):
            root = g_dot[k] ** 2 - 2 * g[k] * g_ddot[k]
            if leaving[k]:
                times[k] = -2 * g_dot[k] / g_ddot[k] if g_ddot[k] < 0 else np.inf
            elif root >= 0 and np.sqrt(root) > g_dot[k]:
                times[k] = 2 * g[k] / (np.sqrt(root) - g_dot[k])
        return times

    def stopping_times(self, v: np.ndarray, a: np.ndarray, closed: np.ndarray) -> np.ndarray:
        """Time until every slip ends [s]."""
        slip, rate = self.W_F @ v, self.W_F @ a
        ends = closed & (np.abs(slip) > ROUND_OFF) & (slip * rate < 0)
        return np.where(ends, -slip / np.where(ends, rate, 1.0), np.inf)


def sample(arcs: list[Arc], t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (x, z, cos phi, sin phi) and velocities at the times t."""
    i = np.searchsorted([arc.t for arc in arcs], t, side="right") - 1
    q, v, a = (np.array([getattr(arc, name) for arc in arcs])[i] for name in "qva")
    tau = (np.asarray(t) - np.array([arc.t for arc in arcs])[i])[:, None]
    x, z, phi = (q + tau * v + tau**2 / 2 * a).T
    return np.column_stack([x, z, np.cos(phi), np.sin(phi)]), v + tau * a
