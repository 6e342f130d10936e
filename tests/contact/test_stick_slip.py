"""A block on a moving belt sticks and slips, by friction of a contact or of a joint: against the closed form."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

import ngalpha_pin as nga
from ngalpha_pin import robots

M, K, MU, FALLING, SPEED, G = 1.0, 100.0, 0.4, 2.0, 0.3, 9.81
HOLD = MU * M * G  # the largest friction force [N]


def slip_phase():
    """Position and velocity of the block as functions of the time since it came loose, and how long it slips.

    m x_ddot - c x_dot + k x = F - c v with the belt speed v, from x = F / k with the speed of the belt until it has
    that speed again: an oscillator with negative damping around (F - c v) / k.
    """
    growth = FALLING / (2 * M)
    w = np.sqrt(K / M - growth**2)
    centre, a = (HOLD - FALLING * SPEED) / K, FALLING * SPEED / K
    b = (SPEED - growth * a) / w

    def x(s):
        return centre + np.exp(growth * s) * (a * np.cos(w * s) + b * np.sin(w * s))

    def v(s):
        return np.exp(growth * s) * ((growth * a + w * b) * np.cos(w * s) + (growth * b - w * a) * np.sin(w * s))

    return x, v, brentq(lambda s: v(s) - SPEED, 1.05 * np.pi / w, 2 * np.pi / w, xtol=1e-15)


def motion(t):
    """Position of the block, carried along from x = 0, and the length of a period."""
    x, _, slips = slip_phase()
    first = HOLD / K / SPEED
    period = slips + (HOLD / K - x(slips)) / SPEED
    s = np.where(t < first, 0.0, (t - first) % period)
    later = np.where(s < slips, x(np.minimum(s, slips)), x(slips) + SPEED * (s - slips))
    return np.where(t < first, SPEED * t, later), period


def belt_and_block():
    """A block with dry friction on a joint that the belt carries: coordinates of the belt, of the block on it."""
    model = pin.Model()
    belt = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "belt")
    model.appendBodyToJoint(belt, pin.Inertia.FromSphere(5.0, 0.1), pin.SE3.Identity())
    block = model.addJoint(belt, pin.JointModelPX(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(block, pin.Inertia.FromSphere(M, 0.1), pin.SE3.Identity())
    model.addJointFrame(belt)
    model.addJointFrame(block)
    model.upperDryFrictionLimit = np.array([0.0, HOLD])
    model.lowerDryFrictionLimit = -model.upperDryFrictionLimit
    scene = nga.Scene(model)
    scene.add_constraint(nga.JointTrajectory("belt", lambda t: (SPEED * t, SPEED, 0.0)))
    scene.add_force(nga.Control(lambda t, q, v: np.array([0.0, FALLING * v[1]]), derivatives=True))
    # the spring pulls at the block, and with it at both coordinates
    scene.add_force(nga.Control(lambda t, q, v: -K * (q[0] + q[1]) * np.ones(2), derivatives=True))
    return scene, np.zeros(2), np.array([SPEED, 0.0])


def block_on_half_space():
    """The system of `robots`, with a sphere in place of the four corners of the block."""
    scene, q0, v0 = robots.load("belt", speed=SPEED, mass=M, stiffness=K, mu=MU, falling=FALLING)
    scene.contacts.clear()
    scene.add_geometry("foot", coal.Sphere(0.01), parent="block", placement=pin.SE3(np.eye(3), np.array([0, 0, -0.04])))
    scene.add_contact("foot", "surface", mu=MU)
    return scene, q0, v0


SCENES = {
    "contact": (block_on_half_space, lambda q: q[:, 1]),
    "joint friction": (belt_and_block, lambda q: q.sum(axis=1)),
}


@pytest.mark.parametrize("kind", SCENES)
def test_block_sticks_and_slips_with_its_period(kind):
    load, position = SCENES[kind]
    _, period = motion(np.zeros(1))
    errors = []
    for dt in (1e-2, 5e-3):
        run = nga.simulate(*load(), t_end=2.2 * period, dt=dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
        x, _ = motion(run.t)
        errors.append(np.abs(position(run.q) - x).max())
    assert errors[-1] < 1e-2 * np.ptp(x)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.3)
    loose = position(run.q) - HOLD / K
    before = np.flatnonzero((loose[:-1] <= 0.0) & (loose[1:] > 0.0))
    starts = run.t[before] - loose[before] / SPEED
    assert np.diff(starts) == pytest.approx(period, rel=3e-3)


def test_block_of_the_robots_on_its_four_corners():
    """Redundant contacts: the same motion."""
    run = nga.simulate(*robots.load("belt"), t_end=0.9, dt=1e-2, method=nga.GeneralizedAlpha(rho_inf=0.9))
    x, _ = motion(run.t)
    assert np.abs(run.q[:, 1] - x).max() < 1e-2 * np.ptp(x)
    assert run.audit().cone_violation < 1e-6
    assert run.audit().penetration < 1e-12


def test_while_it_sticks_it_goes_exactly_with_the_belt():
    scene, q0, v0 = block_on_half_space()
    run = nga.simulate(scene, q0, v0, t_end=0.12, dt=1e-2)
    assert np.abs(run.v[:, 1] - SPEED).max() < 1e-14
    assert run.la_F[:, 0] == pytest.approx(K * run.q[:, 1], abs=1e-9)
