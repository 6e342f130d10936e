"""One frictional contact problem of many bodies, solved by the compiled engine: arrays alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from . import _engine


class Kind(IntEnum):
    """Law of a group of rows."""

    CONTACT = 0  # Signorini's law for the first row, Coulomb's for the others
    TIED = 1  # Signorini's law, and friction mu P_N direction
    BOUNDED = 2  # one row, lower <= P <= upper; without bounds it is bilateral


@dataclass(frozen=True)
class Group:
    """Rows that one law ties together.

    Attributes:
        J: for every tree that moves them, its number and the rows in its coordinates, shape (rows, size of the tree).
        bias: y without percussions, shape (rows,) [m/s]; or the same one level up.
        kind: their law.
        mu: friction coefficient [-].
        bounds: of a bounded row [N s].
        direction: of friction that is tied, shape (rows - 1,) [-].
        compliance: E of y = b + (J M^-1 J^T + E) P, shape (rows, rows) [1/kg]; None is zero.
    """

    J: Sequence[tuple[int, np.ndarray]]
    bias: np.ndarray
    kind: Kind = Kind.CONTACT
    mu: float = 0.0
    bounds: tuple[float, float] = (-np.inf, np.inf)
    direction: np.ndarray = field(default_factory=lambda: np.zeros(0))
    compliance: np.ndarray | None = None


NO_COMPLIANCE = np.zeros(0)


class ContactSolver:
    """Keeps memory, and the pattern of its factors while the graph of the trees stays the same."""

    def __init__(self) -> None:
        self._solver = _engine.ContactSolver()

    def solve(
        self, M: Sequence[np.ndarray], groups: Sequence[Group], guess: np.ndarray | None = None, tolerance: float = 1e-9
    ) -> tuple[np.ndarray, dict[str, float]]:
        """Find P that fulfils the laws of all groups, (41) and (47), with y = b + (J M^-1 J^T + E) P.

        Args:
            M: inertia of every tree, shape (size, size) each [kg].
            groups: the rows.
            guess: first P, shape (rows,) [N s]; None begins from nothing.
            tolerance: largest residual, in parts of the largest percussion, both in units of the root of energy [-].

        Returns:
            P, shape (rows,), or where the search for it has ended; and what that took: `solved`, `error`,
            `corrections`, `sweeps`, `path`, `rounds`.

        Raises:
            ValueError: shapes do not fit, or a law is none.
        """
        legs = [(g, tree) for g, group in enumerate(groups) for tree, _ in group.J]
        laws = np.zeros((len(groups), 6))
        compliance = np.zeros((len(groups), 4, 4) if any(x.compliance is not None for x in groups) else 0)
        for g, group in enumerate(groups):
            laws[g, :3] = group.mu, *group.bounds
            laws[g, 3 : 3 + len(group.direction)] = group.direction
            if group.compliance is not None:
                compliance[g, : len(group.bias), : len(group.bias)] = group.compliance
        bias = _flat([group.bias for group in groups])
        return self.solve_arrays(
            np.array([len(block) for block in M], dtype=np.int32),
            _flat(M),
            np.array([group.kind for group in groups], dtype=np.int32),
            np.array([len(group.bias) for group in groups], dtype=np.int32),
            laws,
            np.array(legs, dtype=np.int32).reshape(-1, 2),
            _flat([J for group in groups for _, J in group.J]),
            bias,
            np.zeros(len(bias)) if guess is None else np.ascontiguousarray(guess, dtype=float),
            tolerance,
            compliance,
        )

    def solve_arrays(
        self,
        sizes: np.ndarray,
        M: np.ndarray,
        kinds: np.ndarray,
        rows: np.ndarray,
        laws: np.ndarray,
        legs: np.ndarray,
        J: np.ndarray,
        bias: np.ndarray,
        guess: np.ndarray,
        tolerance: float,
        compliance: np.ndarray = NO_COMPLIANCE,
    ) -> tuple[np.ndarray, dict[str, float]]:
        """The same from arrays of all groups and trees, one after the other; whole numbers are of 32 bits.

        Args:
            sizes: coordinates of every tree, shape (trees,).
            M: their inertias row by row, flat [kg].
            kinds: law of every group, shape (groups,).
            rows: their number in every group, shape (groups,).
            laws: mu, the bounds and the direction of every group, shape (groups, 6).
            legs: group and tree of each part of J, in the order of the groups, shape (parts, 2).
            J: these parts row by row, flat.
            bias: of all rows, shape (rows,) [m/s].
            guess: first P, shape (rows,) [N s].
            tolerance: as in `solve` [-].
            compliance: E of every group, shape (groups, 4, 4), or empty.

        Returns:
            As `solve`.

        Raises:
            ValueError: shapes do not fit, or a law is none.
        """
        return self._solver.solve(sizes, M, kinds, rows, laws, legs, J, bias, guess, tolerance, compliance)


def _flat(parts: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.asarray(part, dtype=float).ravel() for part in parts]) if len(parts) else np.zeros(0)
