"""Kinematics to second order of points, contacts (148)-(157) and constraints (153), one after the other.

Every quantity is written as in a textbook on rigid bodies, from positions, velocities and accelerations of points and
from angular velocities; nothing is shared with the arrays of the rest of the package.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.oracle.problem import Contact, Driven, Joined, Place, Problem, Turned

MOVABLE = 1e-9  # largest entry of a row that no motion changes, in parts of that of its contact or constraint


class FrameMotion(NamedTuple):
    """Motion of a frame of a body, in the axes of the world.

    Attributes:
        r, v, a: position, velocity and acceleration of its origin, shape (3,) each.
        R: its axes as columns, shape (3, 3).
        omega, omega_dot: angular velocity of the body and its rate, shape (3,) each.
        J, J_omega: v = J u and omega = J_omega u, shape (3, nv) each.
    """

    r: np.ndarray
    v: np.ndarray
    a: np.ndarray
    R: np.ndarray
    omega: np.ndarray
    omega_dot: np.ndarray
    J: np.ndarray
    J_omega: np.ndarray

    def moved_to(self, pose: pin.SE3) -> FrameMotion:
        """Motion of another frame of the same body, whose pose is given in this one."""
        arm, w = self.R @ pose.translation, self.omega
        return self._replace(
            r=self.r + arm,
            v=self.v + cross(w, arm),
            a=self.a + cross(self.omega_dot, arm) + cross(w, cross(w, arm)),
            R=self.R @ pose.rotation,
            J=self.J - pin.skew(arm) @ self.J_omega,
        )


class ContactKinematics(NamedTuple):
    """One contact at one motion.

    Attributes:
        g_N, g_N_dot, g_N_ddot: gap (37), its rate (42) and its acceleration (58) [m], [m/s], [m/s^2].
        gamma_F, gamma_F_dot: friction velocity and its rate (119), shape (n_F,).
        W_N: (38), shape (nv,).
        W_F: (46), shape (nv, n_F).
    """

    g_N: float
    g_N_dot: float
    g_N_ddot: float
    gamma_F: np.ndarray
    gamma_F_dot: np.ndarray
    W_N: np.ndarray
    W_F: np.ndarray


class ConstraintKinematics(NamedTuple):
    """Bilateral constraints at one motion.

    Attributes:
        g, g_dot, g_ddot: (33), (54) and (55), shape (n_g,) each.
        W_g: (34), shape (nv, n_g).
    """

    g: np.ndarray
    g_dot: np.ndarray
    g_ddot: np.ndarray
    W_g: np.ndarray


class Motion:
    """A problem at one position, velocity and acceleration: its equations of motion, and the motion of its frames.

    Args:
        problem: the problem.
        t: time [s].
        q: configuration, shape (nq,).
        v: velocity, the paper's u, shape (nv,).
        a: acceleration, shape (nv,).

    Attributes:
        M: mass matrix (32), shape (nv, nv).
        h: all forces (50) but those of constraints and contacts, shape (nv,).
        contacts: of every contact.
        constraints: of all bilateral constraints.
    """

    def __init__(self, problem: Problem, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray):
        self.problem, self.t, self.q, self.v, self.a = problem, t, q, v, a
        model, nv = problem.scene.model, problem.scene.model.nv
        self._data = data = model.createData()
        tree = q[: model.nq], v[:nv], a[:nv]
        self.M, self.h = np.zeros((problem.nv, problem.nv)), forces(problem, q, v, data)
        upper = np.triu(pin.crba(model, data, tree[0]))
        self.M[:nv, :nv] = upper + np.triu(upper, 1).T
        for b in problem.beams.values():
            self.M[b.v, b.v] = b.M
        pin.forwardKinematics(model, data, *tree)
        pin.computeJointJacobians(model, data, tree[0])
        self.contacts = [self.contact(contact) for contact in problem.contacts]
        self.constraints = self._constraints()

    def frame(self, place: Place) -> FrameMotion:
        """Motion of a frame."""
        return self._on_body(place) if place.beam is None else self._on_beam(place)

    def _on_body(self, place: Place) -> FrameMotion:
        """A frame of a body of the tree."""
        model, data, joint = self.problem.scene.model, self._data, place.joint
        R, V, A = data.oMi[joint].rotation, data.v[joint], data.a[joint]  # twists in the axes of the joint
        J = np.zeros((6, self.problem.nv))
        if joint:
            J[:, : model.nv] = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
        a = R @ (A.linear + cross(V.angular, V.linear))
        origin = FrameMotion(
            data.oMi[joint].translation, R @ V.linear, a, R, R @ V.angular, R @ A.angular, J[:3], J[3:]
        )
        return origin.moved_to(place.pose)

    def _on_beam(self, place: Place) -> FrameMotion:
        """A frame of a cross section: r_OC is linear in q_b, and the section turns with the tangent t = r'_OC."""
        assert place.beam is not None and place.N is not None and place.dN is not None
        b = self.problem.beams[place.beam]
        q_b, v_b, a_b = self.q[b.q], self.v[b.v], self.a[b.v]
        t, t_dot, t_ddot = place.dN @ q_b, place.dN @ v_b, place.dN @ a_b
        across = np.array([-t[1], t[0]]) / (t @ t)  # theta_dot = across . t_dot
        theta_dot = across @ t_dot
        theta_ddot = across @ t_ddot - 2.0 * theta_dot * (t @ t_dot) / (t @ t)
        plane, e_z = b.beam.plane.rotation[:, :2], b.beam.plane.rotation[:, 2]
        e_x = plane @ t / np.sqrt(t @ t)
        J, J_omega = np.zeros((3, self.problem.nv)), np.zeros((3, self.problem.nv))
        J[:, b.v], J_omega[:, b.v] = plane @ place.N, np.outer(e_z, across @ place.dN)
        R = np.stack((e_x, cross(e_z, e_x), e_z), axis=1)
        r, a = plane @ (place.N @ q_b) + b.beam.plane.translation, plane @ (place.N @ a_b)
        return FrameMotion(r, J @ self.v, a, R, theta_dot * e_z, theta_ddot * e_z, J, J_omega).moved_to(place.pose)

    def contact(self, contact: Contact) -> ContactKinematics:
        """One contact: sphere on plane (148), (149), (152), (154), (156), (157), in a hollow cylinder (150), (151)."""
        m, radius = self.frame(contact.centre), contact.radius
        arm = m.r - contact.origin
        if contact.normal is not None:  # plane: distance of the centre minus the radius
            n, n_dot = contact.normal, np.zeros(3)
            g_N = float(n @ arm) - radius  # (156)
            t_1 = _tangent(n)
        else:  # cylinder: n from the centre of the sphere to the axis, against the arm
            assert contact.axis is not None
            across = np.eye(3) - np.outer(contact.axis, contact.axis)
            rho = np.sqrt(arm @ across @ arm)
            g_N = contact.surface_radius - radius - rho  # (150)
            n = -across @ arm / rho
            n_dot = -(across - np.outer(n, n)) @ m.v / rho
            t_1 = cross(contact.axis, n)  # (151)
        t = np.stack((t_1, cross(n, t_1)))
        g_N_dot = float(n @ m.v)
        g_N_ddot = float(n @ m.a + n_dot @ m.v)
        v_P = m.v - radius * cross(m.omega, n)  # (157)
        v_P_dot = m.a - radius * (cross(m.omega_dot, n) + cross(m.omega, n_dot))
        # tangents are carried along in parallel: t_dot = -(t . n_dot) n
        gamma = np.append(t @ v_P, contact.law.drilling * (n @ m.omega))  # (157)
        gamma_dot = np.append(
            t @ v_P_dot - (t @ n_dot) * (n @ v_P), contact.law.drilling * (n @ m.omega_dot + n_dot @ m.omega)
        )
        J_P = m.J + radius * pin.skew(n) @ m.J_omega
        W_F = np.concatenate((t @ J_P, contact.law.drilling * (n @ m.J_omega)[None])).T
        rows = list(contact.rows)
        return ContactKinematics(g_N, g_N_dot, g_N_ddot, gamma[rows], gamma_dot[rows], m.J.T @ n, W_F[:, rows])

    def _constraints(self) -> ConstraintKinematics:
        """All bilateral constraints, without the rows that no motion changes."""
        parts = [self._constraint(constraint) for constraint in self.problem.constraints]
        if not parts:
            nothing = np.zeros(0)
            return ConstraintKinematics(nothing, nothing, nothing, np.zeros((self.problem.nv, 0)))
        g, g_dot, g_ddot, W = (np.concatenate(x, axis=-1) for x in zip(*parts, strict=True))
        rows = list(self.problem.rows)
        return ConstraintKinematics(g[rows], g_dot[rows], g_ddot[rows], W[:, rows])

    def _constraint(self, constraint: Joined | Turned | Driven) -> tuple[np.ndarray, ...]:
        """G, g_dot, g_ddot and W_g of one constraint (153)."""
        if isinstance(constraint, Driven):
            angle, rate, acceleration = constraint.angle(self.t)
            i, dof = constraint.q, constraint.dof
            now = np.arctan2(self.q[i + 1], self.q[i]) if constraint.turns else self.q[i]
            W = np.zeros((self.problem.nv, 1))
            W[dof] = 1.0
            g = _wrapped(now - angle) if constraint.turns else now - angle
            return np.array([g]), self.v[[dof]] - rate, self.a[[dof]] - acceleration, W
        a, b = self.frame(constraint.a), self.frame(constraint.b)
        if isinstance(constraint, Joined):  # d = r_OK - r_OC(0)
            return a.r - b.r, a.v - b.v, a.a - b.a, (a.J - b.J).T
        angle, rate, acceleration = constraint.angle(self.t)
        x = a.R.T @ b.R[:, 0]  # the x-axis of b in the axes of a
        e = a.R[:, 2]  # the same axis in both, which the mechanism does not turn
        g = _wrapped(np.arctan2(x[1], x[0]) - angle)
        g_dot = e @ (b.omega - a.omega) - rate
        g_ddot = e @ (b.omega_dot - a.omega_dot) - acceleration
        W = ((b.J_omega - a.J_omega).T @ e)[:, None]
        return np.array([g]), np.array([g_dot]), np.array([g_ddot]), W


def forces(problem: Problem, q: np.ndarray, v: np.ndarray, data: pin.Data | None = None) -> np.ndarray:
    """H (50): gravity, gyroscopic forces, dampers and the elastic forces of beams, shape (nv,)."""
    model, h = problem.scene.model, np.zeros(problem.nv)
    data = model.createData() if data is None else data
    h[: model.nv] = -pin.nonLinearEffects(model, data, q[: model.nq], v[: model.nv])
    if problem.scene.joints.damping:
        h[: model.nv] -= model.damping * v[: model.nv]
    for b in problem.beams.values():
        h[b.v] = b.weight - b.beam.internal_forces(q[b.q], v[b.v]).f
    return h


def movable(problem: Problem) -> Problem:
    """The problem without the rows of friction and of constraints that no motion changes, as across a plane of motion.

    They would be zero rows of the Jacobian. What moves is found at random configurations.
    """
    three = tuple(replace(contact, rows=(0, 1, 2)) for contact in problem.contacts)
    n_g = sum(3 if isinstance(constraint, Joined) else 1 for constraint in problem.constraints)
    whole = replace(problem, contacts=three, rows=tuple(range(n_g)))
    rng, still = np.random.default_rng(0), np.zeros(problem.nv)
    size = np.where(np.arange(problem.nv) < problem.scene.model.nv, 1.0, 1e-2)  # beams keep about their shape
    W_F, W_g = np.zeros((problem.n_N, 3)), np.zeros(n_g)
    for _ in range(4):
        motion = Motion(whole, 0.0, whole.moved(problem.scene.q_ref, size * rng.normal(size=problem.nv)), still, still)
        for k, now in enumerate(motion.contacts):
            W_F[k] = np.maximum(W_F[k], np.abs(now.W_F).max(axis=0))
        W_g = np.maximum(W_g, np.abs(motion.constraints.W_g).max(axis=0, initial=0.0))
    contacts = []
    for contact, largest in zip(problem.contacts, W_F, strict=True):
        moves = (largest > MOVABLE * largest.max()) & (contact.law.mu > 0.0)
        contacts.append(replace(contact, rows=tuple(np.flatnonzero(moves).tolist())))
    return replace(problem, contacts=tuple(contacts), rows=tuple(np.flatnonzero(W_g > MOVABLE).tolist()))


def _tangent(n: np.ndarray) -> np.ndarray:
    """A unit vector across n: e_x without its part along n, for a horizontal plane e_x itself (157)."""
    e = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.9 else np.array([0.0, 0.0, 1.0])
    t = e - (e @ n) * n
    return t / np.linalg.norm(t)


def cross(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The cross product of two vectors."""
    return pin.skew(x) @ y


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
