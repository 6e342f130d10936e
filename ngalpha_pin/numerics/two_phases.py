"""An impact as a process: compression, then expansion, with Coulomb friction followed from part to part.

Velocities change while percussions grow (Darboux, Keller, Routh). In compression every contact that approaches is
pressed in proportion to its approach, until none approaches any more. In expansion a contact gives back percussions in
proportion to those of compression times its coefficient: as many with Poisson's law, as much work with Stronge's.
Others that touch do not penetrate meanwhile. What contacts do in all is never positive: expansion ends there.

A part of the process is one contact problem with given normal percussions. It is shortened until no slip turns far in
it, so that a slip that ends in it, or turns back, does so where two parts meet: along a line that is exact.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.numerics.gauss_seidel import solve_contact_problem

# change of the direction of a slip in one part of the process, as a cosine
TURN = float(np.cos(0.2))
# an approach and a slip that are none, in parts of the largest velocity, and a part of the process that is none
NONE, REST, SHORT = 1e-10, 1e-9, 1e-9
MAX_PARTS = 1000  # of one impact: each has its own slip directions and contacts
# change of a coefficient in one part, in parts of it
CHANGE = 0.02
WHOLE = 1.0 - 1e-15  # largest part of an interval: the rest of the process is behind it
# tolerances of what a part of the process asks for, the second where directions are dependent, and sweeps for it
SOLVED, ROUGHLY, MAX_SWEEPS = 1e-14, 1e-9, 200


class Contacts(NamedTuple):
    """What the process knows of the contacts that touch.

    Attributes:
        G: Delassus matrix, normal rows first, then friction, shape (n, n) [1/kg].
        coefficients: friction coefficients (c,) of the slip (m,).
        of_F: cone of each friction row, shape (m,).
        e: restitution coefficients, shape (k,).
        works: e is the ratio of work, Stronge's law, and not that of percussions, shape (k,).
        of_cone: contact of each cone, shape (c,), first the k of slip, then those of rolling; None without the latter.
    """

    G: np.ndarray
    coefficients: Callable[[np.ndarray], np.ndarray]
    of_F: np.ndarray
    e: np.ndarray
    works: np.ndarray
    of_cone: np.ndarray | None = None


def percussions(contacts: Contacts, before: np.ndarray) -> np.ndarray | None:
    """Percussions of an impact, shape (n,) [N s]; None where the process does not come to an end.

    Args:
        contacts: those that touch.
        before: g_N_dot and gamma_F before, shape (n,) [m/s].
    """
    process = _Process(contacts, before)
    # percussions of dependent directions that run away are recognised by their residual
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        if not process.compress():
            return None
        compressed = process.P.copy()
        if not process.expand():
            return None
    first, last = (P @ (before + 0.5 * contacts.G @ P) for P in (compressed, process.P))
    if last > 0.0 > first:  # what slips that have come to rest leave, among dependent rows; energy is convex in P
        process.P = compressed + first / (first - last) * (process.P - compressed)
    process.P[: process.k] = np.maximum(process.P[: process.k], 0.0)  # rounding
    return process.P


def coupled(G: np.ndarray, of_row: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Contacts whose velocities percussions of some of them change, directly, through others or constraints, (k,).

    Args:
        G: Delassus matrix of the rows of contacts, then of constraints, shape (n, n) [1/kg].
        of_row: contact of each row of contacts.
        own: those some, shape (k,).
    """
    n, found = len(of_row), own
    reached = np.zeros(len(G), dtype=bool)
    while True:
        before = int(reached.sum())
        reached[:n] |= found[of_row]
        reached |= (G[:, reached] != 0.0).any(axis=1)
        found = own | (np.bincount(of_row, reached[:n], len(own)) > 0.0)
        if int(reached.sum()) == before:
            return found


class _Process:
    """Velocities, percussions and work so far."""

    def __init__(self, contacts: Contacts, before: np.ndarray):
        self.c, self.y, self.k = contacts, before.copy(), len(contacts.e)
        self.cones = self.k if contacts.of_cone is None else len(contacts.of_cone)
        self.P = np.zeros(len(before))
        self.work = np.zeros(len(before))
        self.compresses = True
        largest = float(np.abs(before).max(initial=0.0))
        self.none, self.rest = NONE * largest, REST * largest
        self.inverse = np.maximum(contacts.G.diagonal()[: self.k], TINY)

    def compress(self) -> bool:
        """Until no contact approaches."""
        h = 1.0
        for _ in range(MAX_PARTS):
            approaches = self.y[: self.k] < -self.none
            if not approaches.any():
                return self._compressed()
            given = np.where(approaches, -self.y[: self.k] / self.inverse, 0.0)
            part = self._part(given, approaches, h)
            if part is None:
                return False
            P, y, used = part
            if self._jams(P, y):  # what is left is rounding among dependent rows, or a wedge without an end
                return bool(self.y[: self.k].min() >= -self.rest) and self._compressed()
            ahead = approaches & (y[: self.k] >= 0.0)
            now, end = self.y[: self.k][ahead], y[: self.k][ahead]
            cut = float((now / (now - end)).min(initial=1.0))
            self._go(P, y, cut)
            h = 1.0 if cut < 1.0 else 2.0 * used
        return False

    def _compressed(self) -> bool:
        """No contact approaches any more."""
        self.pressed = self.P[: self.k].copy()
        self.compresses = False
        self.absorbed = np.maximum(-self.work[: self.k], 0.0)
        return True

    def _jams(self, P: np.ndarray, y: np.ndarray) -> bool:
        """The percussions of a part with these velocities at its end move nothing."""
        return float(np.abs(y - self.y).max()) <= NONE * float((P[: self.k] * self.inverse).max())

    def expand(self) -> bool:
        """Until percussions or work are given back, or all that compression has taken, or those that should jam."""
        given, before = self.c.e * self.pressed, self.work[: self.k].copy()
        works, goal = self.c.works & (given > 0.0), float((self.c.e**2 * self.absorbed)[self.c.works].sum())
        left, h = 1.0, 1.0
        for _ in range(MAX_PARTS):
            expands = (given > 0.0) & (works | (~self.c.works & (left > 0.0)))
            if not expands.any():
                return True
            other = (expands & ~self.c.works).any()
            part = self._part(np.where(expands, given, 0.0), expands, min(h, left) if other else h)
            if part is None:
                return False
            P, y, used = part
            if not other and self._jams(P, y):
                return True
            gained = float((self.work[: self.k] - before)[self.c.works].sum())
            cut = min(self._reaches(P, y, self.c.works & expands, goal - gained) if works.any() else 1.0, 1.0)
            total = self._reaches(P, y, None, -float(self.work.sum()))
            self._go(P, y, min(cut, total))
            if total <= cut and total < 1.0:  # no more than there was
                return True
            if cut < 1.0:
                works = np.zeros_like(works)
            left = left - used * cut if left - used * cut > SHORT else 0.0
            h = 1.0 if cut < 1.0 else 2.0 * used
        return False

    def _go(self, P: np.ndarray, y: np.ndarray, cut: float) -> None:
        """Go on by a part, or by the beginning of one."""
        P, change = cut * P, cut * (y - self.y)
        self.work += P * (self.y + 0.5 * change)
        self.P, self.y = self.P + P, self.y + change
        self.y[self.k :][(self._sizes(self.y) <= self.rest)[self.c.of_F]] = 0.0

    def _reaches(self, P: np.ndarray, y: np.ndarray, of: np.ndarray | None, goal: float) -> float:
        """Beginning of a part in which some contacts, or all rows, do a work [J]; above one where they do less."""
        rows = np.ones(len(P), dtype=bool)
        if of is not None:
            rows[:] = False
            rows[: self.k] = of
        a, b = 0.5 * float((P * (y - self.y))[rows].sum()), float((P * self.y)[rows].sum())
        if a + b < goal:
            return 2.0
        # the larger root of a x^2 + b x = goal where work is lost first
        root = np.sqrt(max(b * b + 4.0 * a * goal, 0.0))
        x = 2.0 * goal / (b + root) if b > 0.0 else (root - b) / (2.0 * a) if a > 0.0 else 1.0
        return float(min(max(x, 0.0), WHOLE))

    def _part(self, given: np.ndarray, pressed: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray, float] | None:
        """Percussions and velocities at the end of a part without a slip that turns far, and its length.

        Args:
            given: normal percussions of a part of length one, shape (k,) [N s].
            pressed: contacts that have them; the others must not penetrate, shape (k,).
            h: length to try first.
        """
        mu, halved, longer = self.c.coefficients(self.y[self.k :]), False, None
        while True:
            found = self._solve(mu, h * given, pressed)
            if found is None and longer is not None:  # no small part: a slip jams, and jumps
                return longer
            if h <= SHORT or (found is not None and not self._turns(mu, found[1])):
                break
            longer = None if found is None else (*found, h)
            h, halved = 0.5 * h, True
        if found is None:
            return None
        x = self._to_end_of_slip(found[1]) if halved else 1.0
        if 1.0 < x < 2.0:
            at_end = self._solve(mu, x * h * given, pressed)
            if at_end is not None and not self._turns(mu, at_end[1]):
                return *at_end, x * h
        return *found, h

    def _solve(self, mu: np.ndarray, given: np.ndarray, pressed: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Percussions and velocities of a part; the friction is that of the mean slip, so that it never does work."""
        k, start = self.k, np.zeros(len(self.y))
        while True:
            G, b, i = self.c.G.copy(), self.y.copy(), np.flatnonzero(pressed)
            G[i] = 0.0
            G[i, i], b[i] = self.inverse[i], -self.inverse[i] * given[i]
            G[k:] *= 0.5
            for tol in (SOLVED, ROUGHLY):
                problem = G, b, mu, self.c.of_F, start
                P, converged, _ = solve_contact_problem(
                    *problem, tol, MAX_SWEEPS, of_cone=self.c.of_cone, in_engine=True
                )
                if converged:
                    break
            else:
                return None
            y = self.y + self.c.G @ P
            # one that gives back less than others push it in
            lags = pressed & (y[:k] < np.minimum(self.y[:k], 0.0) - self.none) & ~self.compresses
            if not lags.any():
                return P, y
            pressed = pressed & ~lags

    def _sizes(self, y: np.ndarray) -> np.ndarray:
        """Speed of the slip, or of the rolling, of each cone, shape (c,)."""
        return np.asarray(np.sqrt(np.bincount(self.c.of_F, y[self.k :] ** 2, self.cones)))

    def _turns(self, mu: np.ndarray, y: np.ndarray) -> bool:
        """A slip turns far in a part that ends with these velocities, or its coefficient changes."""
        slip, end = self._sizes(self.y), self._sizes(y)
        along = np.bincount(self.c.of_F, (self.y * y)[self.k :], self.cones)
        turns = (slip > 0.0) & (end > self.rest) & (along < TURN * slip * end)
        changes = np.abs(self.c.coefficients(y[self.k :]) - mu) > CHANGE * mu
        return bool(turns.any() or changes.any())

    def _to_end_of_slip(self, y: np.ndarray) -> float:
        """Length of the part in which the first slip ends, in parts of one that ends with these velocities."""
        slip, end = self._sizes(self.y), self._sizes(y)
        slows = (slip > 0.0) & (end < slip)
        return float((slip / np.maximum(slip - end, TINY))[slows].min(initial=np.inf))
