"""Surfaces that move along themselves, in the slip of (42)-(48) and its rate.

Such a surface is a body of its own for friction: on its contact the twist S of its material is added to that of the
body that carries it. With the wrench F of a friction row, the twists V_A and V_B of the bodies and what the surfaces
add, X = S_B - S_A, a displacement of B relative to A changing F by D (see `feature_rows`),

    gamma_F = F.(V + X)        V = V_B - V_A
    gamma_F_dot = ... + E.V + F.(s_B - s_A)        E = D^T X + S_B x* F

where s is the rate of S as seen from the body that carries it. E is also what X adds to the derivatives of gamma_F by q
and of gamma_F_dot by v.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.numerics.spatial import cross, dot, force_cross
from ngalpha_pin.scene.surface_velocity import MovingSurface


class Slip(NamedTuple):
    """What moving surfaces add to the friction rows.

    Attributes:
        rate: to gamma_F, shape (m,) [m/s].
        acceleration: to gamma_F_dot, shape (m,) [m/s^2].
        gradient: E, shape (m, 6).
    """

    rate: np.ndarray
    acceleration: np.ndarray
    gradient: np.ndarray


class MovingSurfaces:
    """The moving surfaces of some contacts.

    Args:
        surfaces: of every contact, None where it stays.

    Attributes:
        any: there is one.
        moves: which contacts have one, shape (k,).
    """

    def __init__(self, surfaces: list[MovingSurface | None]):
        self._surfaces = surfaces
        self.moves = np.array([s is not None for s in surfaces], dtype=bool)
        self.any = bool(self.moves.any())
        if not self.any:
            return
        self._on_b = np.array([s is not None and s.on_b for s in surfaces])
        self._twist = np.array([np.zeros(6) if s is None else s.twist for s in surfaces])
        laws = {id(s.own): s.speed for s in surfaces if s is not None}
        number = {own: i for i, own in enumerate(laws)}
        self._laws = list(laws.values())
        self._law = np.array([-1 if s is None else number[id(s.own)] for s in surfaces])

    def of(self, index: np.ndarray) -> MovingSurfaces | None:
        """Those of some contacts; None where none of them moves."""
        if not self.any or not self.moves[index].any():
            return None
        return MovingSurfaces([self._surfaces[i] for i in index.tolist()])

    def placed(self, R: np.ndarray, p: np.ndarray, body_a: np.ndarray, body_b: np.ndarray) -> np.ndarray:
        """Twists for a speed of one at the origin of the world, shape (k, 6); poses are those of the bodies."""
        of = np.where(self._on_b, body_b, body_a)
        linear = np.einsum("kij,kj->ki", R[of], self._twist[:, :3])
        angular = np.einsum("kij,kj->ki", R[of], self._twist[:, 3:])
        return np.concatenate((linear + cross(p[of], angular), angular), axis=1)

    def speeds(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Factors and their rates at times, shape (k,) each; zero where a contact has no moving surface."""
        found = np.zeros((2, len(t)))
        known: dict[tuple[int, float], tuple[float, float]] = {}
        if np.isnan(t).any():
            raise ValueError("a surface that moves is asked for its velocity without a time")
        for i in np.flatnonzero(self._law >= 0).tolist():
            key = int(self._law[i]), float(t[i])
            if key not in known:
                known[key] = self._laws[key[0]](key[1])
            found[:, i] = known[key]
        return found[0], found[1]

    def velocities(self, k: np.ndarray, A: pin.SE3, B: pin.SE3, point: np.ndarray) -> np.ndarray:
        """Velocities, for a speed of one, at points of the world, shape (len(k), 3) [m/s].

        Args:
            k: places of contacts between two bodies.
            A: pose of the first body.
            B: pose of the second body.
            point: of every contact, shape (len(k), 3) [m].
        """
        R, p = np.array((A.rotation, B.rotation)), np.array((A.translation, B.translation))
        first = np.zeros(len(self.moves), dtype=int)
        S = self.placed(R, p, first, first + 1)[k]
        return S[:, :3] + cross(S[:, 3:], point)

    def slip(
        self, t: np.ndarray, placed: np.ndarray, F: np.ndarray, of: np.ndarray, V: np.ndarray,
        turned: Callable[[np.ndarray], np.ndarray],
    ) -> Slip:  # fmt: skip
        """What the surfaces add.

        Args:
            t: time of every contact, shape (k,) [s].
            placed: see there.
            F: wrenches of the friction rows, shape (m, 6).
            of: contact of each of them, shape (m,).
            V: twists of B relative to A, shape (k, 6).
            turned: D^T X of the friction rows, from X of the contacts.
        """
        s, s_dot = self.speeds(t)
        sign = np.where(self._on_b, 1.0, -1.0)[:, None]
        X = (sign * s[:, None]) * placed
        on_B = np.where(self._on_b[:, None], X, 0.0)
        E = turned(X) + force_cross(on_B[of], F)
        changes = (sign * s_dot[:, None]) * placed
        return Slip(dot(F, X[of]), dot(E, V[of]) + dot(F, changes[of]), E)


def surface_rates(driven: Slip | None, k: int, m: int) -> np.ndarray:
    """What moving surfaces add to the rates of k normal and m friction rows, shape (k + m,)."""
    return np.zeros(k + m) if driven is None else np.concatenate((np.zeros(k), driven.rate))


def surface_accelerations(driven: Slip | None, k: int, m: int) -> np.ndarray:
    """The derivatives of `surface_rates` by time, shape (k + m,)."""
    return np.zeros(k + m) if driven is None else np.concatenate((np.zeros(k), driven.acceleration))
