"""One step of the nonsmooth generalized-alpha method.

G. Capobianco, J. Harsch, S. R. Eugster, R. I. Leine: A nonsmooth generalized-alpha method for mechanical systems with
frictional contact, International Journal for Numerical Methods in Engineering 122 (2021) 6497-6526,
doi:10.1002/nme.6801. Equation numbers in this package are those of the paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import NotConverged
from ngalpha_pin.integrators.division import divided
from ngalpha_pin.integrators.impact_splitting import MAX_IMPACTS
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.integrators.plain_steps import plain_steps
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.state import State, StepResult
from ngalpha_pin.system.system import System

MAX_HALVINGS = 4  # to a sixteenth of the step: what takes still smaller ones is for the user to say
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
        piece = Piece(self.parameters, system, state, dt)
        plain = plain_steps(piece, 1)
        if plain is not None:
            return plain[0]
        # an iterate that runs away is recognised by its residual
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            halvings = MAX_HALVINGS if self.solver == "auto" else 0
            tries = [(halvings, MAX_IMPACTS if piece.divides and not self.paper else 0)]
            if piece.captures and not self.paper:
                # where many bodies do not let the step be captured, it is divided at its impacts before it is halved
                tries = [(0, 0), (0, MAX_IMPACTS), *tries]
            for tried in tries:
                result = divided(piece, *tried)
                if result.converged:
                    break
            return result if result.state.dt == dt else replace(result, state=replace(result.state, whole=dt))

    def steps_ahead(self, system: System, state: State, dt: float, n: int) -> Sequence[StepResult]:
        """Up to n steps, as far as nothing happens in them; they are those that `step` makes one by one."""
        if type(self).step is not _STEP:  # of another class, whose steps may be something else
            return []
        return plain_steps(Piece(self.parameters, system, state, dt), n) or []

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
