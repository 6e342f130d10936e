"""Rows, gaps and rates that the compiled kernel finds are those of numpy."""

import numpy as np
import pytest
from contact_scenes import ARRANGEMENTS, PAIRS, pair_scene, random_state

from ngalpha_pin import robots
from ngalpha_pin.contact.kernel_rows import KernelRows, gaps_and_rates, rows_at
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.system.system import System


@pytest.mark.skipif(kernel.library is None, reason=f"no compiled kernel: {kernel.origin}")
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("pair", PAIRS)
def test_rows_of_the_kernel_are_those_of_numpy(pair, arrangement):
    system = System(pair_scene(pair, arrangement))
    q, v, a = random_state(system.model, 1)
    sub = system.contacts.subset(np.arange(system.contacts.n))
    system.dynamics(0.0, q, v, a)
    found, wanted = rows_at(system, sub, q, v, a), system.contact_rows(sub, q, v, a)
    assert isinstance(found, KernelRows) == (len(sub.slots) == 0)
    for name in ("g_N", "W", "rate", "acceleration", "sizes"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), rtol=1e-12, atol=1e-12)
    gaps, rates = gaps_and_rates(system, sub, q, v)
    np.testing.assert_allclose(gaps, wanted.g_N, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(rates, wanted.rate[: sub.k], rtol=1e-12, atol=1e-12)


@pytest.mark.skipif(kernel.library is None, reason=f"no compiled kernel: {kernel.origin}")
def test_more_contacts_than_the_kernel_takes_come_in_pieces(monkeypatch):
    """Hands and feet of meshes have thousands of corners; limits of joints come after them."""
    monkeypatch.setattr(kernel, "PLACED", 5)
    scene, q, _ = robots.load("anymal")
    system = System(scene)
    v = np.random.default_rng(0).normal(size=system.nv)
    sub = system.contacts.subset(np.arange(system.contacts.n))
    gaps, rates = gaps_and_rates(system, sub, q, v)
    rows = system.rows_of_gaps(sub, q)
    np.testing.assert_allclose(gaps, rows.g_N, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(rates, rows.move(system.motion(v, 0.0 * v)).rate[: sub.k], rtol=1e-12, atol=1e-12)
    assert sub.plan is None
