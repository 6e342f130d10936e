"""Lowest energy by Newton's method in a trust region, on the motions that contacts and constraints leave.

The energy is never computed: its change along a displacement is the work against the forces, which has no large
numbers to subtract and is there for every force. Forces without a potential have a work as well; there Newton's
direction is taken wherever that work falls along it.

J. Nocedal, S. J. Wright: Numerical Optimization, 2nd edition, Springer 2006, chapter 4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from ngalpha_pin.common.tolerances import ROUNDING, TINY
from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.balance import Balance, Forces, Metric

MAX_ITER = 1000  # steps of the trust region, which is as large as the scene at most
RCOND = 1e-13  # part of the largest singular value of a stiffness that is none
FIRST, LARGEST, SMALLEST = 0.1, 1.0, 1e-13  # radius of the trust region, in parts of the size of the scene
FAR = 1e3  # sizes of the scene from q0 at which something falls
ACCEPTED, POOR, GOOD = 1e-4, 0.25, 0.75  # change of the energy in parts of what its second variation promises
ASYMMETRIC = 1e-9  # part of the stiffness from which it is not that of an energy
RADIUS = 1e-6  # accuracy to which a step is as long as the trust region
FLUTTER = 1e-4  # part of an eigenvalue that its imaginary part has where the motion grows; differences leave less


@dataclass(frozen=True)
class Rest:
    """Where forces are in balance.

    Attributes:
        q: configuration, shape (nq,).
        la: forces of contacts and constraints, shape (rows,).
        stable: no motion that contacts and constraints leave lowers the energy to second order, or grows.
        n_iter: displacements tried.
    """

    q: np.ndarray
    la: np.ndarray
    stable: bool
    n_iter: int


@dataclass(frozen=True)
class _Point:
    """A configuration that fulfils the constraints, and its forces; `r` is out of balance."""

    q: np.ndarray
    at: Forces
    metric: Metric
    la: np.ndarray
    r: np.ndarray
    balanced: bool
    unrest: float  # of r, in the metric


def rest(balance: Balance, q0: np.ndarray) -> Rest:
    """The rest to which the energy leads down from q0; q0 itself where it is in balance, stable or not.

    Raises:
        SceneError: there is none.
    """
    system = balance.system
    q = balance.returned(q0)
    if q is None:
        raise SceneError("no static equilibrium near q0: the constraints cannot be closed there; see assemble")
    size = np.sqrt(_mass(balance)) * system.contacts.length
    radius, point, tried, curved = FIRST * size, _point(balance, q), 0, None
    while True:
        if curved is None:
            curved = reduced_stiffness(balance, point.q, point.at, point.la, point.metric.basis)
            stable = is_stable(curved)
        if point.balanced and (stable or tried == 0 or not is_symmetric(curved)):
            return Rest(point.q, point.la, stable, tried)
        far = np.abs(system.difference(q0, point.q)).max(initial=0.0) > FAR * max(system.contacts.length, 1.0)
        if tried == MAX_ITER or radius < SMALLEST * size or far:
            raise SceneError(_why_not(point, curved, far))
        y = displacement(curved, point.metric.basis.T @ point.r, radius)
        new, ratio = _tried(balance, point, curved, y)
        tried += 1
        tried += 1
        length = float(np.linalg.norm(y))
        if ratio < POOR:
            radius = 0.25 * length
        elif ratio > GOOD and length > 0.9 * radius:
            radius = min(2.0 * radius, LARGEST * size)
        if new is not None and (ratio > ACCEPTED or (stable and new.unrest < 0.5 * point.unrest)):
            point, curved = new, None


def displacement(S: np.ndarray, gradient: np.ndarray, radius: float) -> np.ndarray:
    """Smallest value of gradient^T y + y^T S y / 2 within the radius, shape (n,).

    Where S is not symmetric, the displacement of Newton's method as long as it is inside and goes down.
    """
    if not is_symmetric(S):
        y = -np.linalg.lstsq(S, gradient, rcond=RCOND)[0]
        if np.linalg.norm(y) <= radius and gradient @ y < 0.0:
            return np.asarray(y)
    values, vectors = np.linalg.eigh((S + S.T) / 2)
    along, noise = vectors.T @ gradient, ROUNDING * np.abs(values).max(initial=0.0)
    bottom = max(0.0, -float(values[0]) + noise)

    def length(shift: float) -> float:
        return float(np.linalg.norm(along / (values + shift)))

    lowest = max(bottom, noise, ROUNDING * float(np.linalg.norm(along)) / radius, TINY)
    if length(lowest) <= radius:
        shift = 0.0 if values[0] > noise else lowest
    else:
        top = lowest + float(np.linalg.norm(along)) / radius
        shift = brentq(lambda x: 1.0 / length(x) - 1.0 / radius, lowest, top, xtol=TINY, rtol=RADIUS)
    y = -along / (values + shift)
    if values[0] < -noise and np.linalg.norm(y) < radius:  # at the top of a ridge both ways lead down
        y[0] += np.copysign(np.sqrt(radius**2 - y @ y), y[0])
    return np.asarray(vectors @ y)


def reduced_stiffness(balance: Balance, q: np.ndarray, at: Forces, la: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """The second variation on the motions of a basis, shape (n, n)."""
    return np.asarray(basis.T @ balance.second_variation(q, at, la) @ basis)


def is_symmetric(S: np.ndarray) -> bool:
    """All forces have a potential: there are no follower loads and no gains from one joint to the other alone."""
    return bool(np.abs(S - S.T).max(initial=0.0) <= ASYMMETRIC * np.abs(S).max(initial=0.0))


def growth(values: np.ndarray) -> np.ndarray:
    """Rates at which motions with these eigenvalues of M^-1 K grow, shape (n,) [1/s]; zero where they do not.

    A small negative eigenvalue, or imaginary part, is that of rounding.
    """
    values = np.asarray(values, dtype=complex)
    noise = len(values) * ROUNDING * np.abs(values).max(initial=0.0)
    flutters = np.abs(values.imag) > FLUTTER * np.abs(values) + noise
    values = np.where(flutters, values, values.real)
    return np.where(flutters | (values.real < -noise), np.abs(np.sqrt(-values).real), 0.0)


def is_stable(S: np.ndarray) -> bool:
    """Small motions do not grow."""
    values = np.linalg.eigvalsh((S + S.T) / 2) if is_symmetric(S) else np.linalg.eigvals(S)
    return not growth(values).any()


def _point(balance: Balance, q: np.ndarray) -> _Point:
    at = balance.forces(q)
    metric = balance.metric(q, at.W)
    la = metric.forces(at.R)
    r = at.R - la @ at.W
    balanced = balance.closed(at.g) and bool((np.abs(r) <= balance.tolerance(at, la)).all())
    return _Point(q, at, metric, la, r, balanced, float(np.linalg.norm(metric.basis.T @ r)))


def _tried(balance: Balance, point: _Point, S: np.ndarray, y: np.ndarray) -> tuple[_Point | None, float]:
    """The configuration after a displacement, and how much of the promised change of the energy it has."""
    basis = point.metric.basis
    q = balance.returned(balance.system.integrate(point.q, basis @ y))
    if q is None:
        return None, -np.inf
    promised = min(float((basis.T @ point.r + 0.5 * S @ y) @ y), -TINY)
    ratio = balance.work(point.q, balance.system.difference(point.q, q)) / promised
    return (_point(balance, q), ratio) if np.isfinite(ratio) else (None, -np.inf)


def _mass(balance: Balance) -> float:
    system = balance.system
    return sum(inertia.mass for inertia in system.tree.inertias) + (system.beams.mass if system.beams else 0.0)


def _why_not(point: _Point, S: np.ndarray, far: bool) -> str:
    if far:
        return "no static equilibrium near q0: the energy falls without end; something falls that nothing holds"
    why = (
        ""
        if is_symmetric(S)
        else "; there are forces without a potential (follower loads), which may drive it for ever"
    )
    return (
        f"no static equilibrium near q0: {np.abs(point.r).max():.2g} N or N m are out of balance after {MAX_ITER} "
        f"displacements{why}; something can fall, or q0 is far from the equilibrium"
    )
