"""One step of the nonsmooth generalized-alpha method.

G. Capobianco, J. Harsch, S. R. Eugster, R. I. Leine: A nonsmooth generalized-alpha method for mechanical systems with
frictional contact, International Journal for Numerical Methods in Engineering 122 (2021) 6497-6526,
doi:10.1002/nme.6801. Equation numbers in this package are those of the paper.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import NotConverged
from ngalpha_pin.integrators.attempt import attempt
from ngalpha_pin.integrators.impact_splitting import MAX_IMPACTS, through_impact, without_impact
from ngalpha_pin.integrators.kinks import kinks, through_kink
from ngalpha_pin.integrators.plain_steps import plain_steps
from ngalpha_pin.integrators.release import through_release, with_holds, without_hold
from ngalpha_pin.integrators.slip_splitting import (
    ending_slips,
    slipping,
    slips_that_may_end,
    smooth_steps,
    through_end_of_slip,
)
from ngalpha_pin.step.contact_history import join_percussions
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.adhesion import NONE, lets_go
from ngalpha_pin.system.contact_search import has_rims
from ngalpha_pin.system.regime import Regime
from ngalpha_pin.system.state import SolvedBy, State, StepResult
from ngalpha_pin.system.system import System

MAX_HALVINGS = 4
RestOfStep = Callable[[State, float], StepResult]
LAWS = ("second-order", "paper")
SOLVERS = ("auto", "newton", "fixed_point")


@dataclass(frozen=True)
class GeneralizedAlpha:
    """The method and its parameters.

    Attributes:
        rho_inf: spectral radius at infinite frequency (72) [-], in [0, 1]: 1 keeps energy, 0 damps most.
        solver: "auto" is the cascade of Newton, fixed-point iterations, halved steps; "newton", "fixed_point" use one.
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
        checks.number("rho_inf", self.rho_inf, 0.0, 1.0)
        checks.choice("solver", self.solver, SOLVERS)
        checks.choice("laws", self.laws, LAWS)
        checks.number("tol", self.tol, 0.0, 1e-2, above=True)
        checks.integer("max_iter", self.max_iter, 1)

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
    def parameters(self) -> Parameters:
        """What the equations of a step want of the method."""
        coefficients = self.alpha_f, self.alpha_m, self.gamma, self.beta
        return Parameters(*coefficients, self.tol, self.max_iter, self.rho_inf, self.paper, self.solver)

    def step(self, system: System, state: State, dt: float) -> StepResult:
        """One step of length dt; where it does not converge, it is halved, up to `MAX_HALVINGS` times."""
        for result in plain_steps(self.parameters, system, state, dt, 1):
            return result
        # an iterate that runs away is recognised by its residual
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            halvings = MAX_HALVINGS if self.solver == "auto" else 0
            whole = self.paper or not Regime(len(state.contacts)).divides
            tries = [(halvings, 0 if whole else MAX_IMPACTS)]
            if whole and not self.paper and system.trees is not None:
                # where many bodies do not let the step be captured, it is divided at its impacts before it is halved
                tries = [(0, 0), (0, MAX_IMPACTS), *tries]
            for tried in tries:
                result = self._divided(system, state, dt, *tried)
                if result.converged:
                    break
            return result if result.state.dt == dt else replace(result, state=replace(result.state, whole=dt))

    def steps_ahead(self, system: System, state: State, dt: float, n: int) -> list[StepResult]:
        """Up to n steps, as far as nothing happens in them; they are those that `step` makes one by one."""
        if type(self).step is not _STEP:  # of another class, whose steps may be something else
            return []
        return plain_steps(self.parameters, system, state, dt, n)

    def _divided(
        self, system: System, state: State, dt: float, halvings: int, impacts: int, struck: bool = False
    ) -> StepResult:
        """The step, divided at so many impacts and ends of slip at most, and halved where it does not converge.

        Behind an impact of the same step (`struck`) ends of slip are not located: that both fall into one step gets
        rarer with dt, as the order of the method asks.
        """
        state = without_hold(system, state)
        rest = partial(self._divided, system, halvings=halvings, impacts=impacts - 1)
        result, divided = self._in_one_piece(system, state, dt, impacts > 0, not struck, rest)
        if divided is not None:
            return divided
        closes, releases = len(result.closing) > 0, len(lets_go(system, result.state)) > 0
        whole = closes or releases or struck or not (result.converged and impacts)
        slips = None if whole else ending_slips(system, state, result.state)
        bent = kinks(system, state, result.state) if result.converged and impacts else NONE
        if result.converged and (closes or (releases or len(bent)) and impacts) or slips is not None:
            given = self.parameters, system, state, dt, result, partial(rest, struck=struck or closes)
            if slips is not None:
                divided = through_end_of_slip(*given, slips)
            elif closes:
                divided = through_impact(*given)
            else:
                divided = through_release(*given) if releases else through_kink(*given, bent)
            if divided is not None:
                return divided
            result = attempt(self.parameters, system, state, dt) if closes else result
        if not result.converged and self.solver == "auto" and has_rims(system):
            # a rim that comes down nearly flat: its lowest point runs too fast
            again = attempt(self.parameters, system, state, dt, follow_rims=False)
            result = replace(again, n_iter=again.n_iter + result.n_iter)
        if result.converged or halvings == 0:
            return with_holds(system, result)
        return self._halved(system, state, dt, result, halvings, impacts)

    def _in_one_piece(
        self, system: System, state: State, dt: float, divides: bool, slows: bool, rest: RestOfStep
    ) -> tuple[StepResult, StepResult | None]:
        """The step up to its first impact; or, where it is not smooth because a slip ends, the divided one.

        A slip that ends in it or a little later may leave it without a solution in one piece, for which all solvers
        would be asked.
        """
        given = system, state, dt
        if divides and slows and self.parameters.auto and slipping(system, state):
            smooth = attempt(smooth_steps(self.parameters), *given, until_closing=True)
            slips = None if smooth.converged else slips_that_may_end(*given)
            divided = None if slips is None else through_end_of_slip(self.parameters, *given, smooth, rest, slips)
            if smooth.converged or divided is not None:
                return smooth, divided
        return attempt(self.parameters, *given, until_closing=divides), None

    def _halved(
        self, system: System, state: State, dt: float, whole: StepResult, halvings: int, impacts: int
    ) -> StepResult:
        """Two steps of half the length instead of the whole one, which has not converged."""
        first = self._divided(system, state, dt / 2, halvings - 1, impacts)
        if not first.converged:
            return replace(whole, n_iter=whole.n_iter + first.n_iter)
        second = self._divided(system, first.state, dt / 2, halvings - 1, impacts)
        n_iter = whole.n_iter + first.n_iter + second.n_iter
        joined = join_percussions(system, first.state, second.state)
        impacts_of_both = (*first.impacts, without_impact(system, first.state), *second.impacts)
        parts = (*first.parts, *second.parts)
        return StepResult(
            joined, second.converged, n_iter, SolvedBy.HALVED, second.residual, impacts_of_both, parts=parts
        )

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


_STEP = GeneralizedAlpha.step


def _worst_constraint(system: System, state: State) -> str:
    """The constraint that is furthest from being fulfilled in a step that failed."""
    if not system.constraints.names or not np.isfinite([*state.q, *state.v, *state.a]).all():
        return ""
    system.dynamics(state.t, state.q, state.v, state.a)
    rates = np.abs(system.constraint_rows(state.t, state.q, state.v, state.a).rate)
    worst = int(np.argmax(rates))
    return f"; the constraint {system.constraints.names[worst]!r} is off by {rates[worst]:.1e} /s"
