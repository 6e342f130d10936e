"""Scene -> System: M, h, g, W at (t, q, v, a). The only file that calls Pinocchio's dynamics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from .contact_kinematics import Motion, Rows
from .contact_table import ContactTable, Subset
from .geometry import contact_points
from .scene import Scene


class Dynamics(NamedTuple):
    """The equations of motion at (t, q, v, a). Arrays may be views of Pinocchio's data: used before the next call.

    Attributes:
        residual: M a + nle - tau, shape (nv,) [N or N m].
        M: mass matrix, shape (nv, nv).
        K, D: derivatives of the residual by q (tangent) and by v, shape (nv, nv).
    """

    residual: np.ndarray
    M: np.ndarray
    K: np.ndarray
    D: np.ndarray


class System:
    """A scene, compiled: owns the `pin.Data` and the contact table.

    Args:
        scene: what to simulate. Changes of the scene after this do not reach the system.

    Attributes:
        model: `pin.Model`.
        contacts: `ContactTable`.
        flat: every joint coordinate is a plain number, so that `pin.dIntegrate` is the identity.
        tau: generalized force that `Simulator.step` holds during a step, shape (nv,), or None.
        weight: sqrt(mass) times gravity, the unit of forces in kinetic scaling [sqrt(kg) m/s^2].
    """

    def __init__(self, scene: Scene):
        self.scene = scene
        self.model = scene.model
        self.data = self.model.createData()
        self.forces = tuple(scene.forces)
        self.tau: np.ndarray | None = None
        self.contacts = ContactTable(self.model, contact_points(scene))
        self.flat = all(joint.nq == joint.nv == 1 for joint in list(self.model.joints)[1:])
        mass = sum(inertia.mass for inertia in self.model.inertias)
        self.weight = float(np.sqrt(mass) * np.linalg.norm(self.model.gravity.linear))
        # Pinocchio writes into these arrays in place; a model of one coordinate gives vectors
        self._J, self._dJ, self._dAdv = (x.reshape(6, -1) for x in (self.data.J, self.data.dJ, self.data.dAdv))
        self._residual, self._M = self.data.tau, self.data.M
        self._K, self._D = self.data.dtau_dq, self.data.dtau_dv
        poses = [self.data.oMi[joint] for joint in range(self.model.njoints)]
        self._rotations = [pose.rotation for pose in poses]
        self._translations = [pose.translation for pose in poses]

    def dynamics(self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Dynamics:
        """The equations of motion (52) without contact forces, and their derivatives."""
        pin.computeRNEADerivatives(self.model, self.data, q, v, a)
        if not self.forces:
            residual = self._residual if self.tau is None else self._residual - self.tau
            return Dynamics(residual, self._M, self._K, self._D)
        nv = self.model.nv
        tau, K, D = np.zeros(nv), np.zeros((nv, nv)), np.zeros((nv, nv))
        for force in self.forces:
            force.add_to(t, q, v, tau, K, D)
        if self.tau is not None:
            tau += self.tau
        return Dynamics(self._residual - tau, self._M, self._K - K, self._D - D)

    def place(self, q: np.ndarray) -> None:
        """Move the bodies to q, for `gaps` alone."""
        pin.forwardKinematics(self.model, self.data, q)

    def gaps(self, sub: Subset) -> np.ndarray:
        """g_N of a subset where the last call of `dynamics` or `place` has put the bodies, shape (k,) [m]."""
        return self._rows(sub).g_N

    def contact_rows(self, sub: Subset, v: np.ndarray, a: np.ndarray) -> Rows:
        """Kinematic rows of a subset after `dynamics` at the same q, v and a."""
        return self._rows(sub).move(self.motion(v, a))

    def motion(self, v: np.ndarray, a: np.ndarray) -> Motion:
        """What `Rows` needs of the last call of `dynamics`."""
        return Motion(self._J, self._dJ, self._dAdv, v, a)

    def contact_rates(self, sub: Subset, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """g_N_dot and gamma_F of a subset at (q, v), shape (k + m,) [m/s]."""
        return self.contact_rows_at(sub, q, v).rate

    def contact_rows_at(self, sub: Subset, q: np.ndarray, v: np.ndarray) -> Rows:
        """Kinematic rows of a subset at (q, v), without accelerations."""
        pin.computeJointJacobiansTimeVariation(self.model, self.data, q, v)
        return self.contact_rows(sub, v, np.zeros_like(v))

    def energy(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float]:
        """Kinetic and potential (gravity) energy [J]."""
        return (
            float(pin.computeKineticEnergy(self.model, self.data, q, v)),
            float(pin.computePotentialEnergy(self.model, self.data, q)),
        )

    def _rows(self, sub: Subset) -> Rows:
        return Rows(sub, [self._rotations[j] for j in sub.bodies], [self._translations[j] for j in sub.bodies])
