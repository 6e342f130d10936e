"""Newton's cradle: its laws of conservation, and the pendulums between impacts."""

import numpy as np
import pytest

from ngalpha_pin.references.cradle import GRAVITY, LENGTH, cradle


def energy(q, v):
    return 0.5 * LENGTH**2 * (v**2).sum(axis=1) + GRAVITY * LENGTH * (1 - np.cos(q)).sum(axis=1)


def test_energy_stays_without_losses():
    t = np.linspace(0.0, 1.5, 151)
    total = energy(*cradle(t, n=3, e_N=1.0))
    assert total == pytest.approx(total[0], rel=1e-9)


def test_energy_only_falls_with_losses():
    total = energy(*cradle(np.linspace(0.0, 1.5, 301), n=3, e_N=0.8))
    assert np.diff(total).max() < 1e-9 and total[-1] < 0.95 * total[0]


def test_before_the_first_impact_it_is_a_pendulum():
    q, _ = cradle(np.linspace(0.0, 0.3, 31), n=3, raised=0.01)
    t = np.linspace(0.0, 0.3, 31)
    assert q[:, 0] == pytest.approx(0.01 * np.cos(np.sqrt(GRAVITY / LENGTH) * t), abs=1e-6)
    assert (q[:, 1:] == 0.0).all()
