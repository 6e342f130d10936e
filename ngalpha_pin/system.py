"""Scene -> System: M, h, g, W at (t, q, v, a). The only file that calls Pinocchio's dynamics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from .contact_kinematics import Motion, Rows
from .contact_table import ContactTable, Subset
from .feature_kinematics import FeatureRows, StackedRows
from .geometry import contact_points
from .narrow_phase import solid_pairs
from .scene import Scene
from .slots import SLOTS, Slots
from .state import State

# penetration of features that are in no place, in parts of the size of the scene
MISSED = 1e-10


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
        slots: features of the shapes whose touching features change, as the last `Slots.load` or `restore` left them.
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
        points, pairs = contact_points(scene)
        self.slots = Slots(self.model, solid_pairs(scene, pairs))
        self.contacts = ContactTable(self.model, points, self.slots)
        self.slots.open_gap = self.contacts.length
        self.slots.restore(self.slots.contents())
        self.flat = all(joint.nq == joint.nv == 1 for joint in list(self.model.joints)[1:])
        mass = sum(inertia.mass for inertia in self.model.inertias)
        self.weight = float(np.sqrt(mass) * np.linalg.norm(self.model.gravity.linear))
        # Pinocchio writes into these arrays in place
        self._J, self._dJ, self._dAdv = self.data.J, self.data.dJ, self.data.dAdv
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

    def load_slots(self, state: State, near: np.ndarray, dt: float | None) -> np.ndarray:
        """Choose the features that a step from `state` works with.

        Args:
            state: start of the step.
            near: numbers of the contacts that may close in the step; of a pair of solids any of its places.
            dt: length of the step [s]; None for corners that are fixed points, which do not run around a rim.

        Returns:
            The same numbers, with the places that are taken now and the first one of every pair that is near.
        """
        first = self.contacts.n_fixed
        pairs = np.unique((near[near >= first] - first) // SLOTS)
        carries = state.contacts[state.contacts >= first] - first
        pin.forwardKinematics(self.model, self.data, state.q, state.v)
        self.slots.load(self.data, pairs, state.slots, carries, dt)
        taken = np.flatnonzero(self.slots.loaded)
        return np.concatenate((near[near < first], first + np.union1d(taken, pairs * SLOTS)))

    def add_missing(self, near: np.ndarray, rows: Rows | FeatureRows | StackedRows) -> np.ndarray:
        """Where a pair penetrates with features that no place has, they are added; the places that are new."""
        first = self.contacts.n_fixed
        if len(near) == 0 or near[-1] < first:
            return near[:0]
        before = self.slots.loaded.copy()
        of_slots = near >= first
        normals = self._normals_of_slots(near[of_slots] - first, rows.normals[of_slots])
        pairs = np.unique((near[of_slots] - first) // SLOTS)
        self.slots.add_missing(self.data, pairs, normals, MISSED * self.contacts.length)
        return first + np.flatnonzero(self.slots.loaded & ~before)

    @property
    def has_rims(self) -> bool:
        """A rim is in one of the places."""
        return self.slots.n > 0 and self.slots.has_rims()

    def smallest_gap(self) -> float:
        """The smallest gap of all contacts, or a lower bound of it, [m]; see `gaps`."""
        first, length = self.contacts.n_fixed, self.contacts.length
        smallest = float(self.gaps(self.contacts.subset(np.arange(first))).min(initial=length))
        if self.slots.n == 0:
            return smallest
        loaded = np.flatnonzero(self.slots.loaded)
        rows = self._rows(self.contacts.subset(first + loaded))
        return min(smallest, self.slots.deepest(self.data, length, self._normals_of_slots(loaded, rows.normals)))

    def _normals_of_slots(self, places: np.ndarray, normals: np.ndarray) -> np.ndarray:
        every = np.zeros((self.slots.n, 3))
        every[places] = normals
        return every

    def rows_of_gaps(self, sub: Subset) -> Rows | FeatureRows | StackedRows:
        """Like `gaps`, with the normals."""
        return self._rows(sub)

    def distances(self, within: float) -> np.ndarray:
        """Gaps of all contacts; for the places of a pair of solids a lower bound of their distance, shape (n,) [m].

        Args:
            within: distances above this one need not be exact [m].
        """
        fixed = self.gaps(self.contacts.subset(np.arange(self.contacts.n_fixed)))
        if self.slots.n == 0:
            return fixed
        return np.concatenate((fixed, np.repeat(self.slots.distances(self.data, within), SLOTS)))

    def gaps(self, sub: Subset) -> np.ndarray:
        """g_N of a subset where the last call of `dynamics` or `place` has put the bodies, shape (k,) [m]."""
        return self._rows(sub).g_N

    def contact_rows(self, sub: Subset, v: np.ndarray, a: np.ndarray) -> Rows | FeatureRows | StackedRows:
        """Kinematic rows of a subset after `dynamics` at the same q, v and a."""
        return self._rows(sub).move(self.motion(v, a))

    def motion(self, v: np.ndarray, a: np.ndarray) -> Motion:
        """What `Rows` needs of the last call of `dynamics`."""
        return Motion(self._J, self._dJ, self._dAdv, v, a)

    def contact_rates(self, sub: Subset, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """g_N_dot and gamma_F of a subset at (q, v), shape (k + m,) [m/s]."""
        return self.contact_rows_at(sub, q, v).rate

    def contact_rows_at(self, sub: Subset, q: np.ndarray, v: np.ndarray) -> Rows | FeatureRows | StackedRows:
        """Kinematic rows of a subset at (q, v), without accelerations."""
        pin.computeJointJacobiansTimeVariation(self.model, self.data, q, v)
        return self.contact_rows(sub, v, np.zeros_like(v))

    def energy(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float]:
        """Kinetic and potential (gravity) energy [J]."""
        return (
            float(pin.computeKineticEnergy(self.model, self.data, q, v)),
            float(pin.computePotentialEnergy(self.model, self.data, q)),
        )

    def _rows(self, sub: Subset) -> Rows | FeatureRows | StackedRows:
        if len(sub.slots) == 0:
            return self._fixed_rows(sub)
        if sub.k_fixed == 0:
            return self._feature_rows(sub)
        return StackedRows(sub, self._fixed_rows(sub.parts[0]), self._feature_rows(sub.parts[1]))

    def _fixed_rows(self, sub: Subset) -> Rows:
        return Rows(sub, [self._rotations[j] for j in sub.bodies], [self._translations[j] for j in sub.bodies])

    def _feature_rows(self, sub: Subset) -> FeatureRows:
        rotation = np.array([self._rotations[j] for j in sub.bodies])
        translation = np.array([self._translations[j] for j in sub.bodies])
        return FeatureRows(sub, self.slots.packed[sub.slots], rotation, translation)
