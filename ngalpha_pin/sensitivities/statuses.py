"""What is said of the derivative of one step."""

from __future__ import annotations

from enum import Enum


class Status(str, Enum):
    """Of the derivative of one step: a word for arrays, with a sentence; the later ones say more."""

    sentence: str

    def __new__(cls, word: str, sentence: str) -> Status:
        """A word with its sentence."""
        member = str.__new__(cls, word)
        member._value_, member.sentence = word, sentence
        return member

    SMOOTH = "smooth", "the end of the step is a smooth function of its start"
    SWITCH = "switch", "a slip ends in the step, at a moment that moves with the parameters"
    IMPACT = "impact", "an impact in the step, at a moment that moves with the parameters"
    CAPTURED = (
        "captured",
        "contacts close in the step without a moment of their own: right for the step as it was taken",
    )
    DEPENDENT = (
        "dependent",
        "forces are not determined by the motion, their smallest change is taken: right where the motion does not "
        "depend on how they are shared",
    )
    SIMULTANEOUS = "simultaneous", "several contacts close at once, without a rebound: the contacts as they were found"
    AMBIGUOUS = (
        "ambiguous",
        "several contacts close at once and rebound: which is first decides, there is no derivative",
    )

    @property
    def headline(self) -> str:
        """What there is of a derivative that is not the only one."""
        return "a derivative among several" if self is Status.DEPENDENT else "no derivative"

    @property
    def severity(self) -> int:
        """How much it says, from 0."""
        return list(Status).index(self)
