"""Rows of contacts at one motion from the compiled kernel, for those who need no derivatives of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.contact.table import Subset
from ngalpha_pin.engine.kernel import binding as kernel


class KernelRows:
    """Kinematic rows of points on surfaces that rest, and of limits; attributes as those of `Rows`.

    Args:
        plan: of the subset, where Pinocchio has been called with the motion.
        sub: the contacts.
        v, a: velocity and acceleration, shape (nv,).
    """

    def __init__(self, plan: kernel.Plan, sub: Subset, v: np.ndarray, a: np.ndarray):
        block = plan.rows.new()
        given = [np.ascontiguousarray(x, dtype=float) for x in (v, a)]
        kernel.library.nga_find_rows(plan.address, *(x.ctypes.data for x in given), block)
        self._arrays, self._slices = np.frombuffer(block), plan.rows.slices
        self._sub, j = sub, sub.k + sub.m
        self.g_N, self.rate, self.acceleration = self._of("g_N"), self._of("rate")[:j], self._of("acceleration")[:j]
        self.W = self._of("W").reshape(plan.nv, -1).T[:j]

    def _of(self, name: str) -> np.ndarray:
        return self._arrays[self._slices[name]]

    @property
    def sizes(self) -> tuple[float, float]:
        """Largest position and velocity that the rows subtract."""
        sizes = float(np.abs(self._of("c")).max()), float(np.abs(self._of("c_dot")).max())
        if self._sub.points is self._sub:
            return sizes
        return max(sizes[0], float(np.abs(self._sub.limit_value).max(initial=0.0))), max(
            sizes[1], float(np.abs(self.rate).max())
        )


def rows_at(system: Any, sub: Subset, q: np.ndarray, v: np.ndarray, a: np.ndarray, t: float = np.nan) -> Any:
    """Rows of a subset after `System.dynamics` at the same t, q, v and a, natively where the kernel knows them.

    Returns:
        Something with g_N, W, rate, acceleration and sizes, see `KinematicRows`.
    """
    if not _knows(system, sub, kernel.COMPILED):
        return system.contact_rows(sub, q, v, a, t)
    plan = kernel.plan_of(system, sub)
    plan.live.q[:] = q
    return KernelRows(plan, sub, v, a)


def gaps_and_rates(
    system: Any, sub: Subset, q: np.ndarray, v: np.ndarray, t: float = np.nan
) -> tuple[np.ndarray, np.ndarray]:
    """Gaps of a subset and their rates at a motion, shape (k,) each [m or rad, by s]; bodies are put there."""
    if sub.k > kernel.PLACED and _knows(system, sub, sub.k):
        pieces = np.array_split(sub.index, -(-sub.k // kernel.PLACED))
        found = [gaps_and_rates(system, system.contacts.subset(piece), q, v, t) for piece in pieces]
        return np.concatenate([gap for gap, _ in found]), np.concatenate([rate for _, rate in found])
    if not _knows(system, sub, kernel.PLACED):
        rows = system.contact_rows_at(sub, q, v, t)
        return rows.g_N, rows.rate[: sub.k]
    pin.computeJointJacobiansTimeVariation(system.model, system.data, q, v)
    plan = kernel.plan_of(system, sub)
    plan.live.q[:] = q
    speed, twists = np.ascontiguousarray(v, dtype=float), np.empty(6 * len(sub.points.bodies))
    gap, rate = np.empty(sub.k), np.empty(sub.k)
    kernel.library.nga_find_rates(plan.address, *(x.ctypes.data for x in (speed, twists, gap, rate)))
    return gap, rate


def _knows(system: Any, sub: Subset, most: int) -> bool:
    """The kernel has the rows: of points on surfaces that rest, and of limits."""
    other = len(sub.own) or len(sub.soft) or sub.cones.rolls or system.beams is not None
    moves = sub.surfaces is not None or sub.axes is not None
    return kernel.library is not None and not (other or moves or len(sub.slots)) and 0 < sub.k <= most
