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
