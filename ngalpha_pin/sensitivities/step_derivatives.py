"""The linear equations of the implicit function theorem for one smooth part: dR/dx, and the change of R with x held."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.constraints.constraint_set import ConstraintRows
from ngalpha_pin.numerics.block_matrix import BlockMatrix, dense
from ngalpha_pin.numerics.finite_differences import first_derivative
from ngalpha_pin.sensitivities.columns import Columns
from ngalpha_pin.sensitivities.configuration import Geometry, full, row_parts
from ngalpha_pin.sensitivities.force_laws import LawDerivatives, by_mu, law_derivatives
from ngalpha_pin.sensitivities.tangent import Tangent
from ngalpha_pin.sensitivities.ways import ways_of
from ngalpha_pin.step import newton_matrix
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.system.system import System

BY_TIME = 1e-4  # distance of the values of given motions whose derivative is taken [s]


class Shifts(NamedTuple):
    """What changes with x held, p columns each.

    Attributes:
        known: of what is known of a_bar, la_bar and tau_f_bar at the end, shape (nv + k + m + f, p).
        once, twice: of the quadratures, likewise.
        q, v: at the end, shape (nv, p).
    """

    known: np.ndarray
    once: np.ndarray
    twice: np.ndarray
    q: np.ndarray
    v: np.ndarray


class Slopes(NamedTuple):
    """Derivatives of R by q1, v1 and, directly, by a, shape (3 nv + n, nv) each."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray


def linear_equations(
    geometry: Geometry,
    equations: StepEquations,
    ev: Evaluation,
    S: Tangent,
    d_dt: np.ndarray,
    shifts: Shifts,
    columns: Columns,
) -> tuple[np.ndarray, np.ndarray]:
    """DR/dx, shape (3 nv + n, 3 nv + n), and the change of R with x held, shape (3 nv + n, p)."""
    system, nv, n, p = geometry.system, equations.nv, equations.n, S.p
    N, gamma_c, beta_c = 3 * nv, equations.gamma_c, equations.beta_c
    t1, a = equations.state.t + equations.dt, ev.x[:nv]
    rebounds = _rebounds(geometry, equations, S, columns)
    actuation = equations.state.actuation._replace(held=ev.options.held)
    dynamics = system.dynamics(t1, ev.q, ev.v, a, actuation)
    M, K, D = full(dynamics.M), dense(dynamics.K).copy(), dense(dynamics.D).copy()
    slopes = Slopes(*(np.zeros((N + n, nv)) for _ in range(3)))
    slopes.q[:nv], slopes.v[:nv], slopes.a[:nv] = K, D, M
    J, rhs = np.zeros((N + n, N + n)), np.zeros((N + n, p))
    rhs[:nv] = columns.residual(system, t1, ev.q, ev.v, a, actuation, p)
    laws = None
    if n:
        laws = law_derivatives(equations, ev)
        forces = equations._forces(ev, ev.x[N:])
        _add_rows(geometry, equations, ev, laws, forces, slopes, J)
        _add_known(geometry, equations, ev, laws, forces, shifts, d_dt, columns, rhs)
        rhs[N:] += laws.by_y @ rebounds
        _add_ways(geometry, equations, ev, laws, forces, columns, rhs)
    T = tangent_of(equations, ev)
    J[:, :nv] = slopes.a + gamma_c * slopes.v + beta_c * slopes.q @ T
    J[:, nv : 2 * nv] = slopes.v
    J[:, 2 * nv : N] = slopes.q @ T
    J[nv : 2 * nv, nv : 2 * nv] += M
    J[2 * nv : N, 2 * nv : N] += M
    rhs += slopes.q @ shifts.q + slopes.v @ shifts.v
    d_t = S.t + d_dt
    if d_t.any():
        rhs += np.outer(_by_time(equations, ev, laws), d_t)
    return J, rhs


def scales_of(equations: StepEquations, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
    """Scales of the rows and the columns of these equations, shape (3 nv + n,) each."""
    root, dt = np.sqrt(full(ev.dynamics.M).diagonal()), equations.dt
    rows = np.concatenate((1 / root, 1 / (root * dt), 1 / (root * dt * dt)))
    columns = np.concatenate((1 / root, dt / root, dt * dt / root))
    if equations.n:
        own = np.where(ev.kinematic, equations.scales.row, 1.0 / equations.scales.column)
        rows, columns = np.concatenate((rows, own)), np.concatenate((columns, equations.scales.column))
    return rows, columns


def tangent_of(equations: StepEquations, ev: Evaluation) -> np.ndarray:
    """T = d q1 / d dq, shape (nv, nv)."""
    return by_step(equations.system, equations.state.q, ev.dq)


def by_step(system: System, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """Derivative of the end of a tangent step by the step, shape (nv, nv)."""
    T = np.eye(system.nv)
    if not system.flat:
        found = system.d_integrate(q, dq)
        tree = found.tree if isinstance(found, BlockMatrix) else found
        T[: len(tree), : len(tree)] = tree
    return T


def _add_rows(
    geometry: Geometry,
    equations: StepEquations,
    ev: Evaluation,
    laws: LawDerivatives,
    forces: np.ndarray,
    slopes: Slopes,
    J: np.ndarray,
) -> None:
    """Add what the rows and their laws do; `forces` are la, La and kappa of all rows."""
    system, nv, n, layout, N = geometry.system, equations.nv, equations.n, equations.layout, 3 * equations.nv
    W, a, U, Q = ev.W, ev.x[:nv], ev.x[nv : 2 * nv], ev.x[2 * nv : N]
    Y = system.row_derivatives(ev.parts, ev.v, a)[1].copy()
    still, k, j = equations.immovable, equations.sub.k, equations.sub.k + equations.sub.m
    acting = forces
    if still is not None:
        acting = np.concatenate((forces[:, :k], forces[:, k:j] @ still.projector, forces[:, j:]), axis=1)
    t1, parts = equations.state.t + equations.dt, None if still is not None else ev.parts
    turned = geometry.rows(t1, equations.sub, ev.q, ev.v, a, acting, parts)
    if still is not None:
        turned.acceleration[k:j] = still.projector @ turned.acceleration[k:j]
    X, others = np.zeros((layout.rows, nv)), np.ones(layout.rows, dtype=bool)
    others[layout.friction] = False
    X[others] = geometry.rates(t1, equations.sub, ev.q, ev.v, parts)
    if still is not None:
        X[k:j] = still.projector @ X[k:j]
    y_q, y_v, y_a = (np.zeros((n, nv)) for _ in range(3))
    y_q[layout.at_g], y_q[layout.at_v], y_q[layout.at_a] = W[layout.position_rows], X, turned.acceleration
    y_v[layout.at_v], y_v[layout.at_a], y_a[layout.at_a] = W, Y, W
    slopes.q[:nv] -= turned.forces[0]
    slopes.q[nv : 2 * nv] = geometry.momentum(ev.q, U) - turned.forces[1]
    slopes.q[2 * nv : N] = geometry.momentum(ev.q, Q) - turned.forces[2]
    slopes.q[N:], slopes.v[N:], slopes.a[N:] = laws.by_y @ y_q, laws.by_y @ y_v, laws.by_y @ y_a
    J_m = J[:, N:]
    J_m[:nv, layout.at_a] -= W.T
    J_m[nv : 2 * nv, layout.at_v] -= W.T
    J_m[2 * nv : N] -= W.T @ newton_matrix.displacements(equations, ev)
    J_m[N:] += laws.by_multipliers
    if still is not None:
        Dz = newton_matrix.force_derivative(equations, ev.options)
        for places in np.split(equations.sub.friction_places, 2):
            J_m[N:] += laws.by_y[:, places] @ still.compliance @ Dz[places, :n]


def _add_known(
    geometry: Geometry,
    equations: StepEquations,
    ev: Evaluation,
    laws: LawDerivatives,
    forces: np.ndarray,
    shifts: Shifts,
    d_dt: np.ndarray,
    columns: Columns,
    rhs: np.ndarray,
) -> None:
    """Add what changes in forces, displacements and coefficients with x held."""
    system, sub, layout, nv, N = geometry.system, equations.sub, equations.layout, equations.nv, 3 * equations.nv
    k, m, p = sub.k, sub.m, rhs.shape[1]
    dz = np.zeros((layout.n_c, p))
    dz[:k], dz[k : 2 * k + m] = shifts.twice[nv : nv + k], shifts.once[nv : nv + k + m]
    if k and not ev.options.paper:  # see `friction_times`
        once = ev.z[k : 2 * k] - ev.x[3 * nv :][layout.at_v][:k]  # P_N - La_N
        half = np.outer(0.5 * once, d_dt) + 0.5 * equations.dt * shifts.once[nv : nv + k]
        dz[:k] = np.where(equations.carried[:, None], half, dz[:k])
    U, Q = ev.x[nv : 2 * nv], ev.x[2 * nv : N]
    rhs[nv : 2 * nv] += columns.momentum(system, ev.q, U, p)
    moved = _displacements(equations, ev, forces, dz, shifts, d_dt)
    rhs[2 * nv : N] += columns.momentum(system, ev.q, Q, p) - ev.W.T @ moved
    if k:
        rhs[N : N + layout.n_c] += laws.by_z @ dz
        d_mu = columns.of("mu", sub.index, p)
        if m and d_mu is not None:
            rhs[N : N + layout.n_c] += by_mu(ev.contact, d_mu)
        if equations.immovable is not None:
            for places in np.split(sub.friction_places, 2):
                rhs[N:] += laws.by_y[:, places] @ equations.immovable.compliance @ dz[places]
    if layout.f:
        # a percussion at its bound, which is as long as the step
        bound = np.outer(ev.friction.P / equations.dt, d_dt)
        rhs[N:][layout.friction_v] += laws.by_torque[:, None] * (shifts.once[nv + k + m :] - bound)


def _displacements(
    equations: StepEquations, ev: Evaluation, forces: np.ndarray, dz: np.ndarray, shifts: Shifts, d_dt: np.ndarray
) -> np.ndarray:
    """Change of kappa with the multipliers held, shape (rows, p)."""
    sub, layout, nv = equations.sub, equations.layout, equations.nv
    k, m, multipliers = sub.k, sub.m, ev.x[3 * nv :]
    moved = np.zeros((layout.rows, dz.shape[1]))
    if m:
        if ev.options.paper or not ev.options.displaces:
            moved[k : k + m] = np.outer(0.5 * forces[1, k : k + m] * ev.options.displaces, d_dt)
        else:
            o, ratio, share = sub.of_F, ev.ratio[sub.of_F], ev.share
            moved[k : k + m] = share[:, None] * (dz[o] - ratio[:, None] * dz[k + o])
            moved[k : k + m] += ratio[:, None] * dz[2 * k : 2 * k + m] - shifts.twice[nv + k : nv + k + m]
            # where there is no time since an impact, kappa / P stands for half of the step, or for all of it
            P_N, kappa = ev.z[k : 2 * k][o], ev.z[:k][o]
            at_end = (P_N > 0.0) & (kappa > equations.dt * P_N)
            half = np.where(P_N > 0.0, at_end * 1.0, 0.5)
            moved[k : k + m] += np.outer(half * ev.z[2 * k : 2 * k + m], d_dt)
            carried = equations.carried[o]
            moved[k : k + m][carried] = np.outer(0.5 * forces[1, k : k + m], d_dt)[carried]
    moved[layout.half_rows] += np.outer(0.5 * multipliers[layout.half_v], d_dt)
    return moved


def _rebounds(geometry: Geometry, equations: StepEquations, S: Tangent, columns: Columns) -> np.ndarray:
    """Change of what restitution adds to the rates at the end, shape (n, p)."""
    sub, start, system = equations.sub, equations.state, geometry.system
    k, m, p = sub.k, sub.m, S.p
    change = np.zeros((equations.n, p))
    if not sub.bounces and (columns.e_N is None and columns.e_F is None):
        return change
    if not k:
        return change
    still = np.zeros(equations.nv)
    system.dynamics(start.t, start.q, start.v, still)
    rows = system.contact_rows(sub, start.q, start.v, still, start.t)
    W = system.directions([rows])[: k + m]
    d_rate = W @ S.v + geometry.rates(start.t, sub, start.q, start.v)[: k + m] @ S.q
    ways = ways_of(geometry, sub, rows, start.v, still, columns, p)
    if ways is not None:
        d_rate += np.einsum("rkp,k->rp", ways.W, start.v)
    on = np.ones(k + m)
    if not equations.parameters.paper:
        on[:k] = rows.rate[:k] < 0.0
        on[k:] = ~equations.carried[sub.of_F]
    change[k : 2 * k + m] = (sub.e * on)[:, None] * d_rate
    d_N, d_F = columns.of("e_N", sub.index, p), columns.of("e_F", sub.index, p)
    if d_N is not None:
        change[k : 2 * k] += (on * rows.rate)[:k, None] * d_N
    if d_F is not None:
        change[2 * k : 2 * k + m] += rows.rate[k:, None] * d_F[sub.of_F]
    return change


def _add_ways(
    geometry: Geometry,
    equations: StepEquations,
    ev: Evaluation,
    laws: LawDerivatives,
    forces: np.ndarray,
    columns: Columns,
    rhs: np.ndarray,
) -> None:
    """Add what points and planes that move in their bodies do."""
    sub, nv, layout = equations.sub, equations.nv, equations.layout
    if columns.points is None or not sub.k:
        return
    rows = geometry.system.contact_rows(sub, ev.q, ev.v, ev.x[:nv], equations.state.t + equations.dt)
    ways = ways_of(geometry, sub, rows, ev.v, ev.x[:nv], columns, rhs.shape[1])
    if ways is None:
        return
    k, m = sub.k, sub.m
    for level in range(3):
        rhs[level * nv : (level + 1) * nv] -= np.einsum("r,rkp->kp", forces[level, : k + m], ways.W)
    y = np.zeros((equations.n, rhs.shape[1]))
    y[:k], y[k : 2 * k + m] = ways.gaps, np.einsum("rkp,k->rp", ways.W, ev.v)
    y[2 * k + m : layout.n_c] = ways.acceleration
    rhs[3 * nv :] += laws.by_y @ y


def _by_time(equations: StepEquations, ev: Evaluation, laws: LawDerivatives | None) -> np.ndarray:
    """Derivative of R by the time at the end, where something is given over time, shape (3 nv + n,)."""
    system, nv, layout, sub = equations.system, equations.nv, equations.layout, equations.sub
    t1, a, q, v = equations.state.t + equations.dt, ev.x[:nv], ev.q, ev.v
    actuation = equations.state.actuation._replace(held=ev.options.held)
    forces = equations._forces(ev, ev.x[3 * nv :]) if equations.n else np.zeros((3, 0))

    def residual(s: float) -> np.ndarray:
        found = np.zeros(3 * nv + equations.n)
        found[:nv] = system.dynamics(t1 + s, q, v, a, actuation).residual
        if laws is None:
            return found
        parts = row_parts(system, sub, t1 + s, q, v, a)
        found[: 3 * nv] -= (forces @ system.directions(parts)).ravel()
        y = np.zeros(equations.n)
        gaps = [part.g for part in parts if isinstance(part, ConstraintRows)]
        y[layout.at_g] = np.concatenate([np.zeros(sub.k), *gaps])
        y[layout.at_v] = np.concatenate([part.rate for part in parts])
        y[layout.at_a] = np.concatenate([part.acceleration for part in parts])
        found[3 * nv :] = laws.by_y @ y
        return found

    given = not np.array_equal(residual(BY_TIME), residual(-BY_TIME))
    found = first_derivative(residual, BY_TIME) if given else np.zeros(3 * nv + equations.n)
    system.dynamics(t1, q, v, a, actuation)
    return found
