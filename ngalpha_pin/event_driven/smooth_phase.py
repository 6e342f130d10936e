"""Motion between two changes of contact as an ordinary differential equation, for integrators of high order.

While the closed contacts stay closed and each of them goes on to stick or to slip, the laws of force are equations: the
acceleration of a closed gap, of a sticking contact, of a stuck joint and of a constraint vanishes, and the friction of
a slipping contact is tied to its normal force (120); rolling against a resistance is one more slip. What ends such a
phase is a sign: of the gap of an open contact, the normal force of a closed one, the slip along its direction at the
start, the distance of a sticking force from its cone; and the same for dry friction in joints.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dgesv, dpotrf, dpotrs

from ngalpha_pin.common.tolerances import ASSEMBLED, NO_FORCE
from ngalpha_pin.contact.point_rows import KinematicRows
from ngalpha_pin.errors import NotConverged
from ngalpha_pin.event_driven.phase_start import forces_of, slipping, turning
from ngalpha_pin.event_driven.settling import smallest_change
from ngalpha_pin.event_driven.soft_contacts import SoftContacts, pressing
from ngalpha_pin.numerics.block_matrix import dense, solve_positive
from ngalpha_pin.numerics.nearest_forces import nearest_forces, spanned_forces
from ngalpha_pin.system.contact_search import contact_speed
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

# difference between two ways to find the forces of a start, relative to the largest, that is none
AGREE = 1e-6

# the margin of `Forces` below this is none; what is located there may be so many times as far from it
SINGULAR, NEARLY = 1e-6, 1e3

NOTHING, NO_CONTACTS = np.zeros(0), np.zeros(0, dtype=int)
# calls of a step of DOP853
CALLS = 12
# corrections that bring a motion onto its contacts: each leaves the square of what it corrects
PROJECTIONS = 3
# rate of a constraint that no motion fulfils together with the others, in parts of the velocities in it
CONTRADICTS = 1e-6


class Forces(NamedTuple):
    """Accelerations and forces at one motion.

    Attributes:
        a: acceleration, shape (nv,).
        la: contact forces, normal ones first, shape (k + m,) [N].
        tau_f: torques of joint friction, shape (f,).
        la_b: forces of the constraints, shape (b,).
        gamma_F: slip velocities, shape (m,) [m/s].
        margin: det of the contact matrix with friction by that without; slip has no unique forces where it vanishes.
        soft: signs of compliant contacts, see `SoftContacts`.
    """

    a: np.ndarray
    la: np.ndarray
    tau_f: np.ndarray
    la_b: np.ndarray
    gamma_F: np.ndarray
    margin: float = 1.0
    soft: np.ndarray = NOTHING


class SmoothPhase:
    """The equation of motion from a consistent state on, y = (q, v, integrals of la and tau_f).

    Args:
        system: compiled scene.
        state: its start, with consistent forces (see `initial.consistent_state`).
        speed: slip below this counts as none [m/s].
        force: size of contact forces in this run [N].
        span: times between which what is given is that of this phase [s].
        clings: numbers of contacts that stay closed though they carry no force at the start.

    Attributes:
        sub: the closed contacts.
        slips: which of their cones slip, or roll, shape (c,).
        n_evaluations: calls of the equations of motion.
        calls: times, velocities and forces of the last calls of `rate`: the stages of a step of DOP853 and its end.
    """

    def __init__(
        self, system: System, state: State, speed: float, force: float, span: tuple[float, float],
        clings: np.ndarray = NO_CONTACTS,
    ):  # fmt: skip
        self.system, self.n_evaluations, self._span = system, 0, span
        self.calls: deque[tuple[float, np.ndarray, Forces]] = deque(maxlen=CALLS)
        self._actuation, self._sampled, self._holding = state.actuation, state.sampled, state.holding
        table = system.contacts
        carries = state.contacts[state.la_N > NO_FORCE * force]
        carries = carries[~table.soft[carries]]
        self.sub = sub = table.subset(np.union1d(np.union1d(carries, clings), pressing(system, state)))
        self.soft = SoftContacts(sub, system, state)
        self.nq, self.nv, k, cones = system.nq, system.nv, sub.k, sub.cones
        self._cone, self._of = o, of = cones.of_row, cones.contact
        self._idle = self.soft.idle[of]
        la_N, la_F = forces_of(system, state, sub)
        self._carries = np.isin(sub.index, carries)
        self._speed, self._force = speed, force
        tau_f = state.tau_f if len(state.tau_f) else np.zeros(system.joint_friction.f)
        self.stuck, self.turning = turning(system, state.v, tau_f)
        self.slips, self.direction = np.zeros(cones.c, dtype=bool), np.zeros(sub.m)
        if sub.m:
            self.slips, self.direction, begins = slipping(
                system, self._given_at(state.t), state, sub, la_N, la_F, self._idle
            )
            self._just_starting = np.where(begins[o], speed, 0.0)
            self._planar = cones.rows == 1
        self._layout = system.layout(sub)
        stick = ~self.slips[o]
        first_b = self._layout.constraints.start
        self._free = np.concatenate(
            (np.arange(k), k + np.flatnonzero(stick), k + sub.m + np.flatnonzero(self.stuck),
             np.arange(first_b, self._layout.rows))
        )  # fmt: skip
        self._tied = np.flatnonzero(~stick)
        la_b = state.la_b if len(state.la_b) else np.zeros(self._layout.rows - first_b)
        self._start = np.concatenate((la_N, la_F[stick], tau_f[self.stuck], la_b))
        self._dependent = len(self._free) > len(self.soft.at) and self._is_dependent(state)

    def _given_at(self, t: float) -> float:
        """The time at which what is given is that of this phase: at both ends of it only one side is [s]."""
        return min(max(t, self._span[0]), self._span[1])

    def start(self, state: State) -> np.ndarray:
        """The vector y of a state."""
        return np.concatenate((state.q, state.v, np.zeros(self.sub.k + self.sub.m + len(self.stuck))))

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        """dy/dt."""
        q, v = self.split(y)
        self.last = forces = self.forces(t, q, v)
        self.calls.append((t, v, forces))
        q_dot = v
        if not self.system.flat:  # coordinates of beams, behind those of the tree, are plain numbers
            tree = self.system.tree
            q_dot = np.concatenate((pin.tangentMap(tree, q[: tree.nq]) @ v[: tree.nv], v[tree.nv :]))
        return np.concatenate((q_dot, forces.a, forces.la, forces.tau_f))

    def split(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Q and v of y, q with unit quaternions."""
        q = y[: self.nq]
        if not self.system.flat:
            tree = self.system.tree
            q = np.concatenate((pin.normalize(tree, q[: tree.nq]), q[tree.nq :]))
        return q, y[self.nq : self.nq + self.nv]

    def forces(self, t: float, q: np.ndarray, v: np.ndarray) -> Forces:
        """Accelerations and forces at a motion, of the contacts as they are in this phase."""
        self.n_evaluations += 1
        system, sub, k, t = self.system, self.sub, self.sub.k, self._given_at(t)
        still = np.zeros(self.nv)
        dynamics = system.dynamics(t, q, v, still, self._actuation)
        factor = dpotrf(dense(dynamics.M), lower=0)[0]
        a = -dpotrs(factor, dynamics.residual, lower=0)[0]
        W, bias, rates, g_N = self._rows(t, q, v)
        gamma_F = rates[k : k + sub.m]
        if not len(W):
            return Forces(a, NOTHING, NOTHING, NOTHING, gamma_F)
        C = np.zeros((len(W), len(self._free)))
        C[self._free, np.arange(len(self._free))] = 1.0
        known = np.zeros(len(W))
        if len(self._tied):
            unit = self._slip_directions(gamma_F)
            mu = sub.cones.coefficients(gamma_F)[0][self._cone]
            C[k + self._tied, sub.of_F[self._tied]] = -(mu * unit)[self._tied]  # (120)
        moving, j = np.flatnonzero(~self.stuck), k + sub.m
        if len(moving):
            friction = system.joint_friction
            known[j + moving] = np.where(self.turning > 0, friction.lower, friction.upper)[moving]
        by_M = dpotrs(factor, np.ascontiguousarray(W.T), lower=0)[0]
        self._turns = W[k + self._tied], by_M[:, k + self._tied]
        a = a + by_M @ known
        b = -(W[self._free] @ a + bias[self._free])
        by_rows = W[self._free] @ by_M
        signs = NOTHING
        if len(self.soft.at):  # their normal forces are known
            given, signs = self.soft.forces(g_N, rates[:k])
            by_rows[self.soft.at], b[self.soft.at] = np.eye(len(W))[self.soft.at], given
        la = known + C @ self._solve(by_rows, C, b)
        la_b = la[self._layout.constraints]
        margin = self._margin(by_rows, C) if len(self._tied) else 1.0
        return Forces(a + by_M @ (la - known), la[:j], la[self._layout.friction], la_b, gamma_F, margin, signs)

    def _slip_directions(self, gamma_F: np.ndarray) -> np.ndarray:
        """Directions against which friction acts, shape (m,).

        Beyond the end of a slip, up to which a step has to be smooth, they stay as before it: a slip that has turned
        back counts as one along its old direction.
        """
        cones = self.sub.cones
        unit = cones.unit(gamma_F + self._just_starting * self.direction)[0]
        back = cones.products(unit, self.direction) < 0.0
        unit = np.where(back[self._cone], -unit, unit)
        return np.where(self._planar[self._cone], self.direction, unit)

    def turn(self, forces: Forces) -> None:
        """Take the directions of slip in space from the end of a step, from which the next one goes on."""
        if self.slips.any():
            unit, speed = self.sub.cones.unit(forces.gamma_F)
            turns = ~self._planar[self._cone] & (speed > self._speed)
            self.direction = np.where(turns, unit, self.direction)

    @property
    def begins_stiff(self) -> bool:
        """Slip begins where friction differs by direction: it turns at once into a direction that friction leaves."""
        axes = self.sub.axes
        begins = self._just_starting.any() if self.sub.m else False
        return axes is not None and bool(begins)

    def turning_rate(self) -> float:
        """The largest rate at which a slip in space turns into the direction of its friction, at `last` [1/s]."""
        of, cones = self._cone[self._tied], self.sub.cones
        if not len(self._tied) or self._planar[of].all():
            return 0.0
        compliance = np.einsum("ij,ji->i", *self._turns)
        gamma_F = self.last.gamma_F + self._just_starting * self.direction
        speed = cones.sizes(gamma_F)
        rates = (cones.mu_F * self.last.la[self.sub.of_F])[self._tied] * compliance / speed[of]
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
        positive = bool((forces.la[:k][self._carries] > 0.0).all())
        return bool(np.isfinite(forces.a).all() and positive and np.abs(found).max(initial=0.0) <= AGREE * scale)

    def _rows(self, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """W, accelerations without a, and the rates of all rows, and gaps of the contacts, after `dynamics`."""
        system, sub, layout, still = self.system, self.sub, self._layout, np.zeros(self.nv)
        contacts = system.contact_rows(sub, q, v, still, t) if sub.k else None
        parts: list[KinematicRows] = [] if contacts is None else [contacts]
        parts += [system.joint_friction.rows(v, still)] if layout.f else []
        parts += [system.constraint_rows(t, q, v, still)] if layout.kb + layout.mb else []
        if not parts:
            return np.zeros((0, self.nv)), np.zeros(0), np.zeros(0), np.zeros(0)
        gaps = NOTHING if contacts is None else contacts.g_N
        accelerations, rates = ([getattr(part, name) for part in parts] for name in ("acceleration", "rate"))
        return system.directions(parts), np.concatenate(accelerations), np.concatenate(rates), gaps

    def _solve(self, by_rows: np.ndarray, C: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Free forces x with (by_rows C) x = b; where rows are dependent, those nearest to the start.

        Args:
            by_rows: accelerations of the free rows by forces along all rows, shape (n, rows).
            C: all forces by the free ones, shape (rows, n).
            b: shape (n,).
        """
        if not (np.isfinite(by_rows).all() and np.isfinite(b).all()):  # far too long a step: the integrator rejects it
            return np.full_like(b, np.nan)
        if not len(b):
            return b
        if not self._dependent:
            return dgesv(by_rows @ C, b)[2]
        G, adds, start, soft = by_rows[:, self._free], by_rows @ C - by_rows[:, self._free], self._start, self.soft.at
        if not len(soft):
            return nearest_forces(G, adds, b, start)
        found, rest = b.copy(), np.delete(np.arange(len(b)), soft)
        right = b[rest] - (G + adds)[np.ix_(rest, soft)] @ b[soft]
        among = np.ix_(rest, rest)
        found[rest] = nearest_forces(G[among], adds[among], right, start[rest])
        return found

    def _margin(self, by_rows: np.ndarray, C: np.ndarray) -> float:
        """See `Forces.margin`."""
        G, A = by_rows[:, self._free], by_rows @ C
        if not (np.isfinite(A).all() and np.isfinite(G).all()):
            return 1.0
        if self._dependent:
            basis = spanned_forces(G)
            G, A = basis.T @ G @ basis, basis.T @ A @ basis
        (sign, with_friction), (_, without) = np.linalg.slogdet(A), np.linalg.slogdet(G)
        return float(sign * np.exp(min(with_friction - without, 700.0)))

    def is_singular(self, state: State) -> bool:
        """Whether forces grow without bound on the way to a state: slip has no unique forces from there on."""
        return self.forces(state.t, state.q, state.v).margin <= NEARLY * SINGULAR

    def slips_on(self, state: State) -> bool:
        """Whether a cone that has slipped in this phase still does."""
        rows = self.system.contact_rows_at(self.sub, state.q, state.v, self._given_at(state.t))
        gamma_F = rows.rate[self.sub.k :]
        speed = self.sub.cones.sizes(gamma_F)
        return bool((speed > contact_speed(self.system, rows))[self.slips].any())

    def _is_dependent(self, state: State) -> bool:
        t = self._given_at(state.t)
        M = self.system.dynamics(t, state.q, state.v, np.zeros(self.nv)).M.copy()
        W = self._rows(t, state.q, state.v)[0][np.delete(self._free, self.soft.at)]
        return spanned_forces(W @ solve_positive(M, W.T)).shape[1] < len(W)

    def signs(self, forces: Forces, v: np.ndarray) -> np.ndarray:
        """What is positive as long as the phase lasts: normal force, cone or slip, joint torque or rate, shape (s,)."""
        sub, k, cones = self.sub, self.sub.k, self.sub.cones
        la_N, la_F = forces.la[:k], forces.la[k:]
        cone = cones.mu * la_N[self._of] - cones.sizes(la_F)
        along, speed = cones.products(forces.gamma_F, self.direction), cones.sizes(forces.gamma_F)
        # the slip of a body in space ends where it turns back, and where it becomes small: it need not vanish exactly
        slip = along if not sub.m else np.where(self._planar, along, np.minimum(along, speed - self._speed))
        if len(self.soft.at):
            la_N = np.delete(la_N, self.soft.at)
            slip = np.where(self._idle, 1.0, slip)
        held = np.where(self.slips, slip, np.where((cones.rows > 0) & ~self._idle, cone, 1.0))
        friction = self.system.joint_friction
        inside = np.minimum(forces.tau_f - friction.lower, friction.upper - forces.tau_f)
        turns = np.where(self.stuck, inside, self.turning * v[friction.dofs])
        return np.concatenate((la_N, held, turns, [forces.margin - SINGULAR], forces.soft))

    def state(self, t: float, q: np.ndarray, v: np.ndarray) -> State:
        """The state at a motion of this phase."""
        forces, k, m = self.forces(t, q, v), self.sub.k, self.sub.m
        forces.la[self.soft.at] = np.maximum(forces.la[self.soft.at], 0.0)  # where their forces just end
        zero_N, zero_F = np.zeros(k), np.zeros(m)
        return State(
            t, q, v, forces.a, self.sub.index, forces.la[:k], forces.la[k:], zero_N, zero_F, zero_N, zero_F,
            forces.tau_f, np.zeros(len(forces.tau_f)), forces.la_b, np.zeros(len(forces.la_b)),
            tau=np.zeros(0) if self._actuation.tau is None else self._actuation.tau, sampled=self._sampled,
            holding=self._holding, slots=self.system.slots.contents(),
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
        if len(self._free) == len(self.soft.at) and not len(touching):
            return q, v
        still, t = np.zeros(self.nv), self._given_at(t)
        M = system.dynamics(t, q, v, still).M.copy()
        rigid = np.delete(self.sub.index, self.soft.at)
        shut = system.contacts.subset(np.union1d(rigid, touching))
        for _ in range(PROJECTIONS):
            g, W = [], []
            if shut.k:
                rows = system.contact_rows(shut, q, v, still, t)
                g, W = [rows.g_N], [system.directions([rows])[: shut.k]]
            if layout.kb:
                constraints = system.constraint_rows(t, q, v, still)
                g, W = [*g, constraints.g], [*W, system.directions([constraints])[: layout.kb]]
            if not g:
                break
            off = np.concatenate(g)
            q = system.integrate(q, smallest_change(M, np.concatenate(W), off)[0])
            system.dynamics(t, q, v, still)
            # what a correction leaves is of the second order
            if (np.abs(off).max() / system.contacts.length) ** 2 <= ASSEMBLED:
                break
        if len(self._free) == len(self.soft.at):
            return q, v
        W_all, _, rates, _ = self._rows(t, q, v)
        free = np.delete(self._free, self.soft.at)
        W_free, rate, b = W_all[free], rates[free], layout.kb + layout.mb
        if b == 0:
            return q, v + smallest_change(M, W_free, rate)[0]
        bilateral = system.constraint_rows(t, q, v, still)
        change = smallest_change(M, W_free, rate)[0]
        left = np.abs(rate[-b:] + W_free[-b:] @ change)
        if left.max() > CONTRADICTS * max(bilateral.sizes[1], float(np.abs(bilateral.rate).max())):
            name = system.constraints.names[int(np.argmax(left))]
            raise NotConverged(
                f"the constraints contradict each other at t = {t:.6g} s: no motion fulfils {name!r} with the others, "
                f"its rate is off by {left.max():.2g} /s",
                t,
            )
        return q, v + change
