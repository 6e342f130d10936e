"""Scene -> System: M, h, g, W at (t, q, v, a). The only file that calls Pinocchio's dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.constraints.constraint_set import ConstraintRows, Constraints
from ngalpha_pin.constraints.provider import Bodies
from ngalpha_pin.constraints.unilateral import unilaterals
from ngalpha_pin.contact.compiled_contacts import compiled_contacts
from ngalpha_pin.contact.feature_rows import FeatureRows, StackedRows
from ngalpha_pin.contact.joint_friction import JointFriction
from ngalpha_pin.contact.kernel_rows import rows_at
from ngalpha_pin.contact.limit_rows import LimitedRows, other_gaps
from ngalpha_pin.contact.point_rows import KinematicRows, Motion, Rows
from ngalpha_pin.contact.row_layout import Layout
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.flexible.beams import Beams, with_points
from ngalpha_pin.numerics.block_matrix import BlockMatrix, Matrix, stacked
from ngalpha_pin.scene.joints import effort_bounds, joint_limits, linear_coordinates
from ngalpha_pin.scene.sampled_control import SampledControl
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.actuation import NO_ACTUATION, Actuation, pull
from ngalpha_pin.system.extra_states import States, with_states
from ngalpha_pin.system.plane_angles import PlaneAngles
from ngalpha_pin.system.regime import MANY_TREES, PLACED
from ngalpha_pin.system.tree_view import TreeView

ContactRows = Rows | FeatureRows | StackedRows | LimitedRows


class Dynamics(NamedTuple):
    """The equations of motion at (t, q, v, a). Arrays may be views of Pinocchio's data: used before the next call.

    Attributes:
        residual: M a + nle - tau, shape (nv,) [N or N m].
        M: mass matrix, shape (nv, nv); of a scene with beams block by block.
        K, D: derivatives of the residual by q (tangent) and by v, likewise.
    """

    residual: np.ndarray
    M: Matrix
    K: Matrix
    D: Matrix


class System:
    """A scene, compiled: owns the `pin.Data` and the contact table.

    Args:
        scene: what to simulate. Changes of the scene after this do not reach the system.

    Attributes:
        tree, model: `pin.Model` of the dynamics, and with a joint for each beam point or first-order state behind it.
        beams, states: those of the scene, or None.
        nq, nv: number of coordinates and velocities, of tree, beams and states.
        forces, controls: the forces of the scene; controls are those of the motors.
        forces_at_bodies: some of them act where bodies are, as the last call of `dynamics` has put them.
        samplers: those of the controls whose force is held between samples.
        contacts: `ContactTable`.
        slots: features of the shapes whose touching features change, as the last `Slots.load` or `restore` left them.
        many_trees: there are many trees, and nothing but contacts couples them.
        kinds_of_coordinates: lengths and angles, see `linear_coordinates`.
        flat: every joint coordinate is a plain number, so that `pin.dIntegrate` is the identity.
        live: arrays that the compiled kernel reads, made when it is used first.
        plain: the scene as the engine knows it, made when it is used first; False where it has more than that knows.
        crowd: likewise, where it has many trees.
        weight: sqrt(mass) times gravity, the unit of forces in kinetic scaling [sqrt(kg) m/s^2].
    """

    def __init__(self, scene: Scene):
        self.scene, laws, forces = scene, scene.joints, scene.forces
        self.tree = scene.model
        if not laws.armature and np.any(self.tree.armature):
            self.tree = scene.model.copy()
            self.tree.armature = np.zeros(self.tree.nv)
        self.model = with_states(self.tree, scene.states, bool(scene.unilaterals))
        self.states = None if self.model is self.tree else States(scene.states, self.tree, self.model)
        self._nq_tree, self._nv_tree, self.nq, self.nv = self.tree.nq, self.tree.nv, self.model.nq, self.model.nv
        self._of_planes = PlaneAngles(self.tree)
        self.kinds_of_coordinates = self._slides, self._lengths, self._angles = linear_coordinates(self.model)
        self.many_trees = self._has_many_trees()
        self.flat = all(joint.nq == joint.nv == 1 for joint in list(self.model.joints)[1:])
        mass = sum(inertia.mass for inertia in self.model.inertias)
        self.effort, limits = effort_bounds(self.tree, laws), joint_limits(self.tree, laws)
        self.beams = Beams(self.tree, scene.beams, scene.beam_points, scene.loads, forces) if scene.beams else None
        if self.beams is not None:
            self.model = with_points(self.tree, scene.beams, scene.beam_points)
            self.nq, self.nv = self.nq + self.beams.n, self.nv + self.beams.n
            mass += self.beams.mass
        self.data = self.model.createData()
        self._tree_data = self.data if self.beams is None else self.tree.createData()
        self.damping = np.array(self.tree.damping) if laws.damping and np.any(self.tree.damping) else None
        self._passive = not (forces or self.damping is not None or scene.states)
        length = max((b.length for b in scene.beams.values()), default=0.0)
        self.slots, self.contacts = compiled_contacts(scene, self.model, self.data, limits, length)
        if self.beams is not None:
            reach, n = self.contacts.reach, self._nv_tree
            self.contacts.reach = np.concatenate((reach[:n], self.beams.reach(reach[n:])))
        self.joint_friction = JointFriction(self.model, self.model.nv, laws.friction)
        self.constraints, self.unilaterals = Constraints(scene, self.model), unilaterals(scene, self.model)
        self._layouts: dict[Subset, Layout] = {}
        self.weight = float(np.sqrt(mass) * np.linalg.norm(self.model.gravity.linear))
        # Pinocchio writes into these arrays in place; one that has a single column it returns as a vector
        written = (self.data.J, self.data.dJ, self.data.dAdv)
        self._J, self._dJ, self._dAdv = (x.reshape(6, self.model.nv) for x in written)
        n = self.model.nv if self.beams is None else self._nv_tree
        self._residual, self._M = self.data.tau[:n], self.data.M[:n, :n]
        self._K, self._D = self.data.dtau_dq[:n, :n], self.data.dtau_dv[:n, :n]
        self.live: kernel.Live | None = None
        self.plain: Any = None
        self.crowd: Any = None
        poses = [self.data.oMi[joint] for joint in range(self.model.njoints)]
        self._rotations = [pose.rotation for pose in poses]
        self._translations = [pose.translation for pose in poses]
        self._bind_forces()

    def _bind_forces(self) -> None:
        kinematics: Any = self if self.model is self.tree else TreeView(self)
        bound = [force.bind(kinematics) for force in self.scene.forces]
        self.forces_at_bodies = any(one is not force for one, force in zip(bound, self.scene.forces, strict=True))
        self.forces = tuple(force for force in bound if not force.actuated)
        self.controls = tuple(force for force in bound if force.actuated)
        self.samplers = tuple(force for force in self.controls if isinstance(force, SampledControl))

    def dynamics(
        self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray, actuation: Actuation = NO_ACTUATION
    ) -> Dynamics:
        """The equations of motion (52) without contact forces, and their derivatives."""
        if self.beams is None:
            pin.computeRNEADerivatives(self.model, self.data, q, v, a)
            return self._tree(t, q, v, actuation)
        self._placed = self.beams.place(q, v, a)
        if self.model.nv:
            pin.computeRNEADerivatives(self.model, self.data, *self._placed)
        tree = self._tree(t, q[: self._nq_tree], v[: self._nv_tree], actuation)
        forces = self.beams.forces(q, v)
        M = BlockMatrix(tree.M, self.beams.M)
        residual = np.concatenate((tree.residual, forces.f))
        residual[self._nv_tree :] += (M @ a)[self._nv_tree :]
        return Dynamics(residual, M, BlockMatrix(tree.K, forces.K), BlockMatrix(tree.D, forces.D))

    def _tree(self, t: float, q: np.ndarray, v: np.ndarray, actuation: Actuation) -> Dynamics:
        """The equations of motion of the tree, from what Pinocchio has computed and the forces of the scene."""
        loads = self.loads(t, q, v, actuation)
        if loads is None:
            return Dynamics(self._residual, self._M, self._K, self._D)
        tau, K, D = loads
        return Dynamics(self._residual - tau, self._M, self._K - K, self._D - D)

    def _has_many_trees(self) -> bool:
        """The scene has many trees that hang on the world and move, and nothing but contacts couples them."""
        scene = self.scene
        if scene.beams or scene.constraints or scene.forces or self.states is not None:
            return False
        return sum(parent == 0 for parent in list(self.model.parents)[1:]) >= MANY_TREES

    def loaded(self, actuation: Actuation = NO_ACTUATION) -> bool:
        """There are forces, controls or damping."""
        return not (self._passive and actuation.tau is None and actuation.holding is None)

    def loads(
        self, t: float, q: np.ndarray, v: np.ndarray, actuation: Actuation = NO_ACTUATION
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Forces, controls and damping, shape (nv,), with their d/dq and d/dv; None where there are none."""
        if not self.loaded(actuation):
            return None
        (tau, K, D), q_tree, v_tree = self._controls(t, q, v, actuation), q[: self._nq_tree], v[: self._nv_tree]
        for force in self.forces:
            force.add_to(t, q_tree, v_tree, tau, K, D)
        if self.damping is not None:
            tau -= self.damping * v_tree
            D[np.diag_indices(len(v_tree))] -= self.damping
        if actuation.holding is not None:
            tau += pull(self, t, q, v, actuation.holding)
        return (tau, K, D) if self.states is None else self.states.with_rates(t, q, v, tau, K, D)

    def loads_there(
        self, t: float, q: np.ndarray, v: np.ndarray, actuation: Actuation
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """`loads` where the bodies have not been put at (q, v) yet."""
        if self.forces_at_bodies or actuation.holding is not None:
            still, points = np.zeros(self.model.nv), np.zeros(self.model.nv - len(v))  # those of beams
            pin.computeRNEADerivatives(self.model, self.data, np.append(q, points), np.append(v, points), still)
        return self.loads(t, q, v, actuation)

    def _controls(
        self, t: float, q: np.ndarray, v: np.ndarray, actuation: Actuation
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Generalized force of the actuators within their effort limits, shape (nv,), and its d/dq and d/dv."""
        tau, K, D = self.demands(t, q, v, actuation)
        if self.effort is not None:
            lower, upper = self.effort
            side = self._passed(tau) if actuation.held is None else actuation.held
            if side.any():
                tau = np.where(side == 0, tau, np.where(side > 0, upper, lower))
                K[side != 0], D[side != 0] = 0.0, 0.0
        return tau, K, D

    def passed_limits(self, t: float, q: np.ndarray, v: np.ndarray, actuation: Actuation = NO_ACTUATION) -> np.ndarray:
        """1 where the actuators are asked for more than their upper effort limit, -1 below the lower one, (nv,)."""
        return self._passed(self.demands(t, q, v, actuation)[0])

    def demands(
        self, t: float, q: np.ndarray, v: np.ndarray, actuation: Actuation = NO_ACTUATION
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the actuators ask for, shape (nv,) of the tree, and its d/dq and d/dv; they see no beams."""
        nv = self._nv_tree
        q, v = q[: self._nq_tree], v[:nv]
        tau = np.zeros(nv) if actuation.tau is None else actuation.tau.copy()
        K, D = np.zeros((nv, nv)), np.zeros((nv, nv))
        for force in self.controls:
            force.add_to(t, q, v, tau, K, D)
        return tau, K, D

    def _passed(self, tau: np.ndarray) -> np.ndarray:
        """Sides of the effort limits on which tau is beyond them, see `passed_limits`."""
        assert self.effort is not None
        return (tau > self.effort[1]).astype(int) - (tau < self.effort[0])

    def integrate(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """The configuration after the tangent step dq, shape (nq,)."""
        if self.beams is None:
            return pin.integrate(self.model, q, dq)
        n, m = self._nq_tree, self._nv_tree
        return np.concatenate((pin.integrate(self.tree, q[:n], dq[:m]), q[n:] + dq[m:]))

    def difference(self, q0: np.ndarray, q1: np.ndarray) -> np.ndarray:
        """The tangent step from q0 to q1, shape (nv,)."""
        n = self._nq_tree
        in_tree = self._of_planes.correct(q0, q1, pin.difference(self.tree, q0[:n], q1[:n]))
        return np.concatenate((in_tree, q1[n:] - q0[n:]))

    def d_integrate(self, q: np.ndarray, dq: np.ndarray) -> Matrix:
        """Derivative of that configuration by dq, shape (nv, nv)."""
        model = self.model if self.beams is None else self.tree
        tree = pin.dIntegrate(model, q[: model.nq], dq[: model.nv], pin.ARG1)
        return tree if self.beams is None else BlockMatrix(tree, ())

    def kinematic(self, q: np.ndarray) -> np.ndarray:
        """The configuration of `model` that belongs to q of tree and beams."""
        return q if self.beams is None else self.beams.place(q, np.zeros(self.nv), np.zeros(self.nv))[0]

    def directions(self, parts: Sequence[KinematicRows]) -> np.ndarray:
        """The stacked rows W of all parts in the coordinates of the system, shape (rows, nv)."""
        return self.coordinate_rows(stacked([part.W for part in parts]))

    def coordinate_rows(self, W: np.ndarray) -> np.ndarray:
        """Rows in the coordinates of the system from rows in those of `model`, shape (rows, nv)."""
        return W if self.beams is None else self.beams.rows(W)

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """M(q), all entries, shape (nv, nv)."""
        model = self.model if self.beams is None else self.tree
        tree = pin.crba(model, self._tree_data, q[: model.nq], pin.Convention.WORLD)
        tree = np.triu(tree) + np.triu(tree, 1).T
        return tree if self.beams is None else BlockMatrix(tree, self.beams.M).toarray()

    def row_derivatives(
        self, parts: Sequence[KinematicRows], v: np.ndarray, a: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the rates of all parts by q and of their accelerations by v, each of shape (rows, nv)."""
        motion = self.motion(v, a)
        X, Y = (stacked(list(blocks)) for blocks in zip(*(part.derivatives(motion) for part in parts), strict=True))
        if self.beams is None:
            return X, Y
        return self.beams.row_derivatives(stacked([part.W for part in parts]), X, Y)

    def rounding(self, q: np.ndarray, dynamics: Dynamics, actuation: Actuation = NO_ACTUATION) -> np.ndarray | float:
        """Size of the forces whose rounding is felt in the residual, a number or shape (nv,) [N]."""
        if not isinstance(dynamics.K, BlockMatrix):
            return abs(dynamics.K) @ self.span(q) if self.loaded(actuation) else 0.0
        if self.beams is None:
            return 0.0
        return np.concatenate((np.zeros(self._nv_tree), self.beams.rounding(q, dynamics.K.bands)))

    def span(self, q: np.ndarray) -> np.ndarray:
        """Size of the positions of each coordinate, whose rounding stiff springs feel, shape (nv,) [m or rad]."""
        lengths = max(self.contacts.length, float(np.abs(q[self._lengths]).max(initial=0.0)))
        angles = max(1.0, float(np.abs(q[self._angles]).max(initial=0.0)))
        return np.where(self._slides, lengths, angles)

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
            sizes = self.joint_friction.f, self.constraints.kb, self.constraints.mb
            found = self._layouts[sub] = Layout(sub, *sizes)
        return found

    def place(self, q: np.ndarray) -> None:
        """Move the bodies to q, for `gaps` alone."""
        pin.forwardKinematics(self.model, self.data, self.kinematic(q))

    @property
    def moves_by_pairs(self) -> bool:
        """The bound of `gap_motion` looks at every pair of bodies: they may all be near, or far from each other."""
        return self.beams is None and (self.slots.n > 0 or self.many_trees)

    def gap_motion(self, dq: np.ndarray) -> float:
        """Bound of the change of any gap along a tangent step [m]; the kernel sums points of few trees in its order."""
        return self.contacts.motion(dq) if self.moves_by_pairs else float(np.cumsum(abs(dq) * self.contacts.reach)[-1])

    def gaps(self, sub: Subset, q: np.ndarray) -> np.ndarray:
        """g_N of a subset at q, after `dynamics` or `place` there, shape (k,) [m or rad]."""
        return self.gaps_and_normals(sub, q)[0]

    def gaps_and_normals(self, sub: Subset, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Likewise, with the normals of its points in the world, shape (n_points, 3)."""
        if kernel.library is None or self.beams is not None or sub.k > PLACED:
            rows = self.rows_of_gaps(sub, q)
            return rows.g_N, (rows.points if isinstance(rows, LimitedRows) else rows).normals
        g_N, normals = kernel.gaps(self, sub.points)
        return g_N if sub.points is sub else np.concatenate((g_N, other_gaps(sub, q, self.unilaterals))), normals

    def contact_rows(self, sub: Subset, q: np.ndarray, v: np.ndarray, a: np.ndarray, t: float = np.nan) -> ContactRows:
        """Kinematic rows of a subset after `dynamics` at the same t, q, v and a; t is for surfaces that move."""
        return self.rows_of_gaps(sub, q).move(self.motion(v, a, t))

    def constraint_rows(self, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> ConstraintRows:
        """Kinematic rows of the constraints after `dynamics` at the same t, q, v and a."""
        q = q if self.beams is None else self._placed[0]
        return self.constraints.rows(Bodies(t, q, self._rotations, self._translations, self.motion(v, a)))

    def motion(self, v: np.ndarray, a: np.ndarray, t: float = np.nan) -> Motion:
        """What `Rows` needs of the last call of `dynamics`."""
        if self.beams is not None:
            _, v, a = self._placed
        return Motion(self._J, self._dJ, self._dAdv, v, a, t)

    def contact_rates(self, sub: Subset, q: np.ndarray, v: np.ndarray, t: float = np.nan) -> np.ndarray:
        """g_N_dot and gamma_F of a subset at (q, v), shape (k + m,) [m/s]."""
        return self.contact_rows_at(sub, q, v, t).rate

    def contact_rows_at(self, sub: Subset, q: np.ndarray, v: np.ndarray, t: float = np.nan) -> Any:
        """Kinematic rows of a subset at (q, v), without accelerations."""
        a = np.zeros_like(v)
        self._placed = (q, v, a) if self.beams is None else self.beams.place(q, v, a)
        pin.computeJointJacobiansTimeVariation(self.model, self.data, self._placed[0], self._placed[1])
        return rows_at(self, sub, q, v, a, t)

    def place_moving(self, q: np.ndarray, v: np.ndarray) -> None:
        """Move the bodies to q, with their velocities."""
        if self.beams is not None:
            q, v, _ = self.beams.place(q, v, np.zeros_like(v))
        pin.forwardKinematics(self.model, self.data, q, v)

    def potential_energy(self, q: np.ndarray) -> float:
        """Of gravity, and of dead loads on beams, after `dynamics` at q [J]."""
        if self.beams is None:
            return float(pin.computePotentialEnergy(self.model, self.data))
        tree = float(pin.computePotentialEnergy(self.tree, self._tree_data, q[: self._nq_tree]))
        return tree + self.beams.energy(q, np.zeros(self.nv))[1]

    def rows_of_gaps(self, sub: Subset, q: np.ndarray) -> ContactRows:
        """Like `gaps`, with the normals."""
        rows = self.point_rows(sub.points)
        return rows if sub.points is sub else LimitedRows(sub, rows, q, self.unilaterals)

    def point_rows(self, sub: Subset) -> Rows | FeatureRows | StackedRows:
        """Rows of a subset without limits, where the last call of `dynamics` or `place` has put the bodies."""
        if len(sub.slots) == 0:
            return self._fixed_rows(sub)
        if sub.k_fixed == 0:
            return self._feature_rows(sub)
        return StackedRows(sub, self._fixed_rows(sub.parts[0]), self._feature_rows(sub.parts[1]))

    def _fixed_rows(self, sub: Subset) -> Rows:
        return Rows(sub, [self._rotations[j] for j in sub.bodies], [self._translations[j] for j in sub.bodies])

    def _feature_rows(self, sub: Subset) -> FeatureRows:
        R, p = (np.array([poses[j] for j in sub.bodies]) for poses in (self._rotations, self._translations))
        return FeatureRows(sub, self.slots.packed[sub.slots], R, p)
