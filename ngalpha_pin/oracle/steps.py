"""A step solved, with the impacts in it.

With the laws of the paper a step is R(x) = 0 with all contacts. With those of second order it is that as well where no
contact closes in it. Where one does, the moment at which its gap vanishes is found on smooth steps that end before it;
the step goes smoothly up to there, through the impact as the limit dt -> 0 of the same equations, and on to its end.

Newton's method (143) solves all but a few steps. Where it runs in circles - two contacts that meet an impact at once, a
ball that is caught between two planes and comes to rest with dependent force directions, a rod whose friction locks -
these are tried, in this order, until one of them meets the tolerance (see `solved`):

1. fixed-point iterations (146), with Newton's method from where they have got to;
2. Newton's method with other prox parameters of friction, which choose other index sets on the way (`prox_factors`);
3. of a step of second order, the same three with the laws of the paper, which have a solution in more cases;
4. two steps of half the length, and so on.

A step may have several solutions. With dependent directions the forces are not unique, and friction that displaces the
bodies from the moment of impact on (second order) hands that on to the positions of that step. At the singular time of
the Painleve rod (section 10.4) both laws have a solution, of different motions; that of second order, with a percussion
that has acted all the step long, is not found from the start of the step, so that it is the one of the paper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import brentq

from ngalpha_pin.oracle.equations import Parameters, State, Step, damping, end_of_step, make_step, stiffness
from ngalpha_pin.oracle.impact import CLOSED, consistent, impact
from ngalpha_pin.oracle.kinematics import Motion
from ngalpha_pin.oracle.laws import PAPER, SECOND_ORDER
from ngalpha_pin.oracle.problem import Problem
from ngalpha_pin.oracle.solvers import Scales, Solution, fixed_point, newton

MAX_IMPACTS = 8  # located in one step; what is left of impacts that accumulate is captured
MAX_HALVINGS = 4
SHORT = 1e-6  # parts of a step that are shorter than this part of it are a straight line
FORGET = 1e-12  # an open contact is forgotten when its la_N_bar is below this part of its typical force
OVERSHOOT = 0.1  # see `averaged`
SLIPS, STICKS = 1e12, 0.0  # see `prox_factors`


@dataclass(frozen=True, eq=False)
class Solved:
    """A step that has been solved.

    Attributes:
        state: its end.
        n_iter: corrections and sweeps that it took.
    """

    state: State
    n_iter: int


def solve_step(
    p: Problem,
    parameters: Parameters,
    state: State,
    dt: float,
    impacts: int = MAX_IMPACTS,
    halvings: int = MAX_HALVINGS,
) -> Solved | None:
    """One step of length dt; None where neither it nor its halves are solved.

    Args:
        p: what moves.
        parameters: of the method.
        state: start of the step.
        dt: step [s].
        impacts: how many impacts may be located in it.
        halvings: how often it may be halved.
    """
    every = np.ones(p.n_N, dtype=bool)
    if parameters.laws == PAPER or impacts == 0:
        found = solved(p, parameters, state, dt, every)
    else:
        waited = (_gaps(p, state.q) > CLOSED) & (state.la_N_bar == 0.0)  # open, and free of force
        found = solved(p, parameters, state, dt, ~waited)
        if found is not None and (_gaps(p, found.state.q)[waited] < 0.0).any():
            found = through_impact(p, parameters, state, dt, waited, impacts, halvings)
            found = solved(p, parameters, state, dt, every) if found is None else found
    if found is not None or halvings == 0:
        return found
    first = solve_step(p, parameters, state, dt / 2, impacts, halvings - 1)
    if first is None:
        return None
    second = solve_step(p, parameters, first.state, dt / 2, impacts, halvings - 1)
    return second and Solved(_joined(first.state, second.state), first.n_iter + second.n_iter)


def through_impact(
    p: Problem, parameters: Parameters, state: State, dt: float, waited: np.ndarray, impacts: int, halvings: int
) -> Solved | None:
    """The step through its first impact, with all others behind it; None where that is not found.

    Args:
        p: what moves.
        parameters: of the method.
        state: start of the step.
        dt: step [s].
        waited: contacts that may close, shape (n_N,).
        impacts: as in `solve_step`.
        halvings: likewise.
    """

    def up_to(h: float) -> Solved:
        if h <= SHORT * dt:
            return Solved(_straight(p, state, h), 0)
        found = solved(p, parameters, state, h, ~waited)
        if found is None:
            raise ArithmeticError(f"the smooth part of {h} s is not solved")
        return found

    try:
        h = brentq(lambda h: _gaps(p, up_to(h).state.q)[waited].min(), 0.0, dt, xtol=1e-300, rtol=1e-15)
        before = up_to(h)
    except (ArithmeticError, ValueError):  # a part is not solved, or the gap does not change its sign
        return None
    hit = impact(p, before.state.t, before.state.q, before.state.v)
    if hit is None:
        return None
    after = consistent(p, before.state.t, before.state.q, hit.v)
    rest: Solved | None = Solved(_straight(p, after, dt - h), 0)
    if dt - h > SHORT * dt:
        rest = solve_step(p, parameters, after, dt - h, impacts - 1, halvings)
    if rest is None:
        return None
    end = _joined(replace(after, P_N=hit.P_N, P_F=hit.P_F, La_N=hit.P_N, La_F=hit.P_F), rest.state)
    end = _joined(before.state, end) if h > SHORT * dt else end
    return Solved(replace(end, t=state.t + dt), before.n_iter + rest.n_iter)


def solved(p: Problem, parameters: Parameters, state: State, dt: float, follows: np.ndarray) -> Solved | None:
    """R(x) = 0 of one step, with the contacts that are followed; None where no solver gets there (see above)."""
    start = rescaled(state, dt)
    if dt > state.dt or state.relaxed:
        parameters, start = averaged(p, parameters, start, dt, dt > state.dt)
    n_iter = 0
    for laws in (SECOND_ORDER, PAPER) if parameters.laws == SECOND_ORDER else (PAPER,):
        step = make_step(p, parameters, start, dt, follows, laws)
        tries = [(step, newton, parameters.max_iter), (step, fixed_point, parameters.max_sweeps)]
        tries += [(replace(step, factors=factors), newton, parameters.max_iter) for factors in prox_factors(p)]
        for tried, solver, limit in tries if follows.any() else tries[:1]:
            solution = solver(tried, tried.first, limit)
            n_iter += solution.n_iter
            if solution.converged:
                return Solved(_end(step, solution), n_iter)
    return None


def prox_factors(p: Problem) -> list[np.ndarray]:
    """Factors on the prox parameters of friction, shape (n_N,) each: for a few contacts first, for all at last.

    A normal cone inclusion has the same solutions with any r > 0, but another way to them: with a large r a contact
    that slips at all is taken as slipping, without one it sticks as long as its percussion is in the cone. The slip law
    of second order is such an inclusion only where La_N >= 0; where La_N < 0, small, it takes the large r to slip.
    """
    with_friction = [k for k, contact in enumerate(p.contacts) if contact.rows]
    return [
        np.where(np.isin(np.arange(p.n_N), some), factor, 1.0)
        for factor in (SLIPS, STICKS)
        for n in range(1, len(with_friction) + 1)
        for some in combinations(with_friction[::-1], n)
    ]


def rescaled(state: State, dt: float) -> State:
    """The state as a step of another length starts from it.

    By (71) a_bar approximates a at t + (alpha_m - alpha_f) dt, so its distance from a is proportional to dt.
    """
    if state.dt in (0.0, dt):
        return state
    s = dt / state.dt
    return replace(
        state,
        a_bar=state.a + s * (state.a_bar - state.a),
        la_N_bar=state.la_N + s * (state.la_N_bar - state.la_N),
        la_F_bar=state.la_F + s * (state.la_F_bar - state.la_F),
        dt=dt,
    )


def averaged(p: Problem, parameters: Parameters, state: State, dt: float, longer: bool) -> tuple[Parameters, State]:
    """The state from which a step starts that is longer than the one before, and its coefficients; not of the paper.

    A vibration that the short rest of a step behind an impact resolves, and this one does not, would make velocities
    out of nothing: ((1 - rho_inf)/2)^2 dt a in a step with omega dt far above one, and more where it is damped. Where
    that is more than `OVERSHOOT` of a velocity, the step relaxes: it is one of implicit Euler whose accelerations at
    the start, which only positions see, are averaged over it twice, with M + D + K for M. The one after it, if
    it is not longer still, starts from accelerations that are averaged once, with M + gamma_c D + beta_c K.
    Of the systems of the paper only the beam of the hopper is as stiff as that.
    """
    if not p.beams:
        return parameters, state
    M = Motion(p, state.t, state.q, state.v, state.a).M
    K, D = dt**2 * stiffness(p, state), dt * damping(p, state)
    alpha_f, alpha_m = parameters.coefficients[:2]
    by_M = np.sqrt(np.outer(M.diagonal(), M.diagonal()))
    squared, damped = float((np.abs(K) / by_M).max()), float((np.abs(D) / by_M).max())
    passed = max(np.sqrt(squared), (alpha_f - alpha_m) * squared, damped)
    if ((1 - parameters.rho_inf) / 2) ** 2 * passed <= OVERSHOOT:
        return parameters, state
    parameters = replace(parameters, relaxes=longer)
    alpha_f, alpha_m, gamma, beta = parameters.coefficients
    resists = M + (1 - alpha_f) / (1 - alpha_m) * (gamma * (D + D.T) + beta * (K + K.T)) / 2
    if parameters.relaxes:
        resists = resists @ np.linalg.solve(M, resists)
    return parameters, replace(consistent(p, state.t, state.q, state.v, resists), dt=dt)


def _end(step: Step, solution: Solution) -> State:
    """The state at the end of a step that has been solved."""
    s, u, end = step.start, step.split(solution.x), end_of_step(step, solution.x)
    gaps = np.array([c.g_N for c in end.motion.contacts])
    none = FORGET * step.split(Scales(step).x).la_N
    la_N = np.where(np.abs(u.la_N) > none, u.la_N, 0.0)  # whether a contact has carried is no matter of rounding
    kept = (np.abs(end.la_N_bar) > none) | (gaps <= CLOSED)
    kept_F = np.repeat(kept, [len(contact.rows) for contact in step.problem.contacts])
    P_N, P_F = np.array([z.P_N for z in end.forces]), np.concatenate([np.zeros(0), *(z.P_F for z in end.forces)])
    return State(
        s.t + step.dt, end.motion.q, end.motion.v, u.a, end.a_bar,
        la_N, np.where(kept, end.la_N_bar, 0.0), u.la_F, np.where(kept_F, end.la_F_bar, 0.0), u.la_g, step.dt,
        P_N, P_F, u.La_N, u.La_F, step.parameters.relaxes,
    )  # fmt: skip


def _gaps(p: Problem, q: np.ndarray) -> np.ndarray:
    still = np.zeros(p.nv)
    return np.array([c.g_N for c in Motion(p, 0.0, q, still, still).contacts])


def _straight(p: Problem, state: State, h: float) -> State:
    """The state a moment later, where h^2 does not count."""
    return replace(state, t=state.t + h, q=p.moved(state.q, h * state.v), v=state.v + h * state.a)


def _joined(first: State, second: State) -> State:
    """The second part of a step, with the percussions of both."""
    return replace(
        second,
        P_N=first.P_N + second.P_N,
        P_F=first.P_F + second.P_F,
        La_N=first.La_N + second.La_N,
        La_F=first.La_F + second.La_F,
    )
