"""Moreau's time stepping, the comparator of the paper: laws on velocity level at the midpoint, first order.

J. J. Moreau: Unilateral contact and dry friction in finite freedom dynamics, 1988; reference [33] of the paper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.common.tolerances import CLOSED
from ngalpha_pin.contact.point_rows import KinematicRows
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.errors import NotConverged, SceneError
from ngalpha_pin.numerics.block_matrix import solve
from ngalpha_pin.numerics.gauss_seidel import FreeProblem, solve_contact_problem
from ngalpha_pin.step.velocity_problem import captured
from ngalpha_pin.system.adhesion import sticky
from ngalpha_pin.system.contact_search import load_slots, not_solid
from ngalpha_pin.system.state import SolvedBy, State, StepResult
from ngalpha_pin.system.system import System


@dataclass(frozen=True)
class MoreauJean:
    """Moreau's scheme with the signature of `GeneralizedAlpha`.

    Attributes:
        theta: velocity at which velocity-dependent forces act, v0 + theta (v1 - v0) [-], in [0, 1].
        tol: change of the percussions in one sweep, relative to the largest one [-]; the paper uses 1e-6.
        max_sweeps: limit of the Gauss-Seidel sweeps.
    """

    theta: float = 0.5
    tol: float = 1e-6
    max_sweeps: int = 20000

    def __post_init__(self) -> None:
        """Check ranges."""
        checks.number("theta", self.theta, 0.0, 1.0)
        checks.number("tol", self.tol, 0.0, 1.0, above=True)
        checks.integer("max_sweeps", self.max_sweeps, 1)

    def step(self, system: System, state: State, dt: float) -> StepResult:
        """One step: half of the displacement, the velocity jump at the midpoint, the other half."""
        table, v0 = system.contacts, state.v
        if table.soft.any():
            name = table.names[int(np.argmax(table.soft))]
            raise SceneError(f"Moreau's scheme knows no compliant contacts, as {name!r}; use GeneralizedAlpha")
        q_mid = system.integrate(state.q, 0.5 * dt * v0)
        dynamics = system.dynamics(state.t + 0.5 * dt, q_mid, v0, np.zeros(system.nv), state.actuation)
        S = dynamics.M + self.theta * dt * dynamics.D
        v1 = v0 - dt * solve(S, dynamics.residual)
        near = np.arange(table.n)
        if system.slots.n:
            near = np.union1d(not_solid(system), load_slots(system, replace(state, q=q_mid), dt))
            system.dynamics(state.t + 0.5 * dt, q_mid, v0, np.zeros(system.nv))
        closed = near[system.gaps(table.subset(near), q_mid) <= 0.0] if table.n else near
        sub, converged, sweeps = table.subset(closed), True, 0
        layout, friction = system.layout(sub), system.joint_friction
        P, P_b = np.zeros(sub.k + sub.m + layout.f), np.zeros(layout.kb + layout.mb)
        if layout.rows:
            t_mid, a = state.t + 0.5 * dt, np.zeros(system.nv)
            parts: list[KinematicRows] = [system.contact_rows(sub, q_mid, v0, a, t_mid)] if sub.k else []
            parts += [friction.rows(v0, a)] if layout.f else []
            parts += [system.constraint_rows(t_mid, q_mid, v0, a)] if len(P_b) else []
            W = system.directions(parts)
            by_S = solve(S, W.T)
            xi = np.concatenate([part.rate for part in parts]) + W @ (v1 - v0)
            if sub.k:
                before = np.concatenate([part.rate for part in parts])
                xi[: sub.k + sub.m] += _rebound(system, sub, W @ by_S, before, layout.constraints.start)
            problem = FreeProblem(W @ by_S, xi, layout.constraints.start)
            start = np.concatenate((_warm_start(system, state, closed), state.P_f if len(state.P_f) else P[:0]))
            start = np.pad(start, (0, len(P) - len(start)))
            cones = sub.cones
            mu = cones.coefficients(parts[0].rate[sub.k :])[0] if sub.k else sub.mu  # of the slip at the start
            P, converged, sweeps = solve_contact_problem(
                problem.G, problem.b, mu, cones.of_row, start, self.tol, self.max_sweeps,
                (dt * friction.lower, dt * friction.upper), of_cone=cones.contact,
            )  # fmt: skip
            P_b = problem.constraint_forces(P)
            v1 = v1 + by_S @ np.concatenate((P, P_b))
        P_N, P_F, P_f = np.split(P, (sub.k, sub.k + sub.m))
        held = sticky(system, closed[P_N > 0.0])
        end = State(
            state.t + dt, system.integrate(q_mid, 0.5 * dt * v1), v1, (v1 - v0) / dt, closed,
            np.zeros(sub.k), np.zeros(sub.m), P_N, P_F, np.zeros(sub.k), np.zeros(sub.m), np.zeros(layout.f), P_f,
            np.zeros(len(P_b)), P_b, slots=system.slots.contents(), tau=state.tau, holding=held, dt=dt,
        )  # fmt: skip
        return StepResult(end, converged, sweeps, SolvedBy.SWEEPS, 0.0 if converged else np.inf)

    def not_converged(self, system: System, state: State, dt: float, result: StepResult) -> NotConverged:
        """The error of a step whose sweeps did not converge."""
        names = tuple(system.contacts.names[i] for i in result.state.contacts)
        return NotConverged(
            f"the sweeps of the step from t = {state.t:.6g} s did not converge with {', '.join(names[:6])} in contact; "
            "raise max_sweeps or tol",
            state.t,
            names,
        )


def _rebound(system: System, sub: Subset, G: np.ndarray, before: np.ndarray, n_c: int) -> np.ndarray:
    """What restitution adds to the rates after a step, shape (k + m,) [m/s].

    Args:
        system: compiled scene.
        sub: contacts.
        G: Delassus matrix of all rows, constraints last, shape (n, n) [1/kg].
        before: rates of all rows before, shape (n,) [m/s].
        n_c: rows before the constraints.
    """
    n = sub.k + sub.m
    if not sub.phases:
        return sub.restitution(before[:n]) * before[:n]  # (44), (48)
    free = FreeProblem(G, before, n_c)
    free.G, free.b = free.G[:n, :n], free.b[:n]
    slowest = CLOSED * system.contacts.speed
    return np.concatenate((captured(sub, free, slowest), np.zeros(sub.m)))


def _warm_start(system: System, state: State, closed: np.ndarray) -> np.ndarray:
    """Percussions of the step before, for the contacts that are still closed."""
    sub, old = system.contacts.subset(closed), system.contacts.subset(state.contacts)
    P_N, P_F = np.zeros(sub.k), np.zeros(sub.m)
    N, F = np.isin(sub.index, old.index), np.isin(sub.rows_F, old.rows_F)
    P_N[N] = state.P_N[np.isin(old.index, sub.index)]
    P_F[F] = state.P_F[np.isin(old.rows_F, sub.rows_F)]
    return np.concatenate((P_N, P_F))
