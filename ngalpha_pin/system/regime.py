"""From how many contacts on a step is solved in another way: every such number once, with its reason."""

from __future__ import annotations

from typing import NamedTuple

from ngalpha_pin.engine.kernel import binding as kernel

MANY_TREES = 8  # trees from which on only those that touch are coupled; with fewer, one dense matrix is as fast
DIVIDED = 12  # closed contacts up to which a step is divided at impacts: each would take some steps of all of them
CROWDED = 8  # rows up to which index sets are searched by combinations; with more, impacts are captured
FEW = 16  # contacts up to which what one of them feels reaches the others in a few sweeps
RANKED = 150  # rows up to which eigenvalues are looked at, and forces are tried for again after percussions alone
COMPILED, PLACED = kernel.COMPILED, kernel.PLACED  # contacts that the kernel takes, which says why
BANDED = 200  # coordinates of beams from which on bands in numpy are quicker than full matrices in the engine
ENUMERATED = 2  # contacts for which every choice of index sets is tried
LOOKED_AGAIN = 8  # open contacts that may be looked at in every step before all are looked through once more


class Regime(NamedTuple):
    """How a step with these contacts is solved.

    Attributes:
        k, m: contacts and their friction rows.
        joints: rows of joint friction.
        many_trees: the scene has many trees that nothing but contacts couples.
        prescribes: index sets can be prescribed to the equations.
    """

    k: int
    m: int = 0
    joints: int = 0
    many_trees: bool = False
    prescribes: bool = True

    @property
    def divides(self) -> bool:
        """The step is divided at impacts."""
        return self.k <= DIVIDED

    @property
    def crowded(self) -> bool:
        """Impacts are captured; sticking joints make the directions of sticking feet dependent as contacts do."""
        return self.k + self.joints > CROWDED

    @property
    def captured_only(self) -> bool:
        """No combinations of index sets are tried where that fails: the step is halved."""
        return self.k > CROWDED

    @property
    def few(self) -> bool:
        """What one contact feels reaches the others in a few sweeps."""
        return self.k <= FEW

    @property
    def among_many_bodies(self) -> bool:
        """There are many contacts, between bodies that nothing but contacts couples."""
        return not self.few and self.prescribes and self.many_trees

    @property
    def ranked(self) -> bool:
        """Few enough rows to try for forces again where percussions did all of the work."""
        return self.k + self.m <= RANKED
