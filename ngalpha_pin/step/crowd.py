"""The equations of a step of many trees that nothing but contacts couples, in the engine.

A body touches a few others, whatever their number: the mass matrix has one block for each tree, a row of W the
coordinates of the one or two trees of its contact, and the contact problems of a round are solved on the trees
(engine/crowd.hpp).
"""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from ngalpha_pin.contact.laws import IndexSets
from ngalpha_pin.contact.point_rows import KinematicRows
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.engine import Crowd
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.numerics.proximal_newton import ORDERING
from ngalpha_pin.step import newton_matrix
from ngalpha_pin.step.compiled import CompiledEquations, CompiledEvaluation
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.system.regime import FEW
from ngalpha_pin.system.system import Dynamics, System

# On the diagonal of the scaled Newton matrix. The shifted solution, multiplied by the matrix and solved for once more,
# has the factor s / (s + SHIFT)^2 in a direction with the eigenvalue s: 1 / s where it is not tiny, and nothing where
# directions are dependent, so that forces that are not unique stay as they are.
SHIFT = 1e-7
DEPENDENT = 1e-6  # smallest pivot, in parts of the largest, at which they are so: ten shifts
# sets of contacts that the engine keeps: in a long run of a crowd their number has no bound
MOST_SUBSETS = 256


class Trees(NamedTuple):
    """A scene of many trees as the engine knows it.

    Attributes:
        engine: makes evaluations, corrections and rounds.
        numbers: of the subsets that it has been given.
    """

    engine: Any
    numbers: dict[Subset, int]


def _trees_of(system: System) -> Trees:
    """The scene as the engine knows it, made at the first request."""
    if system.crowd is None or len(system.crowd.numbers) > MOST_SUBSETS:
        engine = Crowd(system.model.saveToString(), system.contacts.reach.tolist(), bool(system.flat))
        system.crowd = Trees(engine, {})
    crowd: Trees = system.crowd
    return crowd


class CrowdEvaluation(CompiledEvaluation):
    """R(x) of a crowd; its matrices and rows as those of `Evaluation`, where they are asked for."""

    def _dynamics(self) -> Dynamics:
        equations = self._equations
        a = self.x[: equations.nv]
        return equations.dynamics(self.q, self.v, a, equations.state.actuation._replace(held=self.options.held))

    @property
    def parts(self) -> list[KinematicRows]:  # type: ignore[override]
        """The rows of the contacts, where the bodies are put once more."""
        equations = self._equations
        self._dynamics()
        t = equations.state.t + equations.dt
        return [equations.system.contact_rows(equations.sub, self.q, self.v, self.x[: equations.nv], t)]


class CrowdEquations(CompiledEquations):
    """`StepEquations` on the trees."""

    prescribes = True

    def _prepare(self) -> None:
        """Give the engine the contacts, and find what restitution adds at the start."""
        trees = _trees_of(self.system)
        self._engine, number = trees.engine, trees.numbers.get(self.sub)
        if number is None:
            bodies = [int(body) for body in self.sub.points.bodies]
            number = trees.numbers[self.sub] = self._engine.add(self.plan.address, bodies)
        self._number = number
        if self.sub.bounces:
            self._engine.rebound(number, ctypes.addressof(self.step), self.state.q, self.state.v)

    def evaluate(self, x: np.ndarray, options: LawOptions | None = None) -> CrowdEvaluation:
        """See `StepEquations`."""
        return CrowdEvaluation(self, self.moved(x), self.parameters.laws if options is None else options)

    def run(self, ev: CompiledEvaluation) -> tuple[np.ndarray, float]:
        """See `CompiledEquations`; the bodies are put there for those who look at gaps."""
        state = self.state
        loads = self.system.loads(state.t + self.dt, state.q, ev.v, state.actuation._replace(held=ev.options.held))
        tau, K, D = (None, None, None) if loads is None else loads
        error, q = self._engine.evaluate(self._number, *self._addresses(ev), state.q, tau, K, D)
        self.system.place(q)
        return q, error

    def _addresses(self, ev: CompiledEvaluation) -> tuple[int, int, int]:
        return ctypes.addressof(self.step), ctypes.addressof(ev.iterate), ctypes.addressof(ev.block)

    def response(self, ev: Evaluation) -> np.ndarray:
        """See `StepEquations`."""
        step, _, rows = self._addresses(self._read(ev))
        return np.asarray(self._engine.response(self._number, step, rows))

    def round(self, ev: Evaluation) -> tuple[np.ndarray, IndexSets]:
        """See `prox_round`."""
        following = self.plan.iterate.new()
        addresses = self._addresses(self._read(ev))
        sets = self._engine.round(self._number, *addresses, ctypes.addressof(following), self.sub.k)
        return np.frombuffer(following)[: len(ev.x)], IndexSets(*sets.reshape(5, -1) != 0.0)

    def corrected(self, ev: Evaluation, smallest_forces: bool = False) -> tuple[CrowdEvaluation, bool]:
        """See `StepEquations`; forces that are not unique stay as they are."""
        following, dependent = self._next(self._read(ev), smallest_forces)
        return CrowdEvaluation(self, following, ev.options), dependent

    def _next(self, ev: CompiledEvaluation, smallest_forces: bool) -> tuple[Any, bool]:
        following, addresses = self.plan.iterate.new(), self._addresses(ev)
        z, dependent = _solution(*self._engine.linear(self._number, *addresses))
        self._engine.advance(self._number, *addresses, z, ctypes.addressof(following))
        return following, dependent

    def with_forces(self, ev: Evaluation, kappa: np.ndarray, P: np.ndarray, la: np.ndarray) -> np.ndarray:
        """See `StepEquations`; `response` has been asked for before."""
        following = self.plan.iterate.new()
        given = *self._addresses(self._read(ev)), kappa, P, la, ctypes.addressof(following)
        self._engine.with_forces(self._number, *given)
        return np.frombuffer(following)[: len(ev.x)]

    def linearise(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """See `StepEquations`: of all trees at once."""
        return newton_matrix.linearise(self, ev)

    @property
    def gap_tolerance(self) -> np.ndarray:
        """See `StepEquations`."""
        return 1.0 / self._array("kinematic")[: self.sub.k]

    def _read(self, ev: Evaluation) -> CompiledEvaluation:
        assert isinstance(ev, CompiledEvaluation)
        self.read(ev.options)
        return ev


def _solution(values: np.ndarray, rows: np.ndarray, starts: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, bool]:
    """B A B b with B = (A + SHIFT)^-1, the solution of A z = b but for directions that A does not see.

    Returns:
        The solution, not finite where A is not or has no factors in spite of the shift, and whether directions were
        dependent.
    """
    n, none = len(b), np.full(len(b), np.nan)
    if not np.isfinite(values).all():
        return none, False
    A = csc_array((values, rows, starts), shape=(n, n))
    shifted = A.copy()
    shifted.data[rows == np.repeat(np.arange(n), np.diff(starts))] += SHIFT
    try:
        lu = splu(shifted, ORDERING)
    except RuntimeError:
        return none, False
    pivots = np.abs(lu.U.diagonal())
    return lu.solve(A @ lu.solve(b)), bool(pivots.min() < DEPENDENT * pivots.max())


def is_crowd(system: System, sub: Subset) -> bool:
    """The engine has the equations: of many trees that touch at contacts whose rows and laws the kernel knows."""
    layout = system.layout(sub)
    other = layout.n > layout.n_c or len(sub.own) > 0 or system.contacts.adheres or not sub.plain
    return kernel.library is not None and system.many_trees and sub.k > FEW and not other
