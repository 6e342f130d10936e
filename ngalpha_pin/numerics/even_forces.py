"""Forces that are not unique: of all that the laws allow, those that are spread evenly over the contacts.

Sweeps end at the edge of friction cones, and with a load on a few corners, although forces inside of the cones do as
well. From such forces the next step can go nowhere: a little more load, and a contact leaves its cone that had no
reason to slip.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from ngalpha_pin.common.tolerances import CONE, NO_FORCE, STILL
from ngalpha_pin.numerics.nearest_forces import DEPENDENT, nearest_forces, spanned_forces
from ngalpha_pin.numerics.proximal_newton import Rows

# accelerations that are the same, in parts of the largest one; forces of so many rows stay as they are
AGREE, MANY_ROWS = 1e-9, 256


def even_forces(
    G: np.ndarray, b: np.ndarray, rows: Rows, la: np.ndarray, closed: np.ndarray, slip: np.ndarray
) -> np.ndarray:
    """Forces with the same contacts sticking and slipping, without any that cancel, where the laws allow that.

    Friction is shared in proportion to what the cones have. Where the laws do not allow even normal forces, those stay
    as they are.

    Args:
        G: Delassus matrix of contacts and joint friction, shape (n, n).
        b: accelerations without these forces, shape (n,); or velocities, one level down.
        rows: their laws.
        la: forces that fulfil the laws, shape (n,).
        closed: contacts that may have a force, shape (k,).
        slip: slip velocities that are given, zero where a cone sticks, shape (m,) [m/s].
    """
    k, j, of = len(closed), len(closed) + len(rows.of_F), rows.contact
    y, la_N = b + G @ la, la[:k]
    loaded = la_N > NO_FORCE * la_N.max(initial=0.0)
    if loaded.sum() < 2:
        return la
    still = STILL * float(np.abs(b).max(initial=0.0))
    at_edge = _sizes(rows, la[k:j]) >= rows.mu * la_N[of] * (1 - CONE)
    sticks = ~(at_edge & (_sizes(rows, y[k:j]) > still)) & (_sizes(rows, slip) == 0.0)
    touches = loaded | closed & (np.abs(y[:k]) <= still) & (np.bincount(of, ~sticks, k) == 0)
    # what rests on a face does not roll, and needs no resistance to that
    resists = sticks & (np.arange(len(of)) >= k)
    idles = (np.zeros_like(resists), resists) if resists.any() else (resists,)
    for (carries, kept), idle in product(((touches, 0.0), (loaded, 0.0), (loaded, 1.0)), idles):
        found = _spread(G, b, rows, la, carries, sticks & ~idle & carries[of], idle, kept)
        if found is not None:
            return found
    return la


def _spread(
    G: np.ndarray,
    b: np.ndarray,
    rows: Rows,
    la: np.ndarray,
    carries: np.ndarray,
    held: np.ndarray,
    idle: np.ndarray,
    kept: float,
) -> np.ndarray | None:
    """Forces of contacts that carry and cones that stick, as near as can be to a part that is kept of the normal ones.

    Cones that are idle stick without a force.

    Returns:
        None where the laws do not allow them; the forces themselves where they are unique.
    """
    k, j, (lower, upper), mu, of_F = len(carries), len(carries) + len(rows.of_F), rows.bounds, rows.mu, rows.of_F
    o, n, sticks = rows.contact[of_F], int(carries.sum()), np.flatnonzero(held[of_F])
    inside = (la[j:] > lower) & (la[j:] < upper)
    free = np.concatenate((np.flatnonzero(carries), k + sticks, j + np.flatnonzero(inside)))
    among = G[np.ix_(free, free)]
    if len(free) > MANY_ROWS or not idle.any() and spanned_forces(among).shape[1] == len(free):
        return la
    tied = np.where(
        (carries[rows.contact] & ~held & ~idle)[of_F], la[k:j] / np.where(la[:k] > 0.0, la[:k], 1.0)[o], 0.0
    )
    along = np.zeros((len(la), k))
    np.add.at(along.T, o, (G[:, k:j] * tied).T)
    adds = np.zeros((len(free), len(free)))
    adds[:, :n] = along[np.ix_(free, np.flatnonzero(carries))]
    found = np.concatenate((np.zeros(j), np.where(inside, 0.0, la[j:])))
    start = np.where(free < k, kept * la[free], 0.0)
    found[free] = nearest_forces(among, adds, -(b + G @ found)[free], start)
    root = np.sqrt(np.maximum(mu[of_F] * found[o], 0.0))[sticks]
    G_F = G[np.ix_(k + sticks, k + sticks)]
    found[k + sticks] = root * np.linalg.lstsq(G_F * root, G_F @ found[k + sticks], rcond=DEPENDENT)[0]
    found[k:j] += tied * found[o]
    allowed = (found[:k] >= 0.0).all() and ((found[j:] >= lower) & (found[j:] <= upper)).all()
    allowed &= (_sizes(rows, found[k:j]) <= mu * found[:k][rows.contact])[held].all()
    left = np.abs((b + G @ found)[np.append(free, k + np.flatnonzero(idle[of_F]))]).max()
    return found if allowed and left <= AGREE * np.abs(b).max() else None


def _sizes(rows: Rows, x: np.ndarray) -> np.ndarray:
    """Norms over the friction rows of each cone, shape (m,) -> (c,)."""
    return np.sqrt(np.bincount(rows.of_F, x * x, len(rows.mu)))
