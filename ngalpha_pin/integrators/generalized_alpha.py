"""One step of the nonsmooth generalized-alpha method.

G. Capobianco, J. Harsch, S. R. Eugster, R. I. Leine: A nonsmooth generalized-alpha method for mechanical systems with
frictional contact, International Journal for Numerical Methods in Engineering 122 (2021) 6497-6526,
doi:10.1002/nme.6801. Equation numbers in this package are those of the paper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ngalpha_pin.errors import NotConverged, SceneError
from ngalpha_pin.initialization.initial import CLOSED
from ngalpha_pin.integrators.impact_splitting import MAX_IMPACTS, through_impact, without_impact
from ngalpha_pin.integrators.restart import without_unresolved
from ngalpha_pin.step_equations.compiled import step_equations
from ngalpha_pin.step_equations.contact_history import join_percussions, keep_contacts, memory
from ngalpha_pin.step_equations.equations import StepEquations
from ngalpha_pin.step_equations.evaluation import Evaluation
from ngalpha_pin.step_solvers.cascade import solve
from ngalpha_pin.step_solvers.linearised_round import prox_round
from ngalpha_pin.system.contact_search import add_missing, has_rims, load_slots, not_solid, successors
from ngalpha_pin.system.state import State, StepResult
from ngalpha_pin.system.system import System

MAX_HALVINGS = 4
# contacts whose gap is below this many times the possible motion of one step are looked at in every step
NEAR_STEPS = 16.0
# when more than this many of them are open and the motion has become slow, the contacts are looked through again
CROWD, RELAXED = 8, 1000.0
# with more contacts than this, a step is not divided at impacts: each would take some steps of all of them
DIVIDED = 12
LAWS = ("second-order", "paper")
SOLVERS = ("auto", "newton", "fixed_point")


@dataclass(frozen=True)
class GeneralizedAlpha:
    """The method and its parameters.

    Attributes:
        rho_inf: spectral radius at infinite frequency (72) [-], in [0, 1]: 1 keeps energy, 0 damps most.
        solver: "auto" climbs the ladder Newton, fixed-point iterations, halved step; "newton", "fixed_point" use one.
        tol: residual of every equation, relative to the typical force of the step, in any units [-].
        max_iter: Newton corrections of one attempt.
        laws: "second-order" lets a frictional impulse act from the moment of impact and only impulses follow the slip
            direction at the end of the step; "paper" is (80) and (112) to the letter, of first order there.
    """

    rho_inf: float = 0.5
    solver: str = "auto"
    tol: float = 1e-10
    max_iter: int = 30
    laws: str = "second-order"

    def __post_init__(self) -> None:
        """Check ranges."""
        if not 0.0 <= self.rho_inf <= 1.0:
            raise SceneError(f"rho_inf = {self.rho_inf} must be in [0, 1]")
        if self.solver not in SOLVERS:
            raise SceneError(f"solver {self.solver!r} is unknown; choose one of {', '.join(SOLVERS)}")
        if self.laws not in LAWS:
            raise SceneError(f"laws {self.laws!r} are unknown; choose one of {', '.join(LAWS)}")
        if not (0.0 < self.tol < 1e-2 and self.max_iter >= 1):
            raise SceneError("tol must be in (0, 1e-2) and max_iter at least 1")

    @property
    def paper(self) -> bool:
        """The laws are those of the paper to the letter."""
        return self.laws == "paper"

    @property
    def alpha_m(self) -> float:
        """(72)."""
        return (2 * self.rho_inf - 1) / (self.rho_inf + 1)

    @property
    def alpha_f(self) -> float:
        """(72)."""
        return self.rho_inf / (self.rho_inf + 1)

    @property
    def gamma(self) -> float:
        """(72)."""
        return 0.5 + self.alpha_f - self.alpha_m

    @property
    def beta(self) -> float:
        """(72)."""
        return 0.25 * (0.5 + self.gamma) ** 2

    @cached_property
    def coefficients(self) -> tuple[float, float, float, float]:
        """alpha_f, alpha_m, gamma and beta (72)."""
        return self.alpha_f, self.alpha_m, self.gamma, self.beta

    def step(self, system: System, state: State, dt: float) -> StepResult:
        """One step of length dt; where it does not converge, it is halved, up to `MAX_HALVINGS` times."""
        # an iterate that runs away is recognised by its residual
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            halvings = MAX_HALVINGS if self.solver == "auto" else 0
            whole = self.paper or _undivided(state)
            tries = [(halvings, 0 if whole else MAX_IMPACTS)]
            if whole and not self.paper and system.trees is not None:
                # where many bodies do not let the step be captured, it is divided at its impacts before it is halved
                tries = [(0, 0), (0, MAX_IMPACTS), *tries]
            for tried in tries:
                result = self.ladder(system, state, dt, *tried)
                if result.converged:
                    break
            return result if result.state.dt == dt else replace(result, state=replace(result.state, whole=dt))

    def ladder(self, system: System, state: State, dt: float, halvings: int, impacts: int) -> StepResult:
        """The step, divided at up to so many impacts and halved so many times where it does not converge."""
        result = self.attempt(system, state, dt, until_closing=impacts > 0)
        if result.converged and len(result.closing):
            divided = through_impact(self, system, state, dt, result, halvings, impacts)
            if divided is not None:
                return divided
            result = self.attempt(system, state, dt)
        if not result.converged and self.solver == "auto" and has_rims(system):
            # a rim that comes down nearly flat: its lowest point runs too fast
            again = self.attempt(system, state, dt, follow_rims=False)
            result = replace(again, n_iter=again.n_iter + result.n_iter)
        if result.converged or halvings == 0:
            return result
        first = self.ladder(system, state, dt / 2, halvings - 1, impacts)
        if not first.converged:
            return replace(result, n_iter=result.n_iter + first.n_iter)
        second = self.ladder(system, first.state, dt / 2, halvings - 1, impacts)
        n_iter = result.n_iter + first.n_iter + second.n_iter
        joined = join_percussions(system, first.state, second.state)
        impacts_of_both = (*first.impacts, without_impact(system, first.state), *second.impacts)
        return StepResult(joined, second.converged, n_iter, "halved", second.residual, impacts_of_both)

    def attempt(
        self,
        system: System,
        state: State,
        dt: float,
        until_closing: bool = False,
        follow_rims: bool = True,
        features: State | None = None,
    ) -> StepResult:
        """The step without halving: solve with the contacts that carry force, test the gaps of the others, repeat.

        Args:
            system: compiled scene.
            state: start of the step.
            dt: step [s].
            until_closing: leave out the contacts that are open at the start and close within the step, and name them.
            follow_rims: the lowest point of a rim moves around it in the step; otherwise it is fixed in the body.
            features: end of a longer step from the same start whose features of shapes are taken.
        """
        longer = dt > state.dt
        # among many, contacts that close without further impulses are unknowns from the beginning, and those whose
        # percussions have done all of the work of the step before
        many = self.solver == "auto" and system.trees is not None and _undivided(state)
        state = rescale(state if many and not state.la_N.any() else _without_open(system, state), dt)
        if longer:
            state = without_unresolved(self, system, state, dt)
        table = system.contacts
        near, clearance, looked = state.near, state.clearance, table.n == 0
        contacts, n_iter, fresh = state.contacts, 0, state.near[:0]
        known: tuple[StepEquations, Evaluation] | None = None
        foresees = many and not until_closing
        if features is not None and system.slots.n:
            system.slots.restore(features.slots)
            near, clearance, looked = features.near, features.clearance, True
        elif system.slots.n:
            (near, clearance), looked = screen(system, state, system.gap_motion(dt * state.v)), True
            near = np.union1d(near, load_slots(system, state, dt if follow_rims else None))
            contacts = np.union1d(contacts, successors(system, state))
        while True:
            known_of = memory(system, state, contacts)
            equations = step_equations(system, self, state, dt, table.subset(contacts), known_of)
            if not looked:
                (near, clearance), looked = screen(system, state, equations.motion), True
            evaluation = equations.evaluate(equations.start())
            if foresees:
                foresees, (closing, near) = False, _closing(system, near, contacts, evaluation.q)
                if len(closing):
                    contacts = np.union1d(contacts, closing)
                    continue
            more = len(contacts) > len(state.contacts)
            captures = many and more
            if captures and known is not None:  # the scales of the step are those of the usual start
                evaluation = equations.evaluate(equations.start_from(*known))
            if more and len(contacts) > 1 and self.solver == "auto" and not captures:
                # several contacts close at once: all of them closed would be a poor guess of the index sets
                evaluation = equations.evaluate(prox_round(equations, evaluation)[0])
            evaluation, converged, n, rung = solve(self, equations, evaluation, captures)
            known = equations, evaluation
            n_iter += n
            if table.n == 0 or not converged:
                break
            spent = equations.spent(evaluation)
            if not clearance > spent:  # the motion was larger than foreseen: no contact is known to be open
                near, clearance = np.union1d(near, not_solid(system)), -np.inf
            closing, near = _closing(system, near, contacts, evaluation.q)
            if until_closing and len(closing):
                fresh = _open(system, state, closing)
                closing = np.setdiff1d(closing, fresh)
            if not len(closing):
                clearance = clearance - spent if np.isfinite(spent) else clearance
                break
            if many:  # captured, which needs no choice
                contacts = np.union1d(contacts, closing)
            else:
                contacts = _choose_contacts(self, system, state, dt, contacts, closing)
        end = _end(equations, evaluation, near, clearance)
        return StepResult(end, converged, n_iter, rung, evaluation.error, closing=fresh)

    def not_converged(self, system: System, state: State, dt: float, result: StepResult) -> NotConverged:
        """The error of a step that failed, with the contacts involved and what to try."""
        names = tuple(system.contacts.names[i] for i in np.union1d(state.contacts, result.state.contacts))
        involved = f" with {', '.join(names[:6])}{' ...' if len(names) > 6 else ''} in contact" if names else ""
        return NotConverged(
            f"the step from t = {state.t:.6g} s of dt = {dt:.3g} s did not converge{involved} "
            f"(residual {result.residual:.1e} times the tolerance after {result.n_iter} iterations)"
            f"{_worst_constraint(system, result.state)}; try a smaller dt, "
            "rho_inf closer to 0, or solver='auto'; on_failure='stop' returns what there is",
            state.t,
            names,
        )


def _worst_constraint(system: System, state: State) -> str:
    """The constraint that is furthest from being fulfilled in a step that failed."""
    if not system.constraints.names or not np.isfinite([*state.q, *state.v, *state.a]).all():
        return ""
    system.dynamics(state.t, state.q, state.v, state.a)
    rates = np.abs(system.constraint_rows(state.t, state.q, state.v, state.a).rate)
    worst = int(np.argmax(rates))
    return f"; the constraint {system.constraints.names[worst]!r} is off by {rates[worst]:.1e} /s"


def _undivided(state: State) -> bool:
    """So many contacts are closed that a step is not divided at impacts."""
    return len(state.contacts) > DIVIDED


def rescale(state: State, dt: float) -> State:
    """Carry the auxiliary variables over to another step size.

    a_bar approximates a at t + (alpha_m - alpha_f) dt (71), so its distance from a is proportional to dt.
    """
    if state.dt in (0.0, dt):
        return state
    s = dt / state.dt
    return replace(
        state,
        a_bar=state.a + s * (state.a_bar - state.a),
        la_N_bar=state.la_N + s * (state.la_N_bar - state.la_N),
        la_F_bar=state.la_F + s * (state.la_F_bar - state.la_F),
        tau_f_bar=state.tau_f + s * (state.tau_f_bar - state.tau_f),
        dt=dt,
    )


def _without_open(system: System, state: State) -> State:
    """The state without the contacts that it only reports on, because they carried a percussion and are open again."""
    remembers = state.la_N_bar != 0.0
    return state if remembers.all() else keep_contacts(system, state, remembers)


def _open(system: System, state: State, contacts: np.ndarray) -> np.ndarray:
    """Those of some contacts that are open at a state."""
    system.place(state.q)
    gaps = system.gaps(system.contacts.subset(contacts), state.q)
    return contacts[gaps > CLOSED * system.contacts.yardstick[contacts]]


def _choose_contacts(
    method: GeneralizedAlpha, system: System, state: State, dt: float, contacts: np.ndarray, closing: np.ndarray
) -> np.ndarray:
    """The contacts so far, and of those that could close those that carry a percussion when all of them are there.

    Many corners of a foot penetrate where one touches; as unknowns they would be nearly dependent directions.
    """
    candidates = np.union1d(contacts, closing)
    if len(closing) == 1 or method.solver != "auto":
        return candidates
    sub = system.contacts.subset(candidates)
    equations = step_equations(system, method, state, dt, sub, memory(system, state, candidates))
    carries = prox_round(equations, equations.evaluate(equations.start()))[1].A
    chosen = np.union1d(contacts, candidates[carries])
    return chosen if len(chosen) > len(contacts) else candidates


def screen(system: System, state: State, motion: float) -> tuple[np.ndarray, float]:
    """Contacts to look at in this step, and by how much the others can still move before one could close [m].

    While the clearance of the last look lasts, nothing is computed for the contacts that are far away. Pairs of solids
    have their own way, see `broad_phase`.

    Args:
        system: compiled scene.
        state: start of the step.
        motion: by how much a gap changes in this step, roughly and at most [m].
    """
    table, every = system.contacts, not_solid(system)
    known = state.near[(state.near < table.n_fixed) | (state.near >= table.n_points)]
    crowded = len(known) > len(state.contacts) + CROWD
    if state.clearance > 2.0 * motion and not (crowded and state.clearance > RELAXED * motion):
        return known, state.clearance
    if not np.isfinite(motion):  # a point can be any distance away from a joint that turns
        return every, np.inf
    system.place(state.q)
    gaps = system.gaps(table.subset(every), state.q) * table.measure[every]
    is_near = ~(gaps > NEAR_STEPS * motion)
    far = gaps[~is_near]
    return every[is_near], float(far.min()) if len(far) else np.inf


def _closing(system: System, near: np.ndarray, contacts: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Near contacts that are not unknowns and whose gap is negative at q, where the last evaluation was.

    Returns:
        These contacts, and the near ones with the features that were missing among them.
    """
    if system.slots.n == 0 and (len(near) == 0 or near.tobytes() == contacts.tobytes()):
        return near[:0], near
    sub, rows = system.contacts.subset(near), None
    if system.slots.n:
        rows = system.rows_of_gaps(sub, q)
    penetrates = near[(system.gaps(sub, q) if rows is None else rows.g_N) < 0.0].tolist()
    known = set(contacts.tolist()) if penetrates else set()
    closing = np.array([i for i in penetrates if i not in known], dtype=int)
    if len(closing) or rows is None:
        return closing, near
    added = add_missing(system, near, rows)
    if len(added) == 0:
        return closing, near
    near = np.union1d(near, added)
    return added[system.gaps(system.contacts.subset(added), q) < 0.0], near


def _end(equations: StepEquations, evaluation: Evaluation, near: np.ndarray, clearance: float) -> State:
    """The state at the end of the step; contacts that have let go of all force are forgotten."""
    sub, x, nv, k, m = equations.sub, evaluation.x, equations.nv, equations.sub.k, equations.sub.m
    t, dt, q, v = equations.state.t + equations.dt, equations.dt, evaluation.q, evaluation.v
    a_bar, la_bar, tau_f_bar = equations.bars(evaluation)
    slots = equations.system.slots.contents()
    others: dict[str, Any] = {"near": near, "clearance": clearance, "slots": slots, "dt": dt}
    layout, multipliers = equations.layout, x[3 * nv :]
    if layout.f:
        tau_f = multipliers[layout.friction_a]
        others |= {"tau_f": tau_f, "tau_f_bar": tau_f_bar, "P_f": evaluation.friction.P}
    if layout.kb + layout.mb:
        first = multipliers[layout.friction_a.stop :]
        La_b, la_b = np.split(first[layout.kb :], 2)
        others |= {"la_b": la_b, "La_b": La_b}
    if k == 0:
        return State(t, q, v, x[:nv], a_bar, **others)
    keep = equations.keeps(evaluation)
    La, la, P = multipliers[k : 2 * k + m], multipliers[2 * k + m : layout.n_c], evaluation.z[k : 2 * k + m]
    N, F = sub.places if keep.all() else (np.flatnonzero(keep), k + np.flatnonzero(keep[sub.of_F]))
    return State(
        t, q, v, x[:nv], a_bar, sub.index[N], multipliers[:k][N], La[N], la[N], la_bar[N], P[N],
        La[F], la[F], la_bar[F], P[F], **others,
    )  # fmt: skip
