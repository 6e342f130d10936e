"""The equations of a step on the compiled kernel, twin of equations.py; Python only calls Pinocchio in between."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.common.tolerances import CONE, ROUNDING
from ngalpha_pin.contact.laws import ContactResidual
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.step.equations import FORGET, LOST, NO_CONTACT, InEngine, StepEquations
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.newton_matrix import SINGULAR, least_change
from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.step.scaling import ALPHA_R
from ngalpha_pin.system.regime import COMPILED
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import Dynamics, System

CONSTANTS = (ALPHA_R, ROUNDING, SINGULAR, FORGET, 1 + CONE)


class JointLaws(NamedTuple):
    """What the solvers want of `FrictionResidual`."""

    P: np.ndarray


class CompiledEvaluation(Evaluation):
    """R(x) in the blocks of the kernel; what the solver ladder seldom asks for is made into arrays at the request.

    Args:
        equations: of the step.
        iterate: block with x, v and dq.
        options: the laws.
    """

    def __init__(self, equations: CompiledEquations, iterate: Any, options: LawOptions):
        plan, nv, size = equations.plan, equations.nv, 3 * equations.nv + equations.n
        self._equations: CompiledEquations = equations
        self.options = options
        equations.read(options)
        if plan.live.frames is not None:
            plan.live.frames.wanted[:] = equations.wanted
        self.iterate, self.block = iterate, plan.rows.new()
        self._arrays = arrays = np.frombuffer(iterate)
        self.x, self.v, self.dq = arrays[:size], arrays[size : size + nv], arrays[size + nv : size + 2 * nv]
        self.q, self.error = equations.run(self)

    def array(self, name: str) -> np.ndarray:
        """One of the arrays of kernel.h."""
        plan = self._equations.plan
        if name in plan.iterate.slices:
            return self._arrays[plan.iterate.slices[name]]
        return np.frombuffer(self.block)[plan.rows.slices[name]]

    def index_sets(self) -> bytes:
        """See `Evaluation`."""
        return self.array("holds").tobytes()

    def __getattr__(self, name: str) -> Any:
        """An attribute of `Evaluation` that has not been asked for yet."""
        if name not in _ATTRIBUTES:
            raise AttributeError(name)
        value = self._dynamics() if name == "dynamics" else _ATTRIBUTES[name](self)
        setattr(self, name, value)
        return value

    def _dynamics(self) -> Dynamics:
        data, live, residual = self._equations.system.data, self._equations.plan.live, self.array("residual")
        if not self._equations.loaded:
            return Dynamics(residual, data.M, data.dtau_dq, data.dtau_dv)
        return Dynamics(residual, data.M, data.dtau_dq - live.K, data.dtau_dv - live.D)

    def _contact(self) -> ContactResidual:
        """The laws, without what only `ContactResidual` itself needs."""
        laws = ContactResidual.__new__(ContactResidual)
        laws.sub, n_c = self._equations.sub, self._equations.layout.n_c
        laws.y, laws.z, laws.R, laws.kinematic = (x[:n_c] for x in (self.y, self.z, self.law, self.kinematic))
        laws.A, laws.B, laws.C = (self.array(name) != 0.0 for name in "ABC")
        laws.stick, laws.stick_a = self.array("stick") != 0.0, self.array("stick_a") != 0.0
        return laws


_ATTRIBUTES: dict[str, Callable[[CompiledEvaluation], Any]] = {
    "dynamics": CompiledEvaluation._dynamics,
    "contact": CompiledEvaluation._contact,
    "friction": lambda ev: JointLaws(ev.array("P_f")),
    "R": lambda ev: ev.array("R").reshape(3, -1),
    "z": lambda ev: ev.array("z"),
    "y": lambda ev: ev.array("y"),
    "W": lambda ev: ev.array("W").reshape(ev._equations.nv, -1).T,
    "law": lambda ev: ev.array("R_c"),
    "kinematic": lambda ev: ev.array("holds") != 0.0,
    "ratio": lambda ev: ev.array("ratio"),
}


class CompiledEquations(StepEquations):
    """`StepEquations` with R(x) and the Newton correction compiled."""

    prescribes = False

    def __init__(
        self,
        system: System,
        parameters: Parameters,
        state: State,
        dt: float,
        sub: Subset,
        memory: tuple[np.ndarray, np.ndarray],
    ):
        self.system, self.parameters, self.sub, self.state, self.dt = system, parameters, sub, state, dt
        self.plan = plan = kernel.plan_of(system, sub)
        self.nv, self.n, self._laws_in_block = plan.nv, plan.n, parameters.laws
        self.layout, self.loaded = system.layout(sub), system.loaded(state.actuation)
        self.memory, self._la_start = memory, memory[0]
        constraints = system.constraints
        self.wanted = constraints.wanted(state.t + dt) if constraints.over_time else NO_CONTACT
        self.step = plan.step.new()
        self._step = np.frombuffer(self.step)
        laws = parameters.laws
        flags = (laws.paper, laws.displaces, laws.accelerates, self.loaded, system.flat, laws.monotone)
        numbers = (dt, *parameters.coefficients, parameters.tol, system.weight, *CONSTANTS, *flags)
        span = system.span(state.q) if self.loaded else np.zeros(self.nv)
        given = (
            numbers,
            span,
            state.a,
            state.auxiliary.a_bar,
            state.v,
            *memory,
            state.tau_f,
            state.auxiliary.tau_f_bar,
        )
        np.concatenate(given, out=self._step[: plan.n_given])
        kernel.library.nga_begin_step(plan.address, self.step)
        self._prepare()

    def _prepare(self) -> None:
        """Find a work space, and what restitution adds at the start."""
        plan, system, state = self.plan, self.system, self.state
        plan.make_room()
        if self.sub.bounces:
            pin.computeJointJacobiansTimeVariation(system.model, system.data, state.q, state.v)
            plan.live.q[:] = state.q
            kernel.library.nga_rebound(plan.address, self.step, plan.rows.new())

    def __getattr__(self, name: str) -> Any:
        """What only the fallbacks of the solver ladder need: an attribute of `StepEquations` not asked for yet."""
        field = name.lstrip("_")
        if field not in ("gamma_c", "beta_c", "z_known", "kappa_F_known", "friction_known"):
            raise AttributeError(name)
        value = self._array(field).copy()
        setattr(self, name, float(value[0]) if field in ("gamma_c", "beta_c") else value)
        return getattr(self, name)

    @property
    def scaled(self) -> bool:
        """The first evaluation has found the scales."""
        return bool(self._array("scaled")[0])

    @property
    def carried(self) -> np.ndarray:
        """See `StepEquations`."""
        least = FORGET * self._array("force_scale") if self.scaled else 0.0
        return np.asarray(self._la_start[: self.sub.k] > least)

    def _array(self, name: str) -> np.ndarray:
        return self._step[self.plan.step.slices[name]]

    def evaluate(self, x: np.ndarray, options: LawOptions | None = None) -> CompiledEvaluation:
        """R(x) (127)-(142), with the laws of the method or with others."""
        return CompiledEvaluation(self, self.moved(x), self.parameters.laws if options is None else options)

    def moved(self, x: np.ndarray) -> Any:
        """The block of an iterate, with its motion."""
        iterate = self.plan.iterate.new()
        np.frombuffer(iterate)[: len(x)] = x
        kernel.library.nga_move(self.plan.address, self.step, iterate)
        return iterate

    def run(self, ev: CompiledEvaluation) -> tuple[np.ndarray, float]:
        """Fill in the rows of an evaluation: its configuration and its error."""
        plan, state, system = self.plan, self.state, self.system
        q = system.integrate(state.q, ev.dq)
        plan.live.q[:] = q
        pin.computeRNEADerivatives(system.model, system.data, q, ev.v, ev.x[: self.nv])
        loads = system.loads(state.t + self.dt, q, ev.v, state.actuation._replace(held=ev.options.held))
        if loads is not None:
            plan.live.tau[:], plan.live.K[:], plan.live.D[:] = loads
        if self.layout.f and not self.scaled:  # stiffness is in the scales of joint friction
            self._differentiate_step(ev)
        error = kernel.library.nga_evaluate(plan.address, self.step, ev.iterate, ev.block)
        return q, error if error < LOST else np.inf

    def spent(self, ev: Evaluation) -> float:
        """See `StepEquations`."""
        return super().spent(ev) if self.system.moves_by_pairs else float(_compiled(ev).array("spent")[0])

    def bars(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `StepEquations`."""
        return _compiled(ev).array("a_bar"), _compiled(ev).array("la_bar"), _compiled(ev).array("bar_f")

    def keeps(self, ev: Evaluation) -> np.ndarray:
        """See `StepEquations`."""
        return _compiled(ev).array("keep") != 0.0

    def linearise(self, ev: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """See `StepEquations`."""
        self.read(ev.options)
        self._differentiate_step(ev)
        kernel.library.nga_linearise(self.plan.address, self.step, _compiled(ev).block)
        nv, n = self.nv, self.n
        return self._work("Z").reshape(n + 1, 3 * nv).T.copy(), self._work("H").reshape(n + 1, n).T.copy()

    def corrected(self, ev: Evaluation, smallest_forces: bool = False) -> tuple[CompiledEvaluation, bool]:
        """See `StepEquations`."""
        following, dependent = self._next(_compiled(ev), smallest_forces)
        return CompiledEvaluation(self, following, ev.options), dependent

    def in_engine(self, ev: Evaluation, max_iter: int, growth: float | None, every: bool = False) -> InEngine:
        """See `StepEquations`."""
        system, state = self.system, self.state
        plain = system.plain
        if not plain or ev.options.held is not None or system.contacts.adheres:
            return ev, 0, False, {}
        self.read(ev.options)
        iterate = self.plan.iterate.new()
        np.frombuffer(iterate)[:] = np.frombuffer(_compiled(ev).iterate)
        n, _, dependent, seen = plain.engine.solve(
            plain.number(system, self.sub),
            plain.forces.loads(system, state.actuation),
            plain.follows(system),
            state.t,
            state.q,
            ctypes.addressof(self.step),
            ctypes.addressof(iterate),
            max_iter,
            np.inf if growth is None else growth,
            every,
        )
        return (CompiledEvaluation(self, iterate, ev.options) if n else ev), n, dependent, seen

    def correction(self, ev: Evaluation, smallest_forces: bool = False) -> tuple[np.ndarray, bool]:
        """See `StepEquations`."""
        following, dependent = self._next(_compiled(ev), smallest_forces)
        return np.frombuffer(following)[: len(ev.x)] - ev.x, dependent

    def _next(self, ev: CompiledEvaluation, smallest_forces: bool) -> tuple[Any, bool]:
        """The next iterate, and whether directions were dependent."""
        self.read(ev.options)
        self._differentiate_step(ev)
        library, address, following = kernel.library, self.plan.address, self.plan.iterate.new()
        dependent = bool(library.nga_correct(address, self.step, ev.iterate, ev.block, following))
        if dependent:
            A, b = self._work("A").reshape(self.n, self.n).T, self._work("b")
            if np.isfinite(A).all():
                z = smallest_forces * ev.x[3 * self.nv :] / self._array("column_scale")
                self._work("y")[:], dependent = least_change(A, b, z)
            else:
                dependent = False
                self._work("y")[:] = np.nan
            library.nga_advance(address, self.step, ev.iterate, following)
        return following, dependent

    def read(self, options: LawOptions) -> None:
        """Put the laws of the next call into the block of the step, where other ones are in it."""
        if options is self._laws_in_block:
            return
        if any(laws.factors is not None or laws.joints != 1.0 for laws in (options, self._laws_in_block)):
            self._array("r")[:] = self._prox_parameters(options)
        for name in ("paper", "displaces", "accelerates", "monotone"):
            self._array(name)[:] = getattr(options, name)
        if options.sets is not None:
            self._array("sets")[:] = np.concatenate(options.sets)
        self._array("prescribed")[:] = options.sets is not None
        self._array("slackened")[:] = options.slack is not None
        self._array("slack")[:] = 0.0 if options.slack is None else options.slack
        self._laws_in_block = options

    @cached_property
    def r(self) -> np.ndarray:
        """Prox parameters, shape (n,) [kg]; the kernel has found them at the first evaluation."""
        return self._array("r").copy()

    def _work(self, name: str) -> np.ndarray:
        return self.plan.work_view[self.plan.work.slices[name]]

    def _differentiate_step(self, ev: Evaluation) -> None:
        if not self.system.flat:
            self.plan.T[:] = self.system.d_integrate(self.state.q, ev.dq)


def _compiled(ev: Evaluation) -> CompiledEvaluation:
    assert isinstance(ev, CompiledEvaluation)
    return ev


def is_compiled(system: System, sub: Subset) -> bool:
    """The kernel knows contacts with surfaces that rest, limits, dry friction of joints, tied frames and gears.

    Where points and frames are there, friction may have directions in which nothing moves: `contact.blocked_tangents`.
    """
    layout = system.layout(sub)
    tied = layout.kb + layout.mb == 0 or (sub.m == 0 and system.constraints.compiled)
    simple = tied and len(sub.own) == 0 and sub.plain and system.beams is None and sub.k <= COMPILED
    return kernel.library is not None and simple
