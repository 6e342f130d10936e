"""Derivatives of what happens at one moment: an impact, and the accelerations and forces that agree with a motion.

Both are linear equations on the index sets that the laws have found: M du = W^T P + ..., and of every row either its
kinematics or its force vanishes, or the force follows the slip.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from ngalpha_pin.common.tolerances import CONE
from ngalpha_pin.contact.joint_friction import JointRows
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.initialization.initial import joint_speed
from ngalpha_pin.numerics.block_matrix import dense
from ngalpha_pin.numerics.finite_differences import first_derivative
from ngalpha_pin.sensitivities.averaging import Inertia
from ngalpha_pin.sensitivities.columns import Columns
from ngalpha_pin.sensitivities.configuration import Geometry, full, row_parts
from ngalpha_pin.sensitivities.step_derivatives import BY_TIME
from ngalpha_pin.sensitivities.tangent import Tangent, still
from ngalpha_pin.sensitivities.ways import ways_of
from ngalpha_pin.system.contact_search import contact_speed
from ngalpha_pin.system.state import Impact, State
from ngalpha_pin.system.system import ContactRows, System

RCOND = 1e-12  # singular values below this belong to forces that are not determined


def impact_derivative(geometry: Geometry, hit: Impact, S: Tangent, columns: Columns) -> tuple[Tangent, bool]:
    """Tangent of the motion just after an impact, and whether percussions are determined; S is that just before it."""
    system, sub, t, q = geometry.system, geometry.system.contacts.subset(hit.contacts), hit.t, hit.q
    v0, v1, zero, k, m, p = hit.v_before, hit.v_after, np.zeros(geometry.system.nv), sub.k, sub.m, S.p
    if system.slots.n:
        system.slots.restore(hit.slots)
    P = np.concatenate((hit.P_N, hit.P_F, hit.P_b))
    M = full(system.dynamics(t, q, v0, zero).M)
    parts = [x for x in row_parts(system, sub, t, q, v0, zero) if not isinstance(x, JointRows)]
    W = system.directions(parts).copy()
    rate0 = np.concatenate([part.rate for part in parts])
    ways = ways_of(geometry, sub, parts[0], v0, zero, columns, p) if k else None
    system.dynamics(t, q, v1, zero)
    after = [x for x in row_parts(system, sub, t, q, v1, zero) if not isinstance(x, JointRows)]
    rate1 = np.concatenate([part.rate for part in after])
    X0, X1 = geometry.rates(t, sub, q, v0), geometry.rates(t, sub, q, v1)
    f = system.joint_friction.f
    spread = np.concatenate((P[: k + m], np.zeros(f), P[k + m :]))
    turned = geometry.rows(t, sub, q, v0, zero, spread[None]).forces[0]
    # xi = W v1 + e W v0, but the rates of constraints alone, whose explicit times are those of given motions
    e = np.concatenate((sub.e, np.zeros(len(P) - k - m)))
    d_xi = (X1 + e[:, None] * X0) @ S.q + e[:, None] * (W @ S.v)
    d_N, d_F = columns.of("e_N", sub.index, p), columns.of("e_F", sub.index, p)
    if d_N is not None:
        d_xi[:k] += rate0[:k, None] * d_N
    if d_F is not None:
        d_xi[k : k + m] += rate0[k : k + m, None] * d_F[sub.of_F]
    smooth = (geometry.momentum(q, v1 - v0) - turned) @ S.q - M @ S.v + columns.momentum(system, q, v1 - v0, p)
    if ways is not None:
        smooth -= np.einsum("r,rkp->kp", P[: k + m], ways.W)
        d_xi[: k + m] += np.einsum("rkp,k->rp", ways.W, v1) + e[: k + m, None] * np.einsum("rkp,k->rp", ways.W, v0)
    if S.t.any() and len(P) > k + m:
        d_xi[k + m :] += np.outer(_rates_by_time(system, sub, t, q, v1), S.t)
    xi = rate1 + e * rate0
    slip_mu, slope = sub.cones.coefficients(xi[k : k + m])
    law = _Law(sub, hit.P_N, hit.P_F, slip_mu, slope, xi[k : k + m])
    by_y, by_P, by_mu = law.derivatives(len(P), columns.of("mu", sub.index, p))
    A = np.block([[M, -W.T], [by_y @ W, by_P]])
    b = np.concatenate((smooth, by_y @ d_xi + by_mu))
    found, determined = _solved(A, b, M, W)
    return replace(still(system, S.q, -found[: system.nv], S.t)), determined


def consistent_derivative(
    geometry: Geometry, state: State, S: Tangent, columns: Columns, inertia: Inertia | None = None
) -> tuple[Tangent, bool]:
    """Tangent of a state whose accelerations and forces agree with its motion, and whether forces are determined.

    Args:
        geometry: of the scene.
        state: of `initialization.initial.consistent_state`.
        S: of its motion; whose dt is that of the step to come where there is an inertia.
        columns: what else the columns change.
        inertia: what resists the forces in place of the mass matrix.
    """
    system, sub = geometry.system, geometry.system.contacts.subset(state.contacts)
    t, q, v, a, nv, p = state.t, state.q, state.v, state.a, geometry.system.nv, S.p
    if system.slots.n:
        system.slots.restore(state.slots)
    k, m, layout = sub.k, sub.m, system.layout(sub)
    dynamics = system.dynamics(t, q, v, a, state.actuation)
    M, K, D = full(dynamics.M), dense(dynamics.K).copy(), dense(dynamics.D).copy()
    smooth = K @ S.q + D @ S.v + columns.residual(system, t, q, v, a, state.actuation, p)
    resists = M
    if inertia is not None:
        resists = inertia.matrix
        smooth += np.outer(inertia.by_dt, S.dt) + inertia.by_q @ S.q + inertia.by_v @ S.v + inertia.by_columns
    if S.t.any():
        smooth += np.outer(_residual_by_time(system, state), S.t)
    la = np.concatenate((state.la_N, state.la_F, state.tau_f, state.la_b))
    if layout.rows == 0:
        da, determined, forces = -np.linalg.solve(resists, smooth), True, np.zeros((0, p))
    else:
        parts = row_parts(system, sub, t, q, v, a)
        W = system.directions(parts).copy()
        Y = system.row_derivatives(parts, v, a)[1].copy()
        rate, acceleration = (np.concatenate([getattr(x, name) for x in parts]) for name in ("rate", "acceleration"))
        speed = contact_speed(system, cast(ContactRows, parts[0])) if k else 0.0
        turned = geometry.rows(t, sub, q, v, a, la[None])
        d_acceleration = turned.acceleration @ S.q + Y @ S.v
        d_rate = W[: k + m] @ S.v + geometry.rates(t, sub, q, v)[: k + m] @ S.q
        system.dynamics(t, q, v, a, state.actuation)
        smooth -= turned.forces[0] @ S.q
        ways = ways_of(geometry, sub, parts[0], v, a, columns, p) if k else None
        if ways is not None:
            smooth -= np.einsum("r,rkp->kp", la[: k + m], ways.W)
            d_rate[: k + m] += np.einsum("rkp,k->rp", ways.W, v)
            d_acceleration[: k + m] += ways.acceleration
        if S.t.any():
            d_acceleration += np.outer(_accelerations_by_time(system, sub, state), S.t)
        d_mu = columns.of("mu", sub.index, p)
        by_y, by_la, by_mu, follows = _laws(system, sub, state, rate, acceleration, speed, d_mu)
        A = np.block([[resists, -W.T], [by_y @ W, by_la]])
        b = np.concatenate((smooth, by_y @ d_acceleration + follows @ d_rate + by_mu))
        found, determined = _solved(A, b, M, W)
        da, forces = -found[:nv], -found[nv:]
    j = k + m
    torques = forces[j : j + layout.f]
    whole = replace(S, contacts=state.contacts, a=da, a_bar=da, la=forces[:j], la_bar=forces[:j])
    return replace(whole, tau_f=torques, tau_f_bar=torques, dt=np.zeros(p)), determined


def _laws(
    system: System,
    sub: Subset,
    state: State,
    rate: np.ndarray,
    acceleration: np.ndarray,
    speed: float,
    d_mu: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray | float, np.ndarray]:
    """Derivatives of the laws of all rows by their accelerations, forces and mu, and by the rates of the contacts.

    Args:
        system: compiled scene.
        sub: the closed contacts.
        state: with their forces.
        rate: of all rows, shape (rows,).
        acceleration: of all rows, shape (rows,).
        speed: slip below this is none [m/s].
        d_mu: change of the coefficients by the columns, shape (k, p), or None.
    """
    k, m = sub.k, sub.m
    slip = rate[k : k + m]
    slips = (np.sqrt(np.bincount(sub.of_F, slip**2, k)) > speed)[sub.of_F]
    mu, slope = sub.cones.coefficients(np.where(slips, slip, 0.0))
    law = _Law(sub, state.la_N, state.la_F, mu, slope, np.where(slips, slip, acceleration[k : k + m]), slips)
    by_y, by_la, by_mu = law.derivatives(len(rate), d_mu)
    _joints_stick(system, state, by_y, by_la, k + m)
    # the direction of friction follows the slip where there is one, and otherwise the acceleration
    follows = np.zeros((len(rate), k + m))
    moving = np.flatnonzero(law.moves & slips)
    follows[k + moving, k:] = by_y[k + moving, k : k + m]
    by_y[k + moving] = 0.0
    return by_y, by_la, by_mu, follows


class _Law:
    """The laws of contacts that are closed, as linear equations on their index sets.

    Args:
        sub: contacts.
        N, F: percussions or forces, shapes (k,) and (m,).
        mu, slope: coefficients and their slopes by the speed of slip, shape (k,).
        y: what friction is opposite to, shape (m,).
        slips: rows whose coefficient follows y, shape (m,); by default all.
    """

    def __init__(
        self,
        sub: Subset,
        N: np.ndarray,
        F: np.ndarray,
        mu: np.ndarray,
        slope: np.ndarray,
        y: np.ndarray,
        slips: np.ndarray | None = None,
    ):
        self._sub, self._N, self._mu, self._slope, self._y, self._slips = sub, N, mu, slope, y, slips
        self._closed = N > 0.0
        size = np.sqrt(np.bincount(sub.of_F, F * F, sub.k))
        stick = self._closed & (size < mu * N * (1 - CONE))
        if slips is not None and slips.any():
            stick &= ~np.isin(np.arange(sub.k), sub.of_F[slips])
        self._stick, self.moves = stick[sub.of_F], (self._closed & ~stick)[sub.of_F]

    def derivatives(self, rows: int, d_mu: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray | float]:
        """Derivatives of the equations of all rows by their kinematics, by their forces, and by mu."""
        sub, k, m, o = self._sub, self._sub.k, self._sub.m, self._sub.of_F
        kinematic = np.concatenate((self._closed, self._stick, np.ones(rows - k - m, dtype=bool)))
        by_y, by_F = np.diag(kinematic * 1.0), np.diag(~kinematic * 1.0)
        if not self.moves.any():
            return by_y, by_F, 0.0
        (unit, norm), s = sub.cones.unit(self._y), np.flatnonzero(self.moves)
        by_F[k + s, o[s]] += (self._mu[o] * unit)[s]
        turn = (np.eye(m) - unit[:, None] * unit * sub.cones.same) / norm[:, None]
        turn = (self._mu * self._N)[o][:, None] * turn
        slope = self._slope[o] if self._slips is None else np.where(self._slips, self._slope[o], 0.0)
        turn += (slope * self._N[o] * unit)[:, None] * unit * sub.cones.same
        by_y[np.ix_(k + s, k + np.arange(m))] += turn[s]
        if d_mu is None:
            return by_y, by_F, 0.0
        by_mu = np.zeros((rows, d_mu.shape[1]))
        by_mu[k + s] = (self._N[o] * unit)[s, None] * d_mu[o[s]]
        return by_y, by_F, by_mu


def _joints_stick(system: System, state: State, by_y: np.ndarray, by_la: np.ndarray, first: int) -> None:
    """The laws of dry friction in joints: one that slips has a torque that does not change."""
    friction = system.joint_friction
    lower, upper = friction.bounds_at(state.v, joint_speed(system))
    span = np.maximum(upper - lower, 0.0)
    sticks = (state.tau_f > lower + CONE * span) & (state.tau_f < upper - CONE * span)
    at = first + np.flatnonzero(~sticks)
    by_y[at], by_la[at] = 0.0, 0.0
    by_la[at, at] = 1.0


def _solved(A: np.ndarray, b: np.ndarray, M: np.ndarray, W: np.ndarray) -> tuple[np.ndarray, bool]:
    """The smallest solution of A x = b in kinetic units, and whether it is the only one."""
    root = np.sqrt(M.diagonal())
    mass = np.einsum("ij,ij->i", W / root, W / root)
    unit = np.sqrt(np.where(mass > 0.0, mass, 1.0))
    rows, columns = np.concatenate((1 / root, 1 / unit)), np.concatenate((1 / root, 1 / unit))
    # rows that ask for forces have their unit
    nv = len(root)
    direct = np.abs(A[nv:, nv:]).max(axis=1, initial=0.0) > 0.0
    rows[nv:] = np.where(direct, unit, rows[nv:])
    x, _, rank, _ = np.linalg.lstsq(A * rows[:, None] * columns, b * rows[:, None], rcond=RCOND)
    return x * columns[:, None], int(rank) == len(A)


def _rates_by_time(system: System, sub: Subset, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Derivative of the rates of constraints by the time, shape (b,)."""
    zero = np.zeros_like(v)

    def rates(s: float) -> np.ndarray:
        system.dynamics(t + s, q, v, zero)
        return system.constraint_rows(t + s, q, v, zero).rate

    return first_derivative(rates, BY_TIME)


def _residual_by_time(system: System, state: State) -> np.ndarray:
    """Derivative of M a + h - tau by the time, shape (nv,)."""

    def residual(s: float) -> np.ndarray:
        return system.dynamics(state.t + s, state.q, state.v, state.a, state.actuation).residual.copy()

    given = not np.array_equal(residual(BY_TIME), residual(-BY_TIME))
    return first_derivative(residual, BY_TIME) if given else np.zeros(system.nv)


def _accelerations_by_time(system: System, sub: Subset, state: State) -> np.ndarray:
    """Derivative of the accelerations of all rows by the time, shape (rows,)."""
    q, v, a = state.q, state.v, state.a

    def accelerations(s: float) -> np.ndarray:
        system.dynamics(state.t + s, q, v, a, state.actuation)
        return np.concatenate([part.acceleration for part in row_parts(system, sub, state.t + s, q, v, a)])

    given = not np.array_equal(accelerations(BY_TIME), accelerations(-BY_TIME))
    return first_derivative(accelerations, BY_TIME) if given else np.zeros(system.layout(sub).rows)
