"""The normal forces of compliant contacts, in place of Signorini's law: la_N = F(g_N, g_N_dot).

Such a contact is closed while its gap is negative. It has no percussion and no force on position level; friction is
bounded by la_N as that of rigid contacts, so that sticking is exact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from ngalpha_pin.contact.table import ContactTable, Subset


class _Laws(Protocol):
    """A residual of contact laws, see `laws.ContactResidual`."""

    sub: Subset
    y: np.ndarray
    z: np.ndarray
    R: np.ndarray
    kinematic: np.ndarray


def elastic_forces(sub: Subset, g_N: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forces of the compliant contacts of a subset and their derivatives by g_N and by its rate, zero where open.

    Args:
        sub: contacts.
        g_N: gaps of all, shape (k,) [m].
        rate: their rates, shape (k,) [m/s].

    Returns:
        Three arrays with one entry for each of `sub.soft`.
    """
    found = np.zeros((3, len(sub.soft)))
    for i, (place, law) in enumerate(zip(sub.soft, sub.compliances, strict=True)):
        if g_N[place] <= 0.0:
            F, by_depth, by_rate = law(-g_N[place : place + 1], -rate[place : place + 1])
            found[:, i] = F[0], -by_depth[0], -by_rate[0]
    return found[0], found[1], found[2]


def soft_sets(sub: Subset, g_N: np.ndarray, P_N: np.ndarray, found: np.ndarray) -> None:
    """Which compliant contacts count as closed in a step: those that touch at its end, or have pressed in it."""
    found[sub.soft] = (g_N <= 0.0)[sub.soft] | (P_N > 0.0)[sub.soft]


class SoftRows:
    """Normal rows of compliant contacts in the residual of a step.

    Args:
        laws: residual, whose normal rows of these contacts are replaced.
        kappa, La_N: multipliers of position and velocity level, shape (k,) each.
    """

    def __init__(self, laws: _Laws, kappa: np.ndarray, La_N: np.ndarray):
        sub, k, m = laws.sub, laws.sub.k, laws.sub.m
        self.at = at = sub.soft
        self.la = la = 2 * k + m + at
        F, self._by_g, self._by_rate = elastic_forces(sub, laws.y[:k], laws.y[k : 2 * k])
        self._k = k
        laws.R[at], laws.R[k + at], laws.R[la] = kappa[at], La_N[at], laws.z[la] - F
        laws.kinematic = laws.kinematic.copy()
        laws.kinematic[np.concatenate((at, k + at, la))] = False

    def derive(self, J: np.ndarray, H: np.ndarray) -> np.ndarray:
        """The derivative of R by the multipliers with these rows, see `laws.ContactResidual.jacobian`."""
        J = J.copy()
        for rows in (self.at, self._k + self.at, self.la):
            J[rows] = 0.0
            J[rows, rows] = 1.0
        J[self.la] -= self._by_g[:, None] * H[self.at] + self._by_rate[:, None] * H[self._k + self.at]
        return J


def stored(table: ContactTable, columns: np.ndarray, g_N: np.ndarray) -> np.ndarray:
    """Elastic energy of compliant contacts along a run, shape (n,) [J].

    Args:
        table: contacts of the scene.
        columns: numbers of those with a column.
        g_N: their gaps, shape (n, k) [m].
    """
    found = np.zeros(len(g_N))
    for column, i in enumerate(columns.tolist()):
        law = table.compliances[i]
        if law is not None:
            found += law.energy(np.maximum(-g_N[:, column], 0.0))
    return found
