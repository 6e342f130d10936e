"""The derivative of a smooth part of a step, by the implicit function theorem on its own equations.

x = (a, U, Q, multipliers) solves R(x; start, dt, parameters) = 0 on the index sets that were found. With x held, start
and dt reach R through v1, q1, the known parts of forces and percussions, and the rates at the start that restitution
asks for. With G_q = dR/dq1 and G_v = dR/dv1,

    dR/da = dR/da1 + gamma_c G_v + beta_c G_q T        dR/dU = M + G_v        dR/dQ = M + G_q T

Unlike the Newton matrix of the step, which only has to lead to the solution, G_q is complete here.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dgetrf, dgetrs

from ngalpha_pin.integrators.parts import SmoothPart
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.integrators.restart import begin, rescale, without_open
from ngalpha_pin.sensitivities.columns import Columns
from ngalpha_pin.sensitivities.configuration import Geometry
from ngalpha_pin.sensitivities.step_derivatives import Shifts, linear_equations, scales_of, tangent_of
from ngalpha_pin.sensitivities.tangent import Tangent
from ngalpha_pin.step.contact_history import memory
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.newton_matrix import RCOND, SINGULAR
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System


class Solved(NamedTuple):
    """A smooth part, evaluated once more at its solution.

    Attributes:
        part: as it was taken.
        start: as its equations see it.
        equations: of the part.
        ev: at the solution.
        restarts: accelerations and forces at its start are averages over the part, see `integrators.restart`.
    """

    part: SmoothPart
    start: State
    equations: StepEquations
    ev: Evaluation
    restarts: bool


def solved_again(system: System, parameters: Parameters, part: SmoothPart) -> Solved:
    """The equations of a part, at its solution."""
    if system.slots.n:
        system.slots.restore(part.end.slots)
    begun = begin(Piece(parameters, system, part.start, part.dt))
    start = begun.state
    as_before = rescale(without_open(system, part.start), part.dt)
    restarts = start.memory is None and not np.array_equal(start.a, as_before.a)
    sub = system.contacts.subset(part.contacts)
    held = memory(system, start, part.contacts)
    equations = StepEquations(system, begun.parameters, start, part.dt, sub, held)
    equations.evaluate(equations.start())  # which fixes the scales
    return Solved(part, start, equations, equations.evaluate(np.array(part.x), part.options), restarts)


def smooth_derivative(
    geometry: Geometry, solved: Solved, S: Tangent, d_dt: np.ndarray, columns: Columns
) -> tuple[Tangent, bool]:
    """The tangent at the end of a smooth part, and whether directions were dependent.

    Args:
        geometry: of the scene.
        solved: the part.
        S: at its start, as its equations see it (see `as_begun`).
        d_dt: of its length, shape (p,).
        columns: what else the columns change.
    """
    equations, ev = solved.equations, solved.ev
    nv, n, layout, sub = equations.nv, equations.n, equations.layout, equations.sub
    p = S.p
    shifts = _shifts(solved, S, d_dt)
    J, rhs = linear_equations(geometry, equations, ev, S, d_dt, shifts, columns)
    rows, columns_of_x = scales_of(equations, ev)
    A, b = J * rows[:, None] * columns_of_x, rhs * rows[:, None]
    lu, order, _ = dgetrf(A)
    pivots = np.abs(lu.diagonal())
    dependent = not pivots.min() > SINGULAR * pivots.max()
    if dependent:
        first = np.zeros((3 * nv + n, p))
        first[:nv] = S.a
        if n:
            before = np.concatenate((S.la, S.tau_f, np.zeros((layout.kb + layout.mb, p))))
            first[3 * nv :][layout.at_a] = before
        dx, dependent = _nearest(A, b, first / columns_of_x[:, None], 3 * nv)
    else:
        dx = -dgetrs(lu, order, b)[0]
    dx = dx * columns_of_x[:, None]
    da, dU, dQ, d_multipliers = np.split(dx, (nv, 2 * nv, 3 * nv))
    T = tangent_of(equations, ev)
    k, m, f = sub.k, sub.m, layout.f
    dla = d_multipliers[layout.at_a][: k + m + f] if n else np.zeros((0, p))
    bar = shifts.known + equations._c * np.concatenate((da, dla))
    keep = equations.keeps(ev) if k else np.zeros(0, dtype=bool)
    kept = np.concatenate((keep, keep[sub.of_F]))
    return Tangent(
        sub.index[keep],
        shifts.q + T @ (equations.beta_c * da + dQ),
        shifts.v + equations.gamma_c * da + dU,
        da, bar[:nv], dla[: k + m][kept], bar[nv : nv + k + m][kept], dla[k + m :], bar[nv + k + m :],
        d_dt.copy(), S.t + d_dt,
    ), dependent  # fmt: skip


def as_begun(system: System, solved: Solved, S: Tangent, d_dt: np.ndarray) -> Tangent:
    """The tangent of the start of a part as its equations see it: without open contacts, with another length."""
    given, dt = solved.part.start, solved.part.dt
    open_again = given.contacts[given.auxiliary.la_N_bar == 0.0]
    S = S.of(system, np.setdiff1d(given.contacts, open_again))
    if given.dt != 0.0:
        kept = without_open(system, given)
        bar, s = kept.auxiliary, dt / given.dt
        ds = (d_dt - s * S.dt) / given.dt
        away = np.concatenate((bar.la_N_bar - kept.la_N, bar.la_F_bar - kept.la_F))
        S = replace(
            S,
            a_bar=S.a + s * (S.a_bar - S.a) + np.outer(bar.a_bar - kept.a, ds),
            la_bar=S.la + s * (S.la_bar - S.la) + np.outer(away, ds),
            tau_f_bar=S.tau_f + s * (S.tau_f_bar - S.tau_f) + np.outer(bar.tau_f_bar - kept.tau_f, ds),
        )
    return S.of(system, solved.part.contacts)


def _shifts(solved: Solved, S: Tangent, d_dt: np.ndarray) -> Shifts:
    equations, ev, start = solved.equations, solved.ev, solved.start
    nv, layout, dt, c = equations.nv, equations.layout, equations.dt, equations._c
    af, am, gamma, beta = equations.parameters.coefficients
    y = np.concatenate((start.a, equations.memory[0], start.tau_f))
    bar = start.auxiliary
    y_bar = np.concatenate((bar.a_bar, equations.memory[1], bar.tau_f_bar))
    dy, dy_bar = np.concatenate((S.a, S.la, S.tau_f)), np.concatenate((S.a_bar, S.la_bar, S.tau_f_bar))
    known, d_known = (af * y - am * y_bar) / (1 - am), (af * dy - am * dy_bar) / (1 - am)
    o1, o2 = (1 - gamma) * y_bar + gamma * known, (0.5 - beta) * y_bar + beta * known
    d_o1, d_o2 = (1 - gamma) * dy_bar + gamma * d_known, (0.5 - beta) * dy_bar + beta * d_known
    la = ev.x[3 * nv :][layout.at_a] if equations.n else np.zeros(0)
    now = np.concatenate((ev.x[:nv], la[: len(y) - nv]))
    once = dt * d_o1 + np.outer(o1 + gamma * c * now, d_dt)
    twice = dt * dt * d_o2 + np.outer(2 * dt * (o2 + beta * c * now), d_dt)
    system = equations.system
    q = S.q if system.flat else by_start(system, start.q, ev.dq) @ S.q
    step = dt * S.v + np.outer(start.v, d_dt) + twice[:nv]
    return Shifts(d_known, once, twice, q + tangent_of(equations, ev) @ step, S.v + once[:nv])


def by_start(system: System, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """Derivative of the end of a tangent step by its start, in the tangent spaces of both, shape (nv, nv)."""
    tree = system.tree if system.beams is not None else system.model
    found = np.eye(system.nv)
    if tree.nv:
        found[: tree.nv, : tree.nv] = pin.dIntegrate(tree, q[: tree.nq], dq[: tree.nv])[0]
    return found


def _nearest(A: np.ndarray, b: np.ndarray, first: np.ndarray, smooth: int) -> tuple[np.ndarray, bool]:
    """The solution of A x = -b whose multipliers are nearest to given ones, and whether others solve it as well.

    Args:
        A: scaled, whose first block is regular.
        b: shape (n, p).
        first: where to begin, shape (n, p).
        smooth: size of the first block.
    """
    B, C, E = A[:smooth, smooth:], A[smooth:, :smooth], A[smooth:, smooth:]
    solved = np.linalg.solve(A[:smooth, :smooth], np.concatenate((B, b[:smooth]), axis=1))
    by_multipliers, rest = solved[:, : B.shape[1]], solved[:, B.shape[1] :]
    reduced, right = E - C @ by_multipliers, b[smooth:] - C @ rest
    start = first[smooth:]
    change, _, rank, _ = np.linalg.lstsq(reduced, right + reduced @ start, rcond=RCOND)
    found = start - change
    return np.concatenate((-rest - by_multipliers @ found, found)), bool(rank < len(E))
