"""The nonlinear equations R(x) = 0 of one step, (127)-(142).

The unknowns (126) are x = (a, U, Q, multipliers) at the end of the step, with the multipliers of the contacts of one
subset, of dry friction in joints and of the bilateral constraints (see `row_layout`). On the Lie group the position
update (125) is q1 = q0 (+) dq with the tangent step dq = dt v0 + dt^2/2 ((1 - 2 beta) a_bar0 + 2 beta a_bar1) + Q.

Compiled twin: engine/kernel/step.c, behind compiled.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.contact.blocked_tangents import Immovable, ProjectedRows, immovable
from ngalpha_pin.contact.joint_friction import FrictionResidual
from ngalpha_pin.contact.laws import ContactResidual
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.numerics.block_matrix import Matrix, solve, solve_positive, stacked
from ngalpha_pin.step import newton_matrix
from ngalpha_pin.step.contact_history import remembered
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.friction_times import friction_times, normal_displacement
from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.step.protocol import Scales
from ngalpha_pin.step.scaling import scales
from ngalpha_pin.step.velocity_problem import rebound
from ngalpha_pin.system.actuation import Actuation
from ngalpha_pin.system.regime import Regime
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import Dynamics, System

# an open contact is forgotten when its la_N_bar is below this part of the typical force
FORGET = 1e-12
# a residual from which nothing comes back: 1e20 times the typical force; matrices there are no matrices of the step
LOST = 1e30
NO_CONTACT = np.zeros(0)
InEngine = tuple[Evaluation, int, bool, dict[bytes, int]]


class StepEquations:
    """R(x) of one step.

    Args:
        system: compiled scene.
        parameters: coefficients (72), tolerance and laws.
        state: start of the step; its dt has been made equal to `dt` (see `rescale`).
        dt: step [s].
        sub: contacts that are unknowns.
        memory: la and la_bar of those contacts at the start of the step, normal entries first, shape (k + m,) each.

    Attributes:
        prescribes: index sets and slack can be prescribed.
        immovable: tangents along which nothing moves in this step, or None.
    """

    prescribes = True
    immovable: Immovable | None = None
    _scales: Scales | None = None

    def __init__(
        self,
        system: System,
        parameters: Parameters,
        state: State,
        dt: float,
        sub: Subset,
        memory: tuple[np.ndarray, np.ndarray],
    ):
        self.system, self.parameters, self.sub, self.state, self.dt = system, parameters, sub, state, dt
        af, am, gamma, beta = parameters.coefficients
        self._c = c = (1 - af) / (1 - am)
        self.gamma_c, self.beta_c = dt * gamma * c, dt * dt * beta * c
        self.loaded = system.loaded(state.actuation)
        self.memory = memory
        self.nv = nv = system.nv
        self.layout = layout = system.layout(sub)
        self.n = layout.n
        # the known part of a_bar1 (71), la_bar1 (96), (114), and of their quadratures (70)
        y = np.concatenate((state.a, memory[0], state.tau_f))
        bar = state.auxiliary
        y_bar = np.concatenate((bar.a_bar, memory[1], bar.tau_f_bar))
        self._known = (af * y - am * y_bar) / (1 - am)
        once = dt * ((1 - gamma) * y_bar + gamma * self._known)
        twice = (dt * dt) * ((0.5 - beta) * y_bar + beta * self._known)
        self.v_free, self.dq_free = state.v + once[:nv], dt * state.v + twice[:nv]  # (73) without a1, U, Q
        k, m = sub.k, sub.m
        j = nv + k + m
        self._z_known = np.concatenate((twice[nv : nv + k], once[nv:j], np.zeros(k + m)))
        self._kappa_F_known = twice[nv + k : j]
        self._friction_known = once[j:]
        self._la_start = memory[0]
        curves = sub.cones.curves
        rates = system.contact_rates(sub, state.q, state.v, state.t) if sub.bounces or curves else None
        self._started = sub.cones.coefficients(rates[k:])[0] if curves and rates is not None else None
        self._start_rates = rebound(system, parameters, state, sub, rates, self.carried)

    @property
    def regime(self) -> Regime:
        """How a step with these contacts is solved."""
        return Regime(self.sub.k, self.sub.m, self.layout.f, self.system.many_trees, self.prescribes)

    @property
    def carried(self) -> np.ndarray:
        """Contacts with a force at the start, whose friction needs no time since an impact, shape (k,)."""
        least = 0.0 if self._scales is None else FORGET * self._scales.force
        return np.asarray(self._la_start[: self.sub.k] > least)

    def spent(self, ev: Evaluation) -> float:
        """Bound of the change of any gap in the step [m]."""
        return self.system.gap_motion(ev.dq)

    def start(self) -> np.ndarray:
        """First iterate: the acceleration and the forces of the start of the step, no impulses."""
        nv, layout = self.nv, self.layout
        x = np.zeros(3 * nv + self.n)
        x[:nv] = self.state.a
        if self.n:
            x[3 * nv :][layout.at_a] = np.concatenate((self._la_start, self.state.tau_f, self.state.la_b))
        return x

    def start_from_percussions(self) -> np.ndarray:
        """First iterate: as `start`, with the percussions of the step before instead of contact forces."""
        x, layout, state = self.start(), self.layout, self.state
        P, multipliers = remembered(self.system, state, self.sub.index, (state.P_N, state.P_F))[0], x[3 * self.nv :]
        multipliers[layout.at_v][: len(P)], multipliers[layout.at_a][: len(P)] = P, 0.0
        return x

    def start_from(self, others: StepEquations, ev: Evaluation) -> tuple[np.ndarray, LawOptions]:
        """First iterate and its laws: the last ones of the step with some of the contacts, no forces of the others.

        Where those forces were left to the percussions, they are here as well.
        """
        nv, layout, known, laws = self.nv, self.layout, others.layout, self.parameters.laws
        if layout.n > layout.n_c:
            return self.start(), laws
        x = np.zeros(3 * nv + self.n)
        x[: 3 * nv], multipliers = ev.x[: 3 * nv], x[3 * nv :]
        N = np.searchsorted(self.sub.index, others.sub.index)
        rows = np.concatenate((N, self.sub.k + np.searchsorted(self.sub.rows_F, others.sub.rows_F)))
        multipliers[layout.at_g][N] = ev.x[3 * nv :][known.at_g]
        for level, of_others in ((layout.at_v, known.at_v), (layout.at_a, known.at_a)):
            multipliers[level][rows] = ev.x[3 * nv :][of_others]
        return x, replace(laws, accelerates=ev.options.accelerates)

    def bars(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """a_bar (nv,), la_bar (k + m,) and tau_f_bar (f,) at the end of the step (71), (96), (114)."""
        nv, j, layout = self.nv, self.sub.k + self.sub.m, self.layout
        la = ev.x[3 * nv :][layout.at_a][: j + layout.f]
        bar = self._known + self._c * np.concatenate((ev.x[:nv], la))
        return bar[:nv], bar[nv : nv + j], bar[nv + j :]

    def keeps(self, ev: Evaluation) -> np.ndarray:
        """Contacts that have not let go of all force, shape (k,)."""
        k = self.sub.k
        return ev.contact.A | (np.abs(self.bars(ev)[1][:k]) > FORGET * self.scales.force)

    def evaluate(self, x: np.ndarray, options: LawOptions | None = None) -> Evaluation:
        """R(x) (127)-(142), with the laws of the method or with others."""
        ev, nv = Evaluation(), self.nv
        a = x[:nv]
        ev.x, ev.options = x, self.parameters.laws if options is None else options
        ev.v = self.v_free + self.gamma_c * a + x[nv : 2 * nv]  # (73)
        ev.dq = self.dq_free + self.beta_c * a + x[2 * nv : 3 * nv]
        ev.q = self.system.integrate(self.state.q, ev.dq)  # (125)
        ev.dynamics = dynamics = self.dynamics(ev.q, ev.v, a, self.state.actuation._replace(held=ev.options.held))
        if self.n == 0:
            ev.R = dynamics.residual[None]
            ev.error = float((np.abs(dynamics.residual) * self._scaled(ev, NO_CONTACT).by_dof).max())
            return ev
        self._kinematics(ev)
        by_M = NO_CONTACT
        if self._scales is None:
            by_M = solve_positive(dynamics.M, ev.W.T)
            if self.sub.m and not self.system.many_trees:  # single bodies can move in any direction
                self.immovable = immovable(ev.W, by_M, self.layout.constraints.start, self.sub)
                if self.immovable is not None:
                    self._kinematics(ev)
                    by_M = solve_positive(dynamics.M, ev.W.T)
        multipliers = x[3 * nv :]
        forces = self._forces(ev, multipliers)
        ev.R = np.empty((3, nv))
        ev.R[0] = dynamics.residual  # (74), (78), (80)
        ev.R[1:] = x[nv : 3 * nv].reshape(2, nv) @ dynamics.M
        ev.R -= forces @ ev.W
        self._scaled(ev, by_M)
        self._laws(ev, multipliers)
        ev.error = self._error(ev)
        return ev

    def dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, actuation: Actuation) -> Dynamics:
        """The equations of motion at the end of the step."""
        return self.system.dynamics(self.state.t + self.dt, q, v, a, actuation)

    @property
    def scales(self) -> Scales:
        """Of the step, after its first evaluation."""
        assert self._scales is not None
        return self._scales

    @property
    def r(self) -> np.ndarray:
        """Prox parameters, shape (n,) [kg]."""
        return self.scales.r

    def _scaled(self, ev: Evaluation, by_M: np.ndarray) -> Scales:
        """The scales of the step, which its first evaluation fixes."""
        if self._scales is None:
            self._scales = scales(self, ev, by_M)
        return self._scales

    def _prox_parameters(self, options: LawOptions) -> np.ndarray:
        """Those of the step with the factors of some laws, shape (n,) [kg]."""
        if options.factors is None and options.joints == 1.0:
            return self.r
        r = self.r.copy()
        if options.factors is not None:
            r[self.sub.friction_places] *= np.tile(options.factors[self.sub.of_F], 2)
        r[self.layout.friction_v] *= options.joints
        return r

    def tangent(self, ev: Evaluation) -> Matrix | None:
        """T = d q1 / d dq; None stands for the identity."""
        return None if self.system.flat else self.system.d_integrate(self.state.q, ev.dq)

    def delassus(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """W^T M^-1 W and W^T S^-1 W of all rows, shape (rows, rows) each [1/kg].

        On velocity and acceleration level springs and dampers resist forces as well: S = M + gamma_c D + beta_c K T.
        """
        G = held = ev.W @ solve_positive(ev.dynamics.M, ev.W.T)
        if self.loaded:
            held = ev.W @ solve(newton_matrix.stiffness(self, ev)[0], ev.W.T)
        if self.immovable is not None:
            G, held = self.immovable.resists(G, self.sub.k), self.immovable.resists(held, self.sub.k)
        return G, (held + held.T) / 2

    def friction_bounds(self, options: LawOptions) -> tuple[np.ndarray, np.ndarray]:
        """See `JointFriction.slip_bounds`."""
        return self.system.joint_friction.slip_bounds(self._friction_known, self.gamma_c, self.dt, options.paper)

    def response(self, ev: Evaluation) -> np.ndarray:
        """Change of y that the residuals of a, U and Q ask for, shape (n,)."""
        return self.linearise(ev)[1][:, -1]

    def _forces(self, ev: Evaluation, multipliers: np.ndarray) -> np.ndarray:
        """Forces la, La and kappa of all rows, shape (3, rows); z, ratio and share are kept in `ev`."""
        sub, layout = self.sub, self.layout
        forces = np.zeros((3, layout.rows))
        forces[0], forces[1] = multipliers[layout.at_a], multipliers[layout.at_v]
        forces[2, layout.position_rows] = multipliers[layout.at_g]
        forces[2, layout.half_rows] = self.dt / 2 * multipliers[layout.half_v]  # (80)
        ev.z = ev.ratio = NO_CONTACT
        if sub.k:
            ev.z = z = multipliers[: layout.n_c] + self._z_known
            la, La = forces[:2, layout.contacts]
            z[: sub.k] = multipliers[: sub.k] + normal_displacement(self, ev.options, la[: sub.k])  # (102)
            z[sub.k : 2 * sub.k + sub.m] += self.gamma_c * la  # (95), (113)
            if sub.m:
                forces[2, sub.k : sub.k + sub.m] = self._friction_displacement(ev, z, La, la)
        return forces

    def _kinematics(self, ev: Evaluation) -> None:
        """Rows of contacts, joint friction and constraints, and what they make of q, v and a."""
        system, sub, layout, a = self.system, self.sub, self.layout, ev.x[: self.nv]
        ev.parts, ev.y, gaps = [], np.empty(self.n), []
        if sub.k:
            rows = system.contact_rows(sub, ev.q, ev.v, a, self.state.t + self.dt)
            still = self.immovable
            ev.parts.append(rows if still is None else ProjectedRows(rows, sub.k, still.projector))
            gaps.append(rows.g_N)
        if layout.f:
            ev.parts.append(system.joint_friction.rows(ev.v, a))
        if layout.rows > sub.k + sub.m + layout.f:
            constraints = system.constraint_rows(self.state.t + self.dt, ev.q, ev.v, a)
            ev.parts.append(constraints)
            gaps.append(constraints.g)
        ev.W = system.directions(ev.parts)
        ev.y[layout.at_g] = stacked(gaps) if gaps else 0.0
        ev.y[layout.at_v] = stacked([part.rate for part in ev.parts])
        ev.y[layout.at_a] = stacked([part.acceleration for part in ev.parts])
        if self._start_rates is not None:
            ev.y[sub.k : sub.k + len(self._start_rates)] += self._start_rates  # (44), (48)

    def _laws(self, ev: Evaluation, multipliers: np.ndarray) -> None:
        """Residual of the force laws; constraints ask for their kinematics to vanish, (84) and (85)."""
        sub, layout, n_c, laws = self.sub, self.layout, self.layout.n_c, ev.options
        r = self._prox_parameters(laws)
        if self.immovable is not None:
            for rows in np.split(sub.friction_places, 2):
                ev.y[rows] += self.immovable.compliance @ ev.z[rows]
        if sub.k:
            La, gamma_F = multipliers[sub.k : 2 * sub.k + sub.m], ev.parts[0].rate[sub.k :]
            given = ev.y[:n_c], ev.z, La, gamma_F, r[:n_c], laws.paper
            ev.contact = ContactResidual(sub, *given, laws.sets, laws.accelerates, laws.slack, self._started)
            if len(sub.soft):
                ev.contact.soften(multipliers)
            if layout.n == n_c:
                ev.law, ev.kinematic = ev.contact.R, ev.contact.kinematic
                return
        ev.law, ev.kinematic = ev.y.copy(), np.ones(self.n, dtype=bool)
        if sub.k:
            ev.law[:n_c], ev.kinematic[:n_c] = ev.contact.R, ev.contact.kinematic
        if layout.f:
            v, a = layout.friction_v, layout.friction_a
            both = slice(v.start, a.stop)
            ev.friction = FrictionResidual(
                self.system.joint_friction, ev.y[both], multipliers[both], r[both], self._friction_known,
                self.dt, self.gamma_c, laws.paper, laws.monotone,
            )  # fmt: skip
            ev.law[both], ev.kinematic[both] = ev.friction.R, ev.friction.kinematic

    def _friction_displacement(self, ev: Evaluation, z: np.ndarray, La: np.ndarray, la: np.ndarray) -> np.ndarray:
        """kappa_F, with its derivatives kept in `ev`; see `friction_times`."""
        sub, k, o = self.sub, self.sub.k, self.sub.of_F
        if ev.options.paper or not ev.options.displaces:
            ev.ratio = np.full(k, self.dt / 2 * ev.options.displaces)
            return ev.ratio[o] * La[k:]
        carried = self.carried
        ev.ratio, ev.share = friction_times(sub, z, self.dt, carried)
        since = ev.ratio[o] * z[2 * k : 2 * k + sub.m] - self.beta_c * la[k:] - self._kappa_F_known
        return np.where(carried[o], ev.ratio[o] * La[k:], since)

    def _error(self, ev: Evaluation) -> float:
        """Largest residual in units of its tolerance; infinite where it is not a number or the iterate has run away."""
        scales = self.scales
        smooth = float((np.abs(ev.R) * scales.by_dof).max())
        laws = float((np.abs(ev.law) * np.where(ev.kinematic, scales.kinematic, scales.direct)).max())
        return max(smooth, laws) if smooth < LOST and laws < LOST else np.inf

    def linearise(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """Response of the step to the multipliers, Z and H (see `newton_matrix`)."""
        return newton_matrix.linearise(self, ev)

    def correction(self, ev: Evaluation, smallest_forces: bool = False) -> tuple[np.ndarray, bool]:
        """Newton correction dx (143), and whether directions were dependent; see `newton_matrix.correction`."""
        return newton_matrix.correction(self, ev, smallest_forces)

    def corrected(self, ev: Evaluation, smallest_forces: bool = False) -> tuple[Evaluation, bool]:
        """R at x + dx with the same laws, and whether directions were dependent (see `correction`)."""
        dx, dependent = self.correction(ev, smallest_forces)
        return self.evaluate(ev.x + dx, ev.options), dependent

    def in_engine(self, ev: Evaluation, max_iter: int, growth: float | None, every: bool = False) -> InEngine:
        """Newton's method in the engine, with `every` that of `differenced`, as far as it goes: `CompiledEquations`."""
        return ev, 0, False, {}

    def row_forces(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Whole forces on the three levels: of the contacts and of g (kappa_hat), of all rows (P), of all rows (la).

        Those of the constraints are without their known part, which no law looks at; a share of friction in the gaps
        stands behind the normal percussions.
        """
        k, m, layout = self.sub.k, self.sub.m, self.layout
        multipliers = ev.x[3 * self.nv :]
        P, la = multipliers[layout.at_v].copy(), multipliers[layout.at_a]
        P[layout.constraints] += self.gamma_c * la[layout.constraints]
        z = ev.z if k else np.zeros(0)
        P[: k + m] = z[k : 2 * k + m]
        if layout.f:
            P[layout.friction] = ev.friction.P
        kappa_g = multipliers[layout.at_g][k:] + self.beta_c * la[layout.constraints][: layout.kb]
        laws = ev.options
        shift = np.zeros(m)
        if m and laws.displaces and not laws.paper:
            shift = np.where(self.carried, 0.0, ev.ratio)[self.sub.of_F] * P[k : k + m]
        return np.concatenate((z[:k], shift, kappa_g)), P, la

    def with_forces(self, ev: Evaluation, kappa: np.ndarray, P: np.ndarray, la: np.ndarray) -> np.ndarray:
        """The iterate with the forces of `row_forces`, with a, U and Q that fulfil (127) to first order."""
        k, m, nv, layout = self.sub.k, self.sub.m, self.nv, self.layout
        multipliers = np.empty(self.n)
        multipliers[layout.at_a] = la
        La = P - self.gamma_c * la
        La[: k + m] -= self._z_known[k : 2 * k + m]
        La[layout.friction] -= self._friction_known
        multipliers[layout.at_v] = La
        of_g = kappa[k + m :] - self.beta_c * la[layout.position_rows][k:]
        multipliers[layout.at_g] = np.concatenate((kappa[:k] - normal_displacement(self, ev.options, la[:k]), of_g))
        there = Evaluation()
        there.options = ev.options
        forces = self._forces(there, multipliers)
        UQ = solve_positive(ev.dynamics.M, (forces[1:] @ (W := ev.W)).T)
        S, D, KT, _ = newton_matrix.stiffness(self, ev)
        old = ev.x[nv : 3 * nv].reshape(2, nv)
        more = ev.x[3 * nv :][layout.at_a] - la
        R_a = ev.R[0] + more @ W + D @ (UQ[:, 0] - old[0]) + KT @ (UQ[:, 1] - old[1])
        return np.concatenate((ev.x[:nv] - solve(S, R_a), UQ[:, 0], UQ[:, 1], multipliers))

    @property
    def gap_tolerance(self) -> np.ndarray:
        """Gaps that are none, shape (k,) [m]."""
        return 1.0 / self.scales.kinematic[: self.sub.k]
