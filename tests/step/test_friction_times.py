"""For how long friction acts: since an impact within the step, and half a step where a contact has carried before."""

import numpy as np

from ngalpha_pin import robots
from ngalpha_pin.step.friction_times import friction_times
from ngalpha_pin.system.system import System

DT, IMPULSE, FRICTION = 1e-2, 2.0, np.array([0.3, -0.4])


def times(since, carried=False, impulse=IMPULSE):
    """Ratio and share of one contact whose percussion has acted for a time, kappa_hat_N = since P_N."""
    system = System(robots.load("tippe_top")[0])
    sub = system.contacts.subset(np.array([0]))
    z = np.zeros(sub.k + 2 * (sub.k + sub.m))
    z[:2] = since * impulse, impulse
    z[2 : 2 + len(FRICTION)] = FRICTION
    ratio, share = friction_times(sub, z, DT, np.array([carried]))
    return ratio[0], share[: len(FRICTION)]


def test_an_impact_within_the_step_has_acted_since_then():
    ratio, share = times(0.3 * DT)
    assert np.isclose(ratio, 0.3 * DT, rtol=1e-15)
    assert np.allclose(share, FRICTION / IMPULSE, rtol=1e-15)


def test_friction_acts_within_the_step():
    for since, expected in ((-0.2 * DT, 0.0), (1.3 * DT, DT)):
        ratio, share = times(since)
        assert ratio == expected and not share.any()


def test_contacts_without_percussion_and_those_that_have_carried_have_half_a_step():
    for ratio, share in (times(0.0, impulse=0.0), times(0.3 * DT, carried=True)):
        assert ratio == DT / 2 and not share.any()
