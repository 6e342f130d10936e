"""What the kinds of bilateral constraints have in common: rows of g, then rows of gamma, at one motion."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from ngalpha_pin.contact.point_rows import KinematicRows, Motion


class Bodies(NamedTuple):
    """Where everything is when rows are asked for.

    Attributes:
        t: time [s].
        q: configuration, shape (nq,).
        rotation, translation: pose of every joint, arrays of shape (3, 3) and (3,).
        motion: what Pinocchio left of the velocity and the acceleration.
    """

    t: float
    q: np.ndarray
    rotation: list[np.ndarray]
    translation: list[np.ndarray]
    motion: Motion


class ProviderRows(KinematicRows, Protocol):
    """Rows of one kind of constraint at one motion: first those of g, then those of gamma."""

    @property
    def g(self) -> np.ndarray:
        """The functions that vanish, shape (kb,)."""

    @property
    def wrenches(self) -> RowWrenches:
        """What the rows do to bodies."""


class RowWrenches(NamedTuple):
    """Rows as wrenches on body b, and the opposite ones on body a; zero where a row acts in joints.

    Attributes:
        F: about the origin of the world, shape (rows, 6).
        a, b: joints, 0 is the world, shape (rows,).
    """

    F: np.ndarray
    a: np.ndarray
    b: np.ndarray

    @classmethod
    def in_joints(cls, n: int) -> RowWrenches:
        """Of n rows that act in joints."""
        return cls(np.zeros((n, 6)), np.zeros(n, dtype=int), np.zeros(n, dtype=int))


class Provider(Protocol):
    """Constraints of one kind.

    Attributes:
        names_g, names_gamma: name of the constraint that each row belongs to.
        group: rows of one group share their scale, shape (kb + mb,).
        everywhere: the rows can be computed at any configuration.
    """

    everywhere: bool
    names_g: tuple[str, ...]
    names_gamma: tuple[str, ...]
    group: np.ndarray

    def rows(self, bodies: Bodies) -> ProviderRows:
        """Rows at one motion."""
