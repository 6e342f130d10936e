"""Scene -> System: M, h, g, W at (t, q, v, a). The only file that calls Pinocchio's dynamics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from . import kernel
from .constraint_provider import Bodies
from .constraint_rows import ConstraintRows, Constraints
from .contact_kinematics import Motion, Rows
from .contact_table import ContactTable, Subset
from .geometry import contact_points
from .joint_friction import JointFriction
from .joint_limits import LimitedRows, limit_gaps
from .joints import effort_bounds, joint_limits
from .layout import Layout
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
        forces, controls: the forces of the scene; controls are those of the motors.
        contacts: `ContactTable`.
        flat: every joint coordinate is a plain number, so that `pin.dIntegrate` is the identity.
        tau: generalized force that `Simulator.step` holds during a step, shape (nv,), or None.
        live: arrays that the compiled kernel reads, made when it is used first.
        weight: sqrt(mass) times gravity, the unit of forces in kinetic scaling [sqrt(kg) m/s^2].
    """

    def __init__(self, scene: Scene):
        self.scene, laws = scene, scene.joints
        self.model = scene.model
        if not laws.armature and np.any(self.model.armature):
            self.model = scene.model.copy()
            self.model.armature = np.zeros(self.model.nv)
        self.nq, self.nv = self.model.nq, self.model.nv
        self.data = self.model.createData()
        self.damping = np.array(self.model.damping) if laws.damping and np.any(self.model.damping) else None
        self.effort = effort_bounds(self.model, laws)
        self._passive = not (scene.forces or self.damping is not None)
        self.tau: np.ndarray | None = None
        self.contacts = ContactTable(self.model, contact_points(scene), joint_limits(self.model, laws))
        self.joint_friction = JointFriction(self.model, self.nv, laws.friction)
        self.constraints = Constraints(scene, self.model)
        self._layouts: dict[Subset, Layout] = {}
        self.flat = all(joint.nq == joint.nv == 1 for joint in list(self.model.joints)[1:])
        mass = sum(inertia.mass for inertia in self.model.inertias)
        self.weight = float(np.sqrt(mass) * np.linalg.norm(self.model.gravity.linear))
        # Pinocchio writes into these arrays in place; one that has a single column it returns as a vector
        columns = (self.data.J, self.data.dJ, self.data.dAdv)
        self._J, self._dJ, self._dAdv = (x.reshape(6, self.model.nv) for x in columns)
        self._residual, self._M = self.data.tau, self.data.M
        self._K, self._D = self.data.dtau_dq, self.data.dtau_dv
        self.live: kernel.Live | None = None
        poses = [self.data.oMi[joint] for joint in range(self.model.njoints)]
        self._rotations = [pose.rotation for pose in poses]
        self._translations = [pose.translation for pose in poses]
        bound = [force.bind(self) for force in scene.forces]
        self.forces = tuple(force for force in bound if not force.actuated)
        self.controls = tuple(force for force in bound if force.actuated)

    def dynamics(self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Dynamics:
        """The equations of motion (52) without contact forces, and their derivatives."""
        pin.computeRNEADerivatives(self.model, self.data, q, v, a)
        loads = self.loads(t, q, v)
        if loads is None:
            return Dynamics(self._residual, self._M, self._K, self._D)
        tau, K, D = loads
        return Dynamics(self._residual - tau, self._M, self._K - K, self._D - D)

    @property
    def loaded(self) -> bool:
        """There are forces, controls or damping."""
        return self.tau is not None or not self._passive

    def loads(self, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Forces, controls and damping, shape (nv,), with their d/dq and d/dv; None where the scene has none."""
        if not self.loaded:
            return None
        tau, K, D = self._controls(t, q, v)
        for force in self.forces:
            force.add_to(t, q, v, tau, K, D)
        if self.damping is not None:
            tau -= self.damping * v
            D[np.arange(self.nv), np.arange(self.nv)] -= self.damping
        return tau, K, D

    def _controls(self, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Generalized force of the actuators within their effort limits, shape (nv,), and its d/dq and d/dv."""
        nv = self.nv
        tau = np.zeros(nv) if self.tau is None else self.tau.copy()
        K, D = np.zeros((nv, nv)), np.zeros((nv, nv))
        for force in self.controls:
            force.add_to(t, q, v, tau, K, D)
        if self.effort is not None:
            lower, upper = self.effort
            saturated = (tau < lower) | (tau > upper)
            if saturated.any():
                tau = np.clip(tau, lower, upper)
                K[saturated], D[saturated] = 0.0, 0.0
        return tau, K, D

    def integrate(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """The configuration after the tangent step dq, shape (nq,)."""
        return pin.integrate(self.model, q, dq)

    def d_integrate(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """Derivative of that configuration by dq, shape (nv, nv)."""
        return pin.dIntegrate(self.model, q, dq)[1]

    @property
    def poses(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Rotation and translation of every joint after the last call of `dynamics` or `place`."""
        return self._rotations, self._translations

    def layout(self, sub: Subset) -> Layout:
        """Where the rows of a subset, of joint friction and of the constraints stand among the multipliers."""
        found = self._layouts.get(sub)
        if found is None:
            if len(self._layouts) > 4096:
                self._layouts.clear()
            constraints = self.constraints
            found = self._layouts[sub] = Layout(sub, self.joint_friction.f, constraints.kb, constraints.mb)
        return found

    def place(self, q: np.ndarray) -> None:
        """Move the bodies to q, for `gaps` alone."""
        pin.forwardKinematics(self.model, self.data, q)

    def gaps(self, sub: Subset, q: np.ndarray) -> np.ndarray:
        """g_N of a subset at q, after `dynamics` or `place` there, shape (k,) [m or rad]."""
        if kernel.library is None:
            return self._rows(sub, q).g_N
        g_N = kernel.gaps(self, sub.points)
        return g_N if sub.points is sub else np.concatenate((g_N, limit_gaps(sub, q)))

    def contact_rows(self, sub: Subset, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Rows | LimitedRows:
        """Kinematic rows of a subset after `dynamics` at the same q, v and a."""
        return self._rows(sub, q).move(self.motion(v, a))

    def constraint_rows(self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> ConstraintRows:
        """Kinematic rows of the constraints after `dynamics` at the same t, q, v and a."""
        return self.constraints.rows(Bodies(t, q, self._rotations, self._translations, self.motion(v, a)))

    def motion(self, v: np.ndarray, a: np.ndarray) -> Motion:
        """What `Rows` needs of the last call of `dynamics`."""
        return Motion(self._J, self._dJ, self._dAdv, v, a)

    def contact_rates(self, sub: Subset, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """g_N_dot and gamma_F of a subset at (q, v), shape (k + m,) [m/s]."""
        return self.contact_rows_at(sub, q, v).rate

    def contact_rows_at(self, sub: Subset, q: np.ndarray, v: np.ndarray) -> Rows | LimitedRows:
        """Kinematic rows of a subset at (q, v), without accelerations."""
        pin.computeJointJacobiansTimeVariation(self.model, self.data, q, v)
        return self.contact_rows(sub, q, v, np.zeros_like(v))

    def energy(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float]:
        """Kinetic and potential (gravity) energy [J]."""
        return (
            float(pin.computeKineticEnergy(self.model, self.data, q, v)),
            float(pin.computePotentialEnergy(self.model, self.data, q)),
        )

    def _rows(self, sub: Subset, q: np.ndarray) -> Rows | LimitedRows:
        points = sub.points
        rows = Rows(points, [self._rotations[j] for j in points.bodies], [self._translations[j] for j in points.bodies])
        return rows if points is sub else LimitedRows(sub, rows, q)
