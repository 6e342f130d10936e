"""What a step is made of: smooth parts and straight lines between the moments at which it is divided.

Whoever wants to know how the end of a step depends on its start goes along them. They hold nothing but references to
what the step has computed anyway.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.step.options import LawOptions
from ngalpha_pin.system.state import Impact, SolvedBy, State


class SmoothPart(NamedTuple):
    """The equations of the method, solved once.

    Attributes:
        start: before the method has begun with it, see `restart.begin`.
        dt: its length [s].
        end: of the part.
        contacts: numbers of the contacts that were unknowns.
        x: the solution, see `StepEquations`.
        options: the laws that it fulfils.
    """

    start: State
    dt: float
    end: State
    contacts: np.ndarray
    x: np.ndarray
    options: LawOptions


class StraightPart(NamedTuple):
    """A part so short that it is a straight line.

    Attributes:
        start: of the part.
        dt: its length [s].
        end: of the part.
    """

    start: State
    dt: float
    end: State


class Moment(NamedTuple):
    """A moment at which forces begin anew.

    Attributes:
        kind: IMPACT, SLIP or RELEASE where the motion says when it is; START where its time is given.
        before: the state just before it.
        after: the state just after it.
        hit: an impact there, or None.
    """

    kind: SolvedBy
    before: State
    after: State
    hit: Impact | None
