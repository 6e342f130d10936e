"""Energy along a trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from ngalpha_pin.results.trajectory import Trajectory


class Energy(NamedTuple):
    """Energies over time, each of shape (n + 1,) [J].

    Attributes:
        kinetic: v^T M v / 2.
        potential: of gravity, and of dead loads on beams.
        elastic: stored in the springs and position gains of the forces, and in beams.
        conserved: every force of the scene stores or removes energy, none can feed it in.
    """

    kinetic: np.ndarray
    potential: np.ndarray
    elastic: np.ndarray
    conserved: bool

    @property
    def total(self) -> np.ndarray:
        """Their sum, shape (n + 1,) [J]."""
        return self.kinetic + self.potential + self.elastic


def energy(trajectory: Trajectory) -> Energy:
    """Energies of a trajectory, from its q and v."""
    system = trajectory.system
    pairs = np.array([system.energy(q, v) for q, v in zip(trajectory.q, trajectory.v, strict=True)])
    elastic, conserved, n = np.zeros(len(pairs)), True, trajectory.scene.model.nq
    if system.beams is not None:
        conserved = system.beams.conserved
        elastic += np.array([system.beams.strain_energy(q) for q in trajectory.q])
    for force in (*system.forces, *system.controls):
        if force.energy is None:
            conserved = False
        else:
            elastic += np.array([force.energy(q[:n]) for q in trajectory.q])
    return Energy(pairs[:, 0], pairs[:, 1], elastic, conserved)
