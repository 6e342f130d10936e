"""The numbers of a method that its equations and their solvers want."""

from __future__ import annotations

from typing import NamedTuple

from ngalpha_pin.step.options import PAPER, SECOND_ORDER, LawOptions


class Parameters(NamedTuple):
    """Coefficients and tolerances of the nonsmooth generalized-alpha method.

    Attributes:
        alpha_f, alpha_m, gamma, beta: coefficients (72) [-].
        tol: residual of every equation, relative to the typical force of the step [-].
        max_iter: Newton corrections of one attempt.
        rho_inf: spectral radius at infinite frequency (72) [-].
        paper: the laws are those of the paper to the letter.
        solver: "auto" for all rungs of the cascade, "newton" or "fixed_point" for one.
    """

    alpha_f: float
    alpha_m: float
    gamma: float
    beta: float
    tol: float
    max_iter: int
    rho_inf: float
    paper: bool
    solver: str

    @property
    def coefficients(self) -> tuple[float, float, float, float]:
        """alpha_f, alpha_m, gamma and beta (72)."""
        return self[:4]

    def with_coefficients(self, coefficients: tuple[float, float, float, float]) -> Parameters:
        """The same with others than those of rho_inf."""
        alpha_f, alpha_m, gamma, beta = coefficients
        return self._replace(alpha_f=alpha_f, alpha_m=alpha_m, gamma=gamma, beta=beta)

    @property
    def auto(self) -> bool:
        """All rungs of the cascade are there."""
        return self.solver == "auto"

    @property
    def laws(self) -> LawOptions:
        """The laws with which a step begins."""
        return PAPER if self.paper else SECOND_ORDER
