"""Newton's method where motors run into their effort limits.

A stiff servo on a light joint is a steep slope between two flat ends, and from one end Newton's method jumps to the
other. With every motor held either on its slope or at one of its limits the equations are smooth in it; from the slope
the solution shows which limits are passed. Where that leads nowhere, the motors are taken into the contact problem of
the velocities: a servo is dry friction with a compliance and a wish, its torque is within bounds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ngalpha_pin.common.tolerances import CONE
from ngalpha_pin.numerics.block_matrix import solve
from ngalpha_pin.numerics.gauss_seidel import forces_of_closed_contacts
from ngalpha_pin.step.equations import StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.linearised_round import SWEEP_TOL, prox_round
from ngalpha_pin.step.newton import semi_smooth_newton
from ngalpha_pin.step.newton_matrix import stiffness
from ngalpha_pin.step.options import LawOptions

ROUNDS = 12  # in which coordinates may reach their limits or leave them: each moves some, none comes back often
AT_LIMIT = 1 - CONE  # what counts as the limit of a motor in the contact problem


def newton_within_efforts(
    equations: StepEquations,
    evaluation: Evaluation,
    max_iter: int,
    growth: float | None = None,
    smallest_forces: bool = False,
) -> tuple[Evaluation, bool, int, bool]:
    """See `semi_smooth_newton`; where that fails, motors are held on their slopes or at their limits.

    Motors that pass no limit at the first iterate nor at the last one are no reason for the failure: there dry friction
    in joints may be, which Newton's method finds with its monotone law, also where a slip is about to end.
    """
    found = semi_smooth_newton(equations, evaluation, max_iter, growth, smallest_forces)
    laws = replace(evaluation.options, monotone=True)
    limited = not found[1] and (at_limits(equations, found[0]) or at_limits(equations, evaluation))
    rubs = equations.layout.f > 0 and not (evaluation.options.monotone or laws.paper)
    if found[1] or not (limited or rubs):
        return found
    n_iter, dependent = found[2], found[3]
    if not limited:
        start = equations.evaluate(evaluation.x, laws)
        held, converged, n, minimum_norm = semi_smooth_newton(equations, start, max_iter, growth, smallest_forces)
        return (held if converged else found[0]), converged, n_iter + n, dependent | minimum_norm
    of_problem = motors_at_limits(equations, laws)
    slopes = np.zeros_like(of_problem)
    for first in (of_problem, slopes) if of_problem.any() else (slopes,):
        held, n, minimum_norm = motors_held(equations, laws, first, max_iter, smallest_forces)
        n_iter, dependent = n_iter + n, dependent | minimum_norm
        start = equations.evaluate(held.x, laws)
        evaluation, converged, n, _ = semi_smooth_newton(equations, start, max_iter, None, smallest_forces)
        n_iter += n
        if converged:
            break
    return evaluation, converged, n_iter, dependent


def at_limits(equations: StepEquations, ev: Evaluation) -> bool:
    """A motor has passed its limit."""
    return equations.system.effort is not None and bool(_passed(equations, ev).any())


def _passed(equations: StepEquations, ev: Evaluation) -> np.ndarray:
    """Sides of the limits that the torques that the motors are asked for have passed, see `System.passed_limits`."""
    state = equations.state
    return equations.system.passed_limits(state.t + equations.dt, ev.q, ev.v, state.actuation)


def motors_held(
    equations: StepEquations, laws: LawOptions, sides: np.ndarray, max_iter: int, smallest_forces: bool = False
) -> tuple[Evaluation, int, bool]:
    """The step with motors held, first at the given sides, then at those whose limits they have passed.

    Returns:
        The last evaluation, the number of corrections, and whether any of them had dependent directions.
    """
    n_iter, dependent, of_problem = 0, False, sides.any()
    seen: set[bytes] = set()
    for _ in range(ROUNDS):
        start = equations.evaluate(equations.start(), replace(laws, held=sides))
        if of_problem and equations.n:
            start = equations.evaluate(prox_round(equations, start)[0], start.options)
        held, converged, n, minimum_norm = semi_smooth_newton(equations, start, max_iter, None, smallest_forces)
        n_iter, dependent = n_iter + n, dependent | minimum_norm
        passed = _passed(equations, held)
        if np.array_equal(passed, sides) or not (converged or of_problem):
            break
        # between its two limits a motor has its slope; and where sides come back, one motor after the other is let go
        seen.add(sides.tobytes())
        moves = np.clip(passed - sides, -1, 1)
        if (sides + moves).tobytes() in seen:
            moves[np.flatnonzero(moves)[1:]] = 0
        sides = sides + moves
    return held, n_iter, dependent


def motors_at_limits(equations: StepEquations, laws: LawOptions) -> np.ndarray:
    """Which motors are at their limits: 1 and -1, from the contact problem of the velocities with all of them in it.

    With a motor at a limit its slope is out of the equations. Its percussion P then takes the place of that limit; on
    the slope, the velocity v of its joint fulfils v - v_0 + (P - P_0) / d = 0, with the servo's own P_0 at v_0.
    """
    system, sub, layout, gamma_c = equations.system, equations.sub, equations.layout, equations.gamma_c
    assert system.effort is not None
    lower, upper = system.effort
    limited = np.isfinite(lower) & np.isfinite(upper)
    sides = np.zeros(len(lower), dtype=int)
    if layout.kb + layout.mb or system.beams is not None:
        return sides
    ev = equations.evaluate(equations.start(), replace(laws, held=limited.astype(int)))
    asked, K, D = system.demands(equations.state.t + equations.dt, ev.q, ev.v, equations.state.actuation)
    d = -(gamma_c * D + equations.beta_c * K).diagonal()
    i = np.flatnonzero(limited & (d > 0.0))
    if len(i) == 0:
        return sides
    k, j = sub.k, layout.rows
    W = np.concatenate((ev.W if j else np.zeros((0, equations.nv)), np.eye(equations.nv)[i]))
    G = W @ solve(stiffness(equations, ev)[0], W.T)
    if equations.immovable is not None:
        G = equations.immovable.resists(G, sub.k)
    Z, H = equations.linearise(ev)
    v = ev.v + gamma_c * Z[: equations.nv, -1] + Z[equations.nv : 2 * equations.nv, -1]
    P = np.concatenate((equations.row_forces(ev)[1] if j else [], gamma_c * upper[i]))
    y = np.concatenate((ev.y[layout.at_v] + H[layout.at_v, -1] if j else [], (v - ev.v)[i] - gamma_c * asked[i] / d[i]))
    b = y - G @ P
    G[j + np.arange(len(i)), j + np.arange(len(i))] += 1.0 / d[i]
    touches = ev.y[:k] + H[:k, -1] <= 0.0 if k else np.zeros(0, dtype=bool)
    own = equations.friction_bounds(laws)
    bounds = np.concatenate((own[0], gamma_c * lower[i])), np.concatenate((own[1], gamma_c * upper[i]))
    given, of = (G, b, sub.cones.mu, sub.cones.of_row, touches, np.zeros(sub.m), SWEEP_TOL), sub.cones.contact
    found, _ = forces_of_closed_contacts(*given, bounds=bounds, of_cone=of)
    sides[i] = (found[j:] >= AT_LIMIT * gamma_c * upper[i]).astype(int) - (found[j:] <= AT_LIMIT * gamma_c * lower[i])
    return sides
