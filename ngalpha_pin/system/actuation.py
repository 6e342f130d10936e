"""What acts in a step beside the forces and controls of the scene."""

from __future__ import annotations

from typing import NamedTuple

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
