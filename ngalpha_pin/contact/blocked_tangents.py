"""Friction along tangents in which bodies cannot move while the contact stays closed.

A link that touches the one before it can often move along some tangent only together with the normal. A contact that
stays closed then sticks in that direction, and no motion tells friction there from normal force. What the shapes leave
of a motion (axes that are parallel up to 1e-8 rad) would ask for percussions of any size, or for slip at the level of
rounding whose direction Coulomb's law would follow. For the step such a direction is taken as still: its force resists
with the inverse mass g of the contact, y = g z, so that it vanishes, and the normal force does the work of both.

That is exact where the direction cannot move. Where it moves by less than the bound below, the contact slips with less
than 3e-6 of the velocities of its bodies and Coulomb's law would turn all of the friction against that.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.contact.point_rows import KinematicRows, Motion
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.numerics.gauss_seidel import FreeProblem

IMMOBILE = 1e-11  # inverse mass with the normal held, relative to the contact's, below which a direction is still


class Immovable:
    """The directions of a step that are still.

    Args:
        projector: on what they leave of the tangents, shape (m, m).
        compliance: g t t^T of all of them, shape (m, m) [1/kg].
    """

    def __init__(self, projector: np.ndarray, compliance: np.ndarray):
        self.projector, self.compliance = projector, compliance

    def resists(self, G: np.ndarray, k: int) -> np.ndarray:
        """A Delassus matrix whose friction rows begin at k, with the compliance."""
        resisting, end = G.copy(), k + len(self.compliance)
        resisting[k:end, k:end] += self.compliance
        return resisting


def immovable(W: np.ndarray, by_M: np.ndarray, n_c: int, sub: Subset) -> Immovable | None:
    """The directions in which contacts that do not rebound cannot move with their normals and the constraints held.

    The bound is on the Schur complement of the normal row in the block of a cone with it.

    Args:
        W: rows of the contacts and of what else there is, constraints last, shape (rows, nv).
        by_M: M^-1 W, shape (nv, rows).
        n_c: rows before the constraints.
        sub: the contacts.
    """
    G = W @ by_M
    G = FreeProblem(G, np.zeros(len(G)), n_c).G
    k, cones, projector, compliance = sub.k, sub.cones, np.eye(sub.m), np.zeros((sub.m, sub.m))
    # a surface that moves slips also where the bodies cannot
    driven = np.zeros(k, dtype=bool)
    if sub.surfaces is not None:
        driven[: len(sub.surfaces.moves)] = sub.surfaces.moves
    count = cones.rows
    begin = np.zeros(cones.c, dtype=int)
    begin[cones.of_row] = k + cones.first
    diagonal = G.diagonal()
    for n in np.unique(count[count > 0]):  # all cones with so many tangents
        i = np.flatnonzero((count == n) & ((sub.e[:k] <= 0.0) & ~driven)[cones.contact])
        rows, i = begin[i][:, None] + np.arange(n), cones.contact[i]
        g, g_N = np.maximum(diagonal[i], diagonal[rows].max(axis=1, initial=0.0)), diagonal[i]
        i, rows, g, g_N = (x[g_N > IMMOBILE * g] for x in (i, rows, g, g_N))
        by_normal = G[rows, i[:, None]]
        held = G[rows[:, :, None], rows[:, None, :]]
        held = held - by_normal[:, :, None] * by_normal[:, None, :] / g_N[:, None, None]
        eigenvalues, directions = np.linalg.eigh(held)
        for j in np.flatnonzero(eigenvalues[:, 0] < IMMOBILE * g):  # hardly any
            t = directions[j][:, eigenvalues[j] < IMMOBILE * g[j]]
            at = np.ix_(rows[j] - k, rows[j] - k)
            projector[at] -= t @ t.T
            compliance[at] = g[j] * (t @ t.T)
    return Immovable(projector, compliance) if compliance.any() else None


class ProjectedRows:
    """Rows of contacts whose tangents have lost the directions that are still; see `KinematicRows`."""

    def __init__(self, rows: KinematicRows, k: int, projector: np.ndarray):
        self._rows, self._k, self._projector = rows, k, projector
        self.W, self.rate, self.acceleration = (self._projected(x) for x in (rows.W, rows.rate, rows.acceleration))

    @property
    def sizes(self) -> tuple[float, float]:
        """Largest position and velocity that the rows subtract."""
        return self._rows.sizes

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each shape (k + m, nv)."""
        X, Y = self._rows.derivatives(motion)
        return self._projected(X), self._projected(Y)

    def _projected(self, x: np.ndarray) -> np.ndarray:
        return np.concatenate((x[: self._k], self._projector @ x[self._k :]))
