"""Steps one after the other: a step solved, an impact located in it, a whole motion.

With the laws of the paper a step is R(x) = 0 with all contacts. With those of second order it is that as well where no
contact closes in it; where one does, the moment at which its gap vanishes is found, and the step goes smoothly up to
there, through the impact as the limit dt -> 0 of the same equations, and on to its end, see `through_impact`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import brentq

from .impact import CLOSED, Impact, consistent, impact
from .kinematics import Motion, movable
from .laws import LAWS, PAPER, SECOND_ORDER
from .problem import NotConverged, Problem, Scene, SceneError, compile_scene
from .step import Parameters, Solution, State, Step, damping, end_of_step, fixed_point, newton, stiffness

MAX_IMPACTS = 8  # located in one step; what is left of impacts that accumulate is captured
MAX_HALVINGS = 4
SHORT = 1e-6  # parts of a step that are shorter than this part of it are a straight line
FORGET = 1e-12  # an open contact is forgotten when its la_N_bar is below this part of the typical force
OVERSHOOT = 0.1  # see `averaged`


@dataclass(frozen=True, eq=False)
class Motions:
    """A motion as arrays, time along the first axis.

    Attributes:
        t, q, v, a: shapes (n + 1,), (n + 1, nq), (n + 1, nv), (n + 1, nv).
        P_N, La_N, la_N: of all contacts, shape (n + 1, n_N) [N s], [N s], [N].
        P_F, La_F, la_F: of all friction velocities, shape (n + 1, n_F).
        n_iter: corrections and sweeps of every step, shape (n + 1,).
        states: the states themselves.
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    P_N: np.ndarray
    La_N: np.ndarray
    la_N: np.ndarray
    P_F: np.ndarray
    La_F: np.ndarray
    la_F: np.ndarray
    n_iter: np.ndarray
    states: tuple[State, ...]


def simulate(
    scene: Scene | Problem,
    q0: np.ndarray | None = None,
    v0: np.ndarray | None = None,
    *,
    t_end: float,
    dt: float,
    rho_inf: float = 0.5,
    laws: str = SECOND_ORDER,
    state: State | None = None,
) -> Motions:
    """Integrate a scene from its initial values, or from a state, with fixed steps.

    Args:
        scene: with nothing but what the systems of the paper have, or its `problem`.
        q0: initial configuration, shape (nq,).
        v0: initial velocity, shape (nv,); None is rest.
        t_end: end of the run [s]; the last step ends at the nearest multiple of dt.
        dt: step [s].
        rho_inf: spectral radius at infinite frequency (72) [-].
        laws: "paper" or "second-order".
        state: start from here instead of q0 and v0.

    Raises:
        SceneError: the scene has something else. NotConverged: a step was not solved.
    """
    if laws not in LAWS:
        raise SceneError(f"laws {laws!r} are unknown; choose one of {', '.join(LAWS)}")
    p = scene if isinstance(scene, Problem) else problem(scene)
    if state is None:
        if q0 is None:
            raise SceneError("the oracle starts from q0 and v0, or from a state")
        q = np.array(q0, dtype=float)
        state = consistent(p, 0.0, q, np.zeros(p.nv) if v0 is None else np.array(v0, dtype=float))
    parameters, states, n_iter = Parameters(rho_inf, laws), [state], [0]
    for _ in range(round((t_end - state.t) / dt)):
        found = solve_step(p, parameters, states[-1], dt)
        if found is None:
            raise NotConverged(f"the step from t = {states[-1].t:.6g} s did not converge", states[-1].t)
        states.append(found.state)
        n_iter.append(found.n_iter)
    names = ("t", "q", "v", "a", "P_N", "La_N", "la_N", "P_F", "La_F", "la_F")
    return Motions(*(np.array([getattr(s, name) for s in states]) for name in names), np.array(n_iter), tuple(states))


def problem(scene: Scene) -> Problem:
    """The problem of a scene; see `problem.compile_scene`."""
    return movable(compile_scene(scene))


@dataclass(frozen=True, eq=False)
class Found:
    """A step that has been solved: its end, and the corrections and sweeps that it took."""

    state: State
    n_iter: int


def solve_step(
    p: Problem,
    parameters: Parameters,
    state: State,
    dt: float,
    impacts: int = MAX_IMPACTS,
    halvings: int = MAX_HALVINGS,
) -> Found | None:
    """One step of length dt; in two halves where it is not solved, and None where they are not solved either.

    Args:
        p: what moves.
        parameters: of the method.
        state: start of the step.
        dt: step [s].
        impacts: how many impacts may be located in it.
        halvings: how often it may be halved.
    """
    if parameters.laws == SECOND_ORDER and impacts > 0:
        followed = _followed(p, state)
        trial = _solve(p, parameters, state, dt, followed)
        if trial is not None:
            if not (_gaps(p, trial.state.q)[~followed] < 0.0).any():
                return trial
            divided = through_impact(p, parameters, state, dt, followed, impacts, halvings)
            if divided is not None:
                return divided
            trial = _solve(p, parameters, state, dt, np.ones(p.n_N, dtype=bool))
    else:
        trial = _solve(p, parameters, state, dt, np.ones(p.n_N, dtype=bool))
    if trial is not None or halvings == 0:
        return trial
    first = solve_step(p, parameters, state, dt / 2, impacts, halvings - 1)
    second = first and solve_step(p, parameters, first.state, dt / 2, impacts, halvings - 1)
    if not first or not second:
        return None
    return Found(_joined(first.state, second.state), first.n_iter + second.n_iter)


def through_impact(
    p: Problem, parameters: Parameters, state: State, dt: float, followed: np.ndarray, impacts: int, halvings: int
) -> Found | None:
    """The step through the first impact in it, with all others behind it; None where that is not found."""
    n_iter = 0

    def part(h: float) -> State:
        nonlocal n_iter
        if h <= SHORT * dt:
            return _straight(p, state, h)
        found = _solve(p, parameters, state, h, followed)
        if found is None:
            raise ArithmeticError
        n_iter += found.n_iter
        return found.state

    def smallest_gap(h: float) -> float:
        return float(_gaps(p, part(h).q)[~followed].min())

    try:
        h = brentq(smallest_gap, 0.0, dt, xtol=1e-300, rtol=4 * np.finfo(float).eps)
        before = part(h)
    except (ArithmeticError, ValueError):
        return None
    hit = impact(p, before.t, before.q, before.v)
    if hit is None:
        return None
    after = consistent(p, before.t, before.q, hit.v)
    if dt - h <= SHORT * dt:
        rest = Found(_straight(p, after, dt - h), 0)
    else:
        found = solve_step(p, parameters, after, dt - h, impacts - 1, halvings)
        if found is None:
            return None
        rest = found
    end = _joined(replace(after, P_N=hit.P_N, P_F=hit.P_F, La_N=hit.P_N, La_F=hit.P_F), rest.state)
    if h > SHORT * dt:
        end = _joined(before, end)
    return Found(replace(end, t=state.t + dt), n_iter + rest.n_iter)


def _solve(p: Problem, parameters: Parameters, state: State, dt: float, followed: np.ndarray) -> Found | None:
    """R(x) = 0 of one step (143), (146), with the contacts that are followed; None where no solver gets there.

    Newton's method alone solves all but a few steps. Where it runs in circles - an impact of several contacts, a ball
    that is caught between two planes, a catastrophe of friction - fixed-point iterations go on. A step that has no
    solution with friction from the moment of impact on takes the laws of the paper.
    """
    longer = dt > state.dt
    start = rescaled(state, dt)
    if longer:
        start = averaged(p, parameters, start, dt)
    n_iter = 0
    for laws in (SECOND_ORDER, PAPER) if parameters.laws == SECOND_ORDER else (PAPER,):
        step = Step(p, parameters, start, dt, followed, laws)
        tries = [(step, newton, parameters.max_iter), (step, fixed_point, parameters.max_sweeps)]
        tries += [(replace(step, factors=factors), newton, parameters.max_iter) for factors in prox_factors(p)]
        for tried, solver, limit in tries:
            solution = solver(tried, tried.first, limit)
            n_iter += solution.n_iter
            if solution.converged:
                return Found(_end(step, solution), n_iter)
            if not followed.any():
                return None
    return None


def prox_factors(p: Problem) -> list[np.ndarray]:
    """Factors on the prox parameters of friction where the usual ones lead to no solution, few contacts first.

    A normal cone inclusion has the same solutions with any r > 0, but another way to them; with much r a contact that
    slips at all is taken as slipping, with none one that sticks as long as its percussion is in the cone. The slip law
    of second order is not quite such an inclusion: where La_N < 0 its solutions are those of much r.
    """
    with_friction = [k for k, contact in enumerate(p.contacts) if contact.rows]
    found = []
    for factor in (1e12, 0.0):
        for n in range(1, len(with_friction) + 1):
            for some in combinations(with_friction[::-1], n):
                found.append(np.where(np.isin(np.arange(p.n_N), some), factor, 1.0))
    return found


def _end(step: Step, solution: Solution) -> State:
    """The state at the end of a step that has been solved."""
    s, u, end = step.start, step.split(solution.x), end_of_step(step, solution.x)
    unit = step.scales.x[step.split(np.arange(len(solution.x))).la_N]
    gaps = np.array([c.g_N for c in end.motion.contacts])
    kept = (np.abs(end.la_N_bar) > FORGET * unit) | (gaps <= CLOSED)
    kept_F = np.repeat(kept, [len(contact.rows) for contact in step.problem.contacts])
    P_N, P_F = np.array([z.P_N for z in end.forces]), np.concatenate([np.zeros(0), *(z.P_F for z in end.forces)])
    return State(
        s.t + step.dt, end.q, end.v, u.a, end.a_bar,
        u.la_N, np.where(kept, end.la_N_bar, 0.0), u.la_F, np.where(kept_F, end.la_F_bar, 0.0), u.la_g, step.dt,
        P_N, P_F, u.La_N, u.La_F,
    )  # fmt: skip


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


def averaged(p: Problem, parameters: Parameters, state: State, dt: float) -> State:
    """A state from which a step may start that is longer than the one before, not of the paper.

    A vibration that the short rest of a step behind an impact resolves, and this one does not, would make velocities
    out of nothing: ((1 - rho_inf)/2)^2 dt a in a step with omega dt far above one. Where that is more than `OVERSHOOT`
    of a velocity, the step starts from accelerations that are averaged over it, with M + gamma_c D + beta_c K for M.
    Only bodies that are flexible are as stiff as that.
    """
    if not p.scene.beams:
        return state
    M, K, D = Motion(p, state.t, state.q, state.v, state.a).M, dt**2 * stiffness(p, state), dt * damping(p, state)
    alpha_f, alpha_m, gamma, beta = parameters.coefficients
    of_M = np.sqrt(np.outer(M.diagonal(), M.diagonal()))
    squared, damped = float((np.abs(K) / of_M).max()), float((np.abs(D) / of_M).max())
    passed = max(np.sqrt(squared), (alpha_f - alpha_m) * squared, damped)
    if ((1 - parameters.rho_inf) / 2) ** 2 * passed <= OVERSHOOT:
        return state
    symmetric = (gamma * (D + D.T) + beta * (K + K.T)) / 2
    smooth = consistent(p, state.t, state.q, state.v, M + (1 - alpha_f) / (1 - alpha_m) * symmetric)
    return replace(smooth, dt=dt)


def _followed(p: Problem, state: State) -> np.ndarray:
    """Contacts that are not waited for: closed at the start of a step, or not yet free of force, shape (n_N,)."""
    return (_gaps(p, state.q) <= CLOSED) | (state.la_N_bar != 0.0)


def _gaps(p: Problem, q: np.ndarray) -> np.ndarray:
    still = np.zeros(p.nv)
    return np.array([c.g_N for c in Motion(p, 0.0, q, still, still).contacts])


def _straight(p: Problem, state: State, h: float) -> State:
    """The state a moment later, where h^2 does not count."""
    return replace(state, t=state.t + h, q=p.moved(state.q, h * state.v), v=state.v + h * state.a)


def _joined(first: State, second: State) -> State:
    """The second part of a step, with the percussions of both."""
    return replace(second, **{name: getattr(first, name) + getattr(second, name) for name in ("P_N", "P_F", "La_N", "La_F")})
