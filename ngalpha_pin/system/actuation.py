"""What acts in a step beside the forces and controls of the scene."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np


class Actuation(NamedTuple):
    """What motors and contacts that hold do beside the forces and controls of the scene.

    Attributes:
        tau: generalized force on the tree that is held during the step, shape (nv,) [N or N m], or None.
        held: which motors are taken to be at their upper (1) or lower (-1) effort limit, shape (nv,), or None where the
            torque that they are asked for says so.
        holding: numbers of the contacts whose adhesion acts, shape (j,), or None.
    """

    tau: np.ndarray | None = None
    held: np.ndarray | None = None
    holding: np.ndarray | None = None


NO_ACTUATION = Actuation()


class _Compiled(Protocol):
    """A scene whose contacts pull."""

    contacts: Any

    def contact_rows(self, sub: Any, q: np.ndarray, v: np.ndarray, a: np.ndarray, t: float) -> Any:
        """See `System`."""


def pull(system: _Compiled, t: float, q: np.ndarray, v: np.ndarray, holding: np.ndarray) -> np.ndarray:
    """Generalized force of the contacts that hold, after `dynamics` or the like at the same motion, shape (nv,).

    Args:
        system: compiled scene.
        t: time [s].
        q: configuration, shape (nq,).
        v: velocity, shape (nv,).
        holding: numbers of these contacts.
    """
    sub = system.contacts.subset(holding)
    rows = system.contact_rows(sub, q, v, np.zeros_like(v), t)
    force: np.ndarray = -system.contacts.adhesion[holding] @ rows.W[: sub.k]
    return force
