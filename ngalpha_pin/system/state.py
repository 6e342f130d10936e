"""State: what every method has, and what one of them remembers. A saved one continues the run bit for bit."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from ngalpha_pin.collision.features import WIDTH
from ngalpha_pin.system.actuation import NO_ACTUATION, Actuation


def _no_slots() -> np.ndarray:
    return np.zeros((0, 1 + WIDTH))


def _no_samples() -> np.ndarray:
    return np.zeros((0, 0))


def _empty() -> np.ndarray:
    return np.zeros(0)


@dataclass(frozen=True, eq=False, slots=True)
class Auxiliary:
    """What the generalized-alpha method remembers between steps.

    Attributes:
        a_bar: auxiliary acceleration (71), shape (nv,).
        la_N_bar, la_F_bar: auxiliary contact forces (96), (114), shapes (k,) and (m,) [N].
        tau_f_bar: auxiliary torques of dry friction in joints, shape (f,) [N m or N].
    """

    a_bar: np.ndarray
    la_N_bar: np.ndarray
    la_F_bar: np.ndarray
    tau_f_bar: np.ndarray


@dataclass(frozen=True, eq=False, slots=True)
class State:
    """The end of one step and the beginning of the next.

    Contact quantities are kept for the contacts that carry or have just carried a force, in the order of `contacts`;
    everything else is zero. Arrays are not to be written to.

    Attributes:
        t: time [s].
        q: configuration, shape (nq,).
        v: velocity, shape (nv,).
        a: acceleration, shape (nv,).
        contacts: numbers of the contacts in the arrays below, shape (k,).
        la_N, la_F: contact forces (74), shapes (k,) and (m,) [N].
        P_N, P_F: percussions of the last step (95), (113), shapes (k,) and (m,) [N s].
        La_N, La_F: impulsive part of the percussions (77), shapes (k,) and (m,) [N s].
        tau_f: torques of dry friction in joints, shape (f,) [N m or N].
        P_f: their percussions in the last step, shape (f,) [N m s or N s].
        la_b, La_b: forces and impulsive parts of the constraints, those of g before those of gamma, shape (b,).
        memory: of the method; None at a start, and behind a step that relaxes (see `integrators.restart`), where
            auxiliary variables are the ones that they stand for.
        near: numbers of the contacts that are looked at in every step, shape (j,); the others are open.
        clearance: by how much the contacts that are not near can still move before one of them could close [m].
        slots: features in the places of `Slots` during the step, one row each, shape (j, 1 + WIDTH).
        tau: generalized force on the tree that is held during the step, shape (nv,), or (0,) where there is none [N or
            N m].
        holding: numbers of the contacts whose adhesion acts from now on, see `adhesion`, shape (j,).
        sampled: what sampled controls hold and remember, see `ngalpha_pin.system.sampling`, one row each.
        dt: length of the last step, or of its last part where it was divided [s]; zero at the start.
        whole: length of a step that was divided [s]; zero for others.
        names: what the numbers above stand for, see `ngalpha_pin.system.names`; () where it is not said.
    """

    t: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    contacts: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    la_N: np.ndarray = field(default_factory=_empty)
    la_F: np.ndarray = field(default_factory=_empty)
    P_N: np.ndarray = field(default_factory=_empty)
    P_F: np.ndarray = field(default_factory=_empty)
    La_N: np.ndarray = field(default_factory=_empty)
    La_F: np.ndarray = field(default_factory=_empty)
    tau_f: np.ndarray = field(default_factory=_empty)
    P_f: np.ndarray = field(default_factory=_empty)
    la_b: np.ndarray = field(default_factory=_empty)
    La_b: np.ndarray = field(default_factory=_empty)
    memory: Auxiliary | None = None
    near: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    clearance: float = -np.inf
    slots: np.ndarray = field(default_factory=_no_slots)
    tau: np.ndarray = field(default_factory=_empty)
    sampled: np.ndarray = field(default_factory=_no_samples)
    holding: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    dt: float = 0.0
    whole: float = 0.0
    names: tuple[tuple[str, ...], ...] = ()

    @property
    def auxiliary(self) -> Auxiliary:
        """The auxiliary variables with which the next step begins."""
        return Auxiliary(self.a, self.la_N, self.la_F, self.tau_f) if self.memory is None else self.memory

    @property
    def actuation(self) -> Actuation:
        """What the motors do in the step that begins here, beside the controls of the scene."""
        if not len(self.tau) and not len(self.holding):
            return NO_ACTUATION
        tau, holding = (x if len(x) else None for x in (self.tau, self.holding))
        return Actuation(tau, holding=holding)

    def to_arrays(self) -> dict[str, np.ndarray]:
        """The fields as arrays, for a file."""
        own = {f.name: np.asarray(getattr(self, f.name)) for f in fields(self) if f.name not in ("memory", "names")}
        memory = self.memory
        own |= {f"names_{i}": np.array(names, dtype=str) for i, names in enumerate(self.names)}
        return own | ({} if memory is None else {f.name: getattr(memory, f.name) for f in fields(memory)})

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> State:
        """The inverse of `to_arrays`."""
        scalars = {"t", "clearance", "dt", "whole"}
        values: dict[str, Any] = {
            f.name: float(arrays[f.name]) if f.name in scalars else arrays[f.name]
            for f in fields(cls)
            if f.name not in ("memory", "names")
        }
        names = tuple(tuple(arrays[name].tolist()) for name in sorted(arrays) if name.startswith("names_"))
        remembered = {f.name: arrays[f.name] for f in fields(Auxiliary) if f.name in arrays}
        return cls(**values, names=names, memory=Auxiliary(**remembered) if remembered else None)


class SolvedBy(str, Enum):
    """How a step was solved: a word for arrays and files, with a sentence."""

    sentence: str

    def __new__(cls, word: str, sentence: str) -> SolvedBy:
        """A word with its sentence."""
        member = str.__new__(cls, word)
        member._value_, member.sentence = word, sentence
        return member

    START = "start", "the initial values"
    NEWTON = "newton", "Newton's method on the index sets of the prox functions"
    MINIMUM_NORM = "minimum-norm", "Newton's method with dependent directions, or with other prox parameters"
    FIXED_POINT = "fixed-point", "contact problems of the linearised step, one round after the other"
    INDEX_SETS = "index sets", "Newton's method on index sets that were tried one after the other"
    ALL_DERIVATIVES = "all derivatives", "Newton's method with the derivatives of M and W by q, where dt is long"
    PAPER_LAWS = "laws of the paper", "Newton's method with (80) and (112) to the letter, where the own laws had none"
    CAPTURED = "captured", "an impact of many contacts, put at the end of the step"
    HALVED = "halved", "two steps of half the length"
    IMPACT = "impact", "divided at an impact"
    RELEASE = "release", "divided where a contact lets go of what it holds, or a compliant one of its force"
    SLIP = "slip", "divided where a slip ends"
    SWEEPS = "sweeps", "sweeps over the contacts of Moreau's scheme"
    SMOOTH = "smooth", "a phase without events, integrated to a chosen accuracy"


class Impact(NamedTuple):
    """An impact at its own moment within a step.

    Attributes:
        t: its time [s].
        q: configuration, shape (nq,).
        v_before, v_after: velocities on its two sides, shape (nv,).
        contacts: numbers of the contacts that are closed, shape (k,).
        P_N, P_F: their percussions, shapes (k,) and (m,) [N s].
        P_b: percussions of the constraints, shape (b,) [N s or N m s].
        slots: features in the places of `Slots`, as in `State`.
    """

    t: float
    q: np.ndarray
    v_before: np.ndarray
    v_after: np.ndarray
    contacts: np.ndarray
    P_N: np.ndarray
    P_F: np.ndarray
    P_b: np.ndarray
    slots: np.ndarray


@dataclass(frozen=True, eq=False, slots=True)
class StepResult:
    """What one step returns.

    Attributes:
        state: the end of the step; where it has not converged, the best that was found.
        converged: the residual is below the tolerance.
        n_iter: iterations of all rungs together.
        solved_by: how.
        residual: largest scaled residual; converged is residual <= 1.
        impacts: those that were located within the step, in the order of time.
        closing: numbers of the contacts that would have closed, where the step was asked to end before that.
        tau: mean of what was held in it, shape (nv,), where that has changed within it.
        error: what ended the step, where that was no criterion of its own; see `integrators.method.attempted`.
        parts: what the step is made of, see `integrators.parts`; () of a step of the engine or of another method.
    """

    state: State
    converged: bool
    n_iter: int
    solved_by: SolvedBy
    residual: float
    impacts: tuple[Impact, ...] = ()
    closing: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    tau: np.ndarray | None = None
    error: Exception | None = None
    parts: tuple[Any, ...] = ()
