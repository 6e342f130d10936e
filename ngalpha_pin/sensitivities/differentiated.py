"""Derivatives of a whole run: what is asked for, and what comes of it."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import NgalphaError
from ngalpha_pin.sensitivities.parameters import columns_of, parameters_of
from ngalpha_pin.sensitivities.start import check_differentiable, directions, held_to
from ngalpha_pin.sensitivities.statuses import Status
from ngalpha_pin.sensitivities.steps import Report, Steps
from ngalpha_pin.system.state import State, StepResult
from ngalpha_pin.system.system import System

ON_UNDEFINED = ("keep", "nan", "raise")
UNDEFINED = (Status.AMBIGUOUS, Status.SIMULTANEOUS, Status.DEPENDENT)
NOTHING = 1e-12  # a column below this part of the largest is none


@dataclass(frozen=True)
class Sensitivities:
    """By what a run is differentiated.

    Attributes:
        q0: True for each coordinate of its tangent space, or directions there, shape (nv, r). Constraints stay
            fulfilled, contacts that rest stay closed and those that stick go on to: each direction is the nearest
            one that does that, in the metric of the mass matrix.
        v0: likewise.
        parameters: names such as "mu[foot*]", "e_N[ball]", "e_F[ball]" (of contacts, by patterns of geometries),
            "mass[body]" (its inertia is scaled with it), "inertia[body]" (ten columns, as
            `pin.Inertia.toDynamicParameters`), "placement[geometry]" (three columns, the way of a point or a plane in
            its body), "kp" and "kd" (of every `JointPD`).
        on_undefined: what stands where there is no derivative, see `Status`: "keep" gives that of the contacts as they
            were found, except of simultaneous impacts with rebounds, which is NaN; "nan" gives NaN; "raise" raises.
    """

    q0: bool | np.ndarray = False
    v0: bool | np.ndarray = False
    parameters: Sequence[str] = ()
    on_undefined: str = "keep"

    def __post_init__(self) -> None:
        """Check what can be checked without a scene."""
        checks.choice("on_undefined", self.on_undefined, ON_UNDEFINED)


@dataclass(frozen=True, eq=False)
class RunDerivatives:
    """Derivatives of a run at all of its times.

    Attributes:
        names: of the columns.
        q: of the configuration, in its tangent space, shape (n + 1, nv, p).
        v: of the velocity, shape (n + 1, nv, p).
        status: of each step, see `Status`; that of the start is "smooth", shape (n + 1,).
        reasons: of the steps that are not smooth: number, status and the contacts that it is about.
        switches: times at the ends of the steps from which on columns may be one-sided or not defined [s].
        approach: smallest speed with which a gap has closed [m/s]: derivatives grow like one over it.
    """

    names: tuple[str, ...]
    q: np.ndarray
    v: np.ndarray
    status: np.ndarray
    reasons: tuple[tuple[int, str, tuple[str, ...]], ...]
    switches: np.ndarray
    approach: float

    def __repr__(self) -> str:
        return f"RunDerivatives({len(self.q) - 1} steps by {', '.join(self.names)})"

    @property
    def vanishing(self) -> tuple[str, ...]:
        """Columns that are zero at the end: the run does not feel them, as mu where nothing slips."""
        end = np.abs(np.concatenate((self.q[-1], self.v[-1])))
        zero = end.max(axis=0) <= NOTHING * end.max(initial=0.0)
        return tuple(name for name, is_zero in zip(self.names, zero, strict=True) if is_zero)


@dataclass
class Differentiated:
    """A run under way, with its derivatives.

    Attributes:
        steps: take the tangent through steps.
        names: of the columns.
        on_undefined: see `Sensitivities`.
    """

    steps: Steps
    names: tuple[str, ...]
    on_undefined: str
    tangents: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    reports: list[Report] = field(default_factory=list)

    def begin(self, state: State, dq: np.ndarray, dv: np.ndarray) -> None:
        """Take the start of the run, with its directions, shape (nv, p) each."""
        self._tangent = self.steps.start(state, dq, dv)
        self._undefined = np.zeros(len(self.names), dtype=bool)
        self._keep(state)

    def add(self, result: StepResult) -> None:
        """Take one step.

        Raises:
            NgalphaError: it has no derivative, and that is to be an error.
        """
        self._tangent, report = self.steps.through(result.parts, self._tangent)
        if report.status in UNDEFINED and self.on_undefined == "raise":
            raise NgalphaError(f"{report.status.headline} at t = {result.state.t:g} s: {told(report)}")
        self._undefined |= report.ambiguous if self.on_undefined == "keep" else report.status in UNDEFINED
        self.reports.append(report)
        self._keep(result.state)

    def _keep(self, state: State) -> None:
        q, v = (np.where(self._undefined, np.nan, x) for x in (self._tangent.q, self._tangent.v))
        self.tangents.append((q, v))
        self.times.append(state.t)

    def derivatives(self) -> RunDerivatives:
        """Those of the run so far, with a warning of each kind where some are not defined."""
        undefined = [(i, r) for i, r in enumerate(self.reports, 1) if r.status in UNDEFINED]
        for status in UNDEFINED:
            steps = [(i, report) for i, report in undefined if report.status is status]
            if steps:
                i, report = steps[0]
                more = f", and in {len(steps) - 1} more steps" if len(steps) > 1 else ""
                warnings.warn(f"{status.headline} at t = {self.times[i]:g} s{more}: {told(report)}", stacklevel=4)
        unlike = [(i, r) for i, r in enumerate(self.reports, 1) if r.status is not Status.SMOOTH]
        return RunDerivatives(
            self.names,
            np.array([q for q, _ in self.tangents]),
            np.array([v for _, v in self.tangents]),
            np.array([Status.SMOOTH.value, *(report.status.value for report in self.reports)]),
            tuple((i, report.status.value, report.names) for i, report in unlike),
            np.array([self.times[i] for i, report in undefined]),
            min((report.approach for report in self.reports), default=np.inf),
        )


def told(report: Report) -> str:
    """What a report says, in a sentence."""
    return f"{report.status.sentence}{': ' if report.names else ''}{', '.join(report.names[:6])}"


def differentiated(system: System, method: Any, asked: Sensitivities, state: State) -> Differentiated:
    """The derivatives of a run that begins at a state.

    Raises:
        SceneError: the scene has no derivatives, or not those that are asked for.
    """
    checks.instance("sensitivities", asked, Sensitivities, "nga.Sensitivities(...)")
    method, nv, scene = check_differentiable(system, method), system.nv, system.scene
    q, v = directions("q0", asked.q0, nv), directions("v0", asked.v0, nv)
    parameters = parameters_of(scene, asked.parameters)
    labels = tuple(label for parameter in parameters for label in parameter.labels)
    first = q.shape[1] + v.shape[1]
    p = first + len(labels)
    dq, dv = np.zeros((nv, p)), np.zeros((nv, p))
    dq[:, : q.shape[1]], dv[:, q.shape[1] : first] = q, v
    starts = tuple(f"{name}[{i}]" for name, x in (("q0", q), ("v0", v)) for i in range(x.shape[1]))
    columns = columns_of(system, scene, parameters, 0, p, first)
    system.plain = False  # steps of the engine alone do not say what they are made of
    found = Differentiated(Steps(system, method.parameters, columns), starts + labels, asked.on_undefined)
    found.begin(state, *held_to(found.steps.geometry, state, dq, dv))
    return found
