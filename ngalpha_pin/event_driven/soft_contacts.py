"""The compliant contacts of a smooth phase: their forces, and the signs that end it.

Such a contact presses with its law as long as this pushes, and idles while its damping would pull; either ends where
the sign of the law changes, and both where the gap opens.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.common.tolerances import CLOSED
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

NONE = 1e-9  # of the sign of a law, in parts of what it is made of
SHORT = 1e-9  # time in which the sign of a law changes, in parts of the time that the rate of the gap takes to fall


def pressing(system: System, state: State) -> np.ndarray:
    """Numbers of the compliant contacts that press from a state on: they are closed, or about to be."""
    table = system.contacts
    index = state.contacts[table.soft[state.contacts]]
    if not len(index):
        return index
    rows = system.contact_rows_at(table.subset(index), state.q, state.v, state.t)
    touches = np.abs(rows.g_N) <= CLOSED * table.yardstick[index]
    return index[np.where(touches, rows.rate[: len(index)] < 0.0, rows.g_N < 0.0)]


class SoftContacts:
    """Those of one phase.

    Args:
        sub: the contacts of the phase.
        system: compiled scene.
        state: start of the phase.

    Attributes:
        at: their places in the subset, shape (s,).
        idle: which contacts of the subset idle, shape (k,).
    """

    def __init__(self, sub: Subset, system: System, state: State):
        self._sub, self.at, self.idle = sub, sub.soft, np.zeros(sub.k, dtype=bool)
        self._side = np.ones(len(self.at))
        if not len(self.at):
            return
        system.dynamics(state.t, state.q, state.v, state.a)
        rows = system.contact_rows(sub, state.q, state.v, state.a, state.t)
        rate, fall = -rows.rate[: sub.k], -rows.acceleration[: sub.k]
        for i, (place, law) in enumerate(zip(self.at.tolist(), sub.compliances, strict=True)):
            depth = max(-float(rows.g_N[place]), 0.0)
            h = SHORT * abs(rate[place] / fall[place]) if fall[place] != 0.0 else SHORT
            now = law.smooth(depth, rate[place])[1]
            soon = law.smooth(depth + h * rate[place], rate[place] + h * fall[place])[1]
            size = law.smooth(depth, abs(rate[place]))[1]
            self._side[i] = np.sign(now if abs(now) > NONE * size else soon - now) or 1.0
        self.idle[self.at] = self._side < 0.0

    def forces(self, g_N: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Normal forces, shape (s,) [N], and what is positive as long as the phase lasts, shape (2 s,)."""
        found = np.zeros((3, len(self.at)))
        for i, (place, law) in enumerate(zip(self.at.tolist(), self._sub.compliances, strict=True)):
            depth = -float(g_N[place])
            force, sign = law.smooth(depth, -float(rate[place]))
            found[:, i] = 0.0 if self._side[i] < 0.0 else force, self._side[i] * sign, depth
        return found[0], found[1:].ravel()
