"""Index sets tried one after the other: all of them, and each that is found fulfils the laws."""

import numpy as np
import pytest

from ngalpha_pin.contact.cones import Cones
from ngalpha_pin.step.active_set_enumeration import _choices


@pytest.mark.parametrize("friction, count", [([False], 4), ([True], 10), ([True, False], 40), ([True, True], 100)])
def test_every_choice_once(friction, count):
    """Open, or in A, B or C with slip, stick on one level or on both: 1 + 3 * 3 of a contact with friction."""
    found = [tuple(np.concatenate([np.ravel(x) for x in sets if x is not None]).tolist()) for sets in _tuples(friction)]
    assert len(found) == len(set(found)) == count


def _tuples(friction):
    k, of_F = len(friction), np.flatnonzero(friction)
    cones = Cones(of_F, np.zeros(len(of_F), dtype=int), np.ones(k), np.zeros(k), [None] * k, np.arange(k), k)
    for sets in _choices(cones):
        assert (sets.B <= sets.A).all() and (sets.C <= sets.B).all()
        assert (sets.stick_a <= sets.stick).all() and (sets.stick <= sets.A).all()
        yield sets.A, sets.B, sets.C, sets.stick, sets.stick_a
