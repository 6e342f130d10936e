"""What the functions of a divided step hand to each other: a step in one piece, and the moment at which it is cut."""

from __future__ import annotations

from typing import NamedTuple

from ngalpha_pin.integrators.parts import SmoothPart, StraightPart
from ngalpha_pin.step.parameters import Parameters
from ngalpha_pin.system.regime import Regime
from ngalpha_pin.system.state import Impact, SolvedBy, State
from ngalpha_pin.system.system import System


class Piece(NamedTuple):
    """One step of one length from one state.

    Attributes:
        parameters: of the method.
        system: compiled scene.
        state: start of the step.
        dt: its length [s].
    """

    parameters: Parameters
    system: System
    state: State
    dt: float

    @property
    def divides(self) -> bool:
        """So few contacts are closed at its start that it is divided at impacts."""
        return Regime(len(self.state.contacts)).divides

    @property
    def captures(self) -> bool:
        """Impacts among many bodies that nothing but contacts couples are captured: each of them would divide it."""
        return self.system.many_trees and not self.divides


class Cut(NamedTuple):
    """A moment within a step at which forces begin anew.

    Attributes:
        before: the state just before it.
        h: its distance from the start of the step [s].
        n_iter: iterations so far.
        parts: of the step up to there.
        kind: what happens there: IMPACT, SLIP or RELEASE, or START where the rest of the step only looks again.
        hit: an impact there, or None.
    """

    before: State
    h: float
    n_iter: int
    parts: tuple[SmoothPart | StraightPart, ...]
    kind: SolvedBy
    hit: Impact | None = None
