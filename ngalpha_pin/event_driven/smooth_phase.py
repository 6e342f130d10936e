"""Motion between two changes of contact as an ordinary differential equation, for integrators of high order.

While the closed contacts stay closed and each of them goes on to stick or to slip, the laws of force are equations: the
acceleration of a closed gap, of a sticking contact, of a stuck joint and of a constraint vanishes, and the friction of
a slipping contact is tied to its normal force (120). What ends such a phase is a sign: of the gap of an open contact,
the normal force of a closed one, the slip along its direction at the start, the distance of a sticking force from its
cone; and the same for dry friction in joints.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dgesv, dpotrf, dpotrs

from ngalpha_pin.contact.point_rows import KinematicRows
from ngalpha_pin.errors import NotConverged
from ngalpha_pin.linalg.block_matrix import Matrix, dense, solve_positive
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

# a sticking force this close to its cone slips, a contact force this small, relative to the largest, is none
EDGE, NO_FORCE = 1e-9, 1e-9
# difference between two ways to find the forces of a start, relative to the largest, that is none
AGREE = 1e-6
# singular values of the scaled contact matrix below this are zero
DEPENDENT = 1e-9


# rate of a constraint that no motion fulfils together with the others, in parts of the velocities in it
CONTRADICTS = 1e-6
NOTHING = np.zeros(0)


class Forces(NamedTuple):
    """Accelerations and forces at one motion.

    Attributes:
        a: acceleration, shape (nv,).
        la: contact forces, normal ones first, shape (k + m,) [N].
        tau_f: torques of joint friction, shape (f,).
        la_b: forces of the constraints, shape (b,).
        gamma_F: slip velocities, shape (m,) [m/s].
    """

    a: np.ndarray
    la: np.ndarray
    tau_f: np.ndarray
    la_b: np.ndarray
    gamma_F: np.ndarray


class SmoothPhase:
    """The equation of motion from a consistent state on, y = (q, v, integrals of la and tau_f).

    Args:
        system: compiled scene.
        state: its start, with consistent forces (see `initial.consistent_state`).
        speed: slip below this counts as none [m/s].
        force: size of contact forces in this run [N].

    Attributes:
        sub: the closed contacts.
        slips: which of them slip, shape (k,).
        n_evaluations: calls of the equations of motion.
    """

    def __init__(self, system: System, state: State, speed: float, force: float):
        self.system, self.n_evaluations = system, 0
        table = system.contacts
        carries = state.la_N > NO_FORCE * force
        self.sub = sub = table.subset(state.contacts[carries])
        self.nq, self.nv, k, o = system.nq, system.nv, sub.k, sub.of_F
        la_N = state.la_N[carries]
        la_F = state.la_F[carries[table.subset(state.contacts).of_F]]
        self._speed, self._force = speed, force
        friction = system.joint_friction
        tau_f = state.tau_f if len(state.tau_f) else np.zeros(friction.f)
        lower, upper = friction.bounds
        rate = state.v[friction.dofs]
        moving = (np.abs(rate) > speed) | (tau_f <= lower * (1 - EDGE)) | (tau_f >= upper * (1 - EDGE))
        self.stuck = ~moving
        self.turning = np.where(np.abs(rate) > speed, np.sign(rate), -np.sign(tau_f)) * moving
        self.slips, self.direction = np.zeros(k, dtype=bool), np.zeros(sub.m)
        if sub.m:
            system.dynamics(state.t, state.q, state.v, state.a)
            rows = system.contact_rows(sub, state.q, state.v, state.a)
            gamma_F = rows.rate[k:]
            fast = np.sqrt(np.bincount(o, gamma_F**2, k)) > speed
            on_edge = np.sqrt(np.bincount(o, la_F**2, k)) >= sub.mu * la_N * (1 - EDGE)
            self.slips = (fast | on_edge) & (np.bincount(o, minlength=k) > 0)
            # slip that begins is against the force: its acceleration can be nothing but rounding
            self.direction = sub.unit(np.where(fast[o], gamma_F, -la_F))[0]
            self._just_starting = np.where((self.slips & ~fast)[o], speed, 0.0)
            self._planar = np.bincount(o, minlength=k) == 1
        self._layout = system.layout(sub)
        stick = ~self.slips[o]
        first_b = self._layout.constraints.start
        self._free = np.concatenate(
            (np.arange(k), k + np.flatnonzero(stick), k + sub.m + np.flatnonzero(self.stuck),
             np.arange(first_b, self._layout.rows))
        )  # fmt: skip
        self._tied = np.flatnonzero(~stick)
        self._dependent = False
        if len(self._free):
            self._dependent = self._is_dependent(state)

    def start(self, state: State) -> np.ndarray:
        """The vector y of a state."""
        return np.concatenate((state.q, state.v, np.zeros(self.sub.k + self.sub.m + len(self.stuck))))

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        """dy/dt."""
        q, v = self.split(y)
        self.last = forces = self.forces(t, q, v)
        q_dot = v if self.system.flat else pin.tangentMap(self.system.model, q) @ v
        return np.concatenate((q_dot, forces.a, forces.la, forces.tau_f))

    def split(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Q and v of y, q with unit quaternions."""
        q = y[: self.nq]
        return q if self.system.flat else pin.normalize(self.system.model, q), y[self.nq : self.nq + self.nv]

    def forces(self, t: float, q: np.ndarray, v: np.ndarray) -> Forces:
        """Accelerations and forces at a motion, of the contacts as they are in this phase."""
        self.n_evaluations += 1
        system, sub, k = self.system, self.sub, self.sub.k
        still = np.zeros(self.nv)
        dynamics = system.dynamics(t, q, v, still)
        factor = dpotrf(dense(dynamics.M), lower=0)[0]
        a = -dpotrs(factor, dynamics.residual, lower=0)[0]
        W, bias, gamma_F = self._rows(t, q, v)
        if not len(W):
            return Forces(a, NOTHING, NOTHING, NOTHING, gamma_F)
        C = np.zeros((len(W), len(self._free)))
        C[self._free, np.arange(len(self._free))] = 1.0
        known = np.zeros(len(W))
        if len(self._tied):
            unit = sub.unit(gamma_F + self._just_starting * self.direction)[0]
            unit = np.where(self._planar[sub.of_F], self.direction, unit)
            C[k + self._tied, sub.of_F[self._tied]] = -(sub.mu_F * unit)[self._tied]  # (120)
        moving, j = np.flatnonzero(~self.stuck), k + sub.m
        if len(moving):
            friction = system.joint_friction
            known[j + moving] = np.where(self.turning > 0, friction.lower, friction.upper)[moving]
        by_M = dpotrs(factor, np.ascontiguousarray(W.T), lower=0)[0]
        self._turns = W[k + self._tied], by_M[:, k + self._tied]
        a = a + by_M @ known
        b = -(W[self._free] @ a + bias[self._free])
        la = known + C @ self._solve(W[self._free] @ (by_M @ C), b)
        la_b = la[self._layout.constraints]
        return Forces(a + by_M @ (la - known), la[:j], la[self._layout.friction], la_b, gamma_F)

    def turning_rate(self) -> float:
        """The largest rate at which a slip in space turns into the direction of its friction, at `last` [1/s]."""
        if not len(self._tied) or self._planar[self.sub.of_F[self._tied]].all():
            return 0.0
        of = self.sub.of_F[self._tied]
        compliance = np.einsum("ij,ji->i", *self._turns)
        gamma_F = self.last.gamma_F + self._just_starting * self.direction
        speed = np.sqrt(np.bincount(self.sub.of_F, gamma_F**2, self.sub.k))
        rates = (self.sub.mu_F * self.last.la[self.sub.of_F])[self._tied] * compliance / speed[of]
        return float(rates[~self._planar[of]].max())

    def agrees(self, state: State, forces: Forces) -> bool:
        """Whether the forces of the start are those of this phase: else the contact problem there has no solution.

        Slip with much friction can be such a catastrophe.
        """
        scale = max(self._force, float(np.abs(forces.la).max(initial=0.0)))
        k = self.sub.k
        found = np.zeros(self.system.contacts.n)
        found[state.contacts] = state.la_N
        found[self.sub.index] -= forces.la[:k]
        positive = not k or float(forces.la[:k].min()) > 0.0
        return bool(np.isfinite(forces.a).all() and positive and np.abs(found).max(initial=0.0) <= AGREE * scale)

    def _rows(self, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """W, accelerations without a, and slip velocities, after `dynamics`."""
        system, sub, layout, still = self.system, self.sub, self._layout, np.zeros(self.nv)
        parts: list[KinematicRows] = [system.contact_rows(sub, q, v, still)] if sub.k else []
        gamma_F = parts[0].rate[sub.k :] if sub.m else np.zeros(0)
        parts += [system.joint_friction.rows(v, still)] if layout.f else []
        parts += [system.constraint_rows(t, q, v, still)] if layout.kb + layout.mb else []
        if not parts:
            return np.zeros((0, self.nv)), np.zeros(0), gamma_F
        return system.directions(parts), np.concatenate([part.acceleration for part in parts]), gamma_F

    def _solve(self, G: np.ndarray, b: np.ndarray) -> np.ndarray:
        if not np.isfinite(G).all():  # a step far too long: the integrator rejects it
            return np.full_like(b, np.nan)
        if not self._dependent:
            return dgesv(G, b)[2]
        root = np.sqrt(np.maximum(np.abs(G.diagonal()), 1e-300))
        return np.linalg.lstsq(G / np.outer(root, root), b / root, rcond=DEPENDENT)[0] / root

    def _is_dependent(self, state: State) -> bool:
        dynamics = self.system.dynamics(state.t, state.q, state.v, np.zeros(self.nv))
        M = dynamics.M.copy()
        W = self._rows(state.t, state.q, state.v)[0][self._free]
        G = W @ solve_positive(M, W.T)
        root = np.sqrt(np.maximum(G.diagonal(), 1e-300))
        values = np.linalg.svd(G / np.outer(root, root), compute_uv=False)
        return bool(values[-1] <= DEPENDENT * values[0])

    def signs(self, forces: Forces, v: np.ndarray) -> np.ndarray:
        """What is positive as long as the phase lasts: normal force, cone or slip, joint torque or rate, shape (s,)."""
        sub, k, o = self.sub, self.sub.k, self.sub.of_F
        la_N, la_F = forces.la[:k], forces.la[k:]
        cone = sub.mu * la_N - np.sqrt(np.bincount(o, la_F**2, k))
        along = np.bincount(o, forces.gamma_F * self.direction, k)
        speed = np.sqrt(np.bincount(o, forces.gamma_F**2, k))
        # the slip of a body in space ends where it becomes small, it need not vanish exactly
        slip = along if not sub.m else np.where(self._planar, along, speed - self._speed)
        with_friction = np.bincount(o, minlength=k) > 0
        held = np.where(self.slips, slip, np.where(with_friction, cone, 1.0))
        friction = self.system.joint_friction
        inside = np.minimum(forces.tau_f - friction.lower, friction.upper - forces.tau_f)
        return np.concatenate((la_N, held, np.where(self.stuck, inside, self.turning * v[friction.dofs])))

    def state(self, t: float, q: np.ndarray, v: np.ndarray) -> State:
        """The state at a motion of this phase."""
        forces, k, m = self.forces(t, q, v), self.sub.k, self.sub.m
        zero_N, zero_F = np.zeros(k), np.zeros(m)
        return State(
            t, q, v, forces.a, self.sub.index, forces.la[:k], forces.la[k:], zero_N, zero_F, zero_N, zero_F,
            forces.tau_f, np.zeros(len(forces.tau_f)), forces.la_b, np.zeros(len(forces.la_b)),
        )  # fmt: skip

    def project(self, t: float, q: np.ndarray, v: np.ndarray, touching: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nearest motion, in kinetic energy, on the closed contacts and the constraints, on both levels.

        Args:
            t: time [s].
            q: configuration, shape (nq,).
            v: velocity, shape (nv,).
            touching: numbers of further contacts that close at this moment or penetrate; only their gap has to vanish.
        """
        system, layout = self.system, self._layout
        if not len(self._free) and not len(touching):
            return q, v
        still = np.zeros(self.nv)
        M = system.dynamics(t, q, v, still).M.copy()
        shut = system.contacts.subset(np.union1d(self.sub.index, touching))
        g, W = [], []
        if shut.k:
            rows = system.contact_rows(shut, q, v, still)
            g, W = [rows.g_N], [system.directions([rows])[: shut.k]]
        if layout.kb:
            constraints = system.constraint_rows(t, q, v, still)
            g, W = [*g, constraints.g], [*W, system.directions([constraints])[: layout.kb]]
        if g:
            q = system.integrate(q, smallest_change(M, np.concatenate(W), np.concatenate(g))[0])
            system.dynamics(t, q, v, still)
        if not len(self._free):
            return q, v
        W_all, _, _ = self._rows(t, q, v)
        rate, b = W_all[self._free] @ v, layout.kb + layout.mb
        if b == 0:
            return q, v + smallest_change(M, W_all[self._free], rate)[0]
        bilateral = system.constraint_rows(t, q, v, still)
        rate[-b:] = bilateral.rate
        change = smallest_change(M, W_all[self._free], rate)[0]
        left = np.abs(rate[-b:] + W_all[self._free][-b:] @ change)
        if left.max() > CONTRADICTS * max(bilateral.sizes[1], float(np.abs(bilateral.rate).max())):
            name = system.constraints.names[int(np.argmax(left))]
            raise NotConverged(
                f"the constraints contradict each other at t = {t:.6g} s: no motion fulfils {name!r} with the others, "
                f"its rate is off by {left.max():.2g} /s",
                t,
            )
        return q, v + change


def smallest_change(M: Matrix, W: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The smallest x in the norm of M with W x = -error, and the P with M x = W^T P; W may have dependent rows."""
    by_M = solve_positive(M, W.T)
    G = W @ by_M
    root = np.sqrt(np.maximum(G.diagonal(), 1e-300))
    P = np.linalg.lstsq(G / np.outer(root, root), -error / root, rcond=DEPENDENT)[0] / root
    return by_M @ P, P
