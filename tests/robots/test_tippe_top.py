"""Tippe top, section 10.6: drilling friction turns it over; order, energy, and the long run to the stick and back."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import references, robots
from ngalpha_pin.references.spinning_body import rotation
from ngalpha_pin.robots.tippe_top import inclination

T_END = 1.3
BOTH_CLOSED = 2.44843
"""theta with body and stick on the ground: cos theta = (R_2 - R_1) / (a_2 - a_1) [rad]."""


def run(dt, t_end=T_END, **options):
    scene, q0, v0 = robots.load("tippe_top")
    return nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(rho_inf=0.5, **options))


def worst_error(top):
    """Largest error of theta over the run [rad]."""
    q, _ = references.tippe_top(top.t)
    return np.abs(inclination(top.q) - inclination(q)).max()


def error_at_the_end(top):
    """Error of theta(1.3 s) [rad]."""
    q, _ = references.tippe_top(top.t[-1:])
    return abs(inclination(top.q[-1]) - inclination(q[0]))


def slope(sizes, errors):
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


@pytest.fixture(scope="module")
def top():
    return run(1e-3)


def test_inclination_is_of_second_order():
    sizes = [2e-3, 1e-3, 5e-4]
    errors = [worst_error(run(dt)) for dt in sizes]
    assert slope(sizes, errors) >= 1.9, errors


@pytest.mark.long
def test_inclination_is_of_second_order_down_to_small_steps():
    sizes = [2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4]
    tops = [run(dt) for dt in sizes]
    errors = [worst_error(top) for top in tops]
    assert slope(sizes, errors) >= 1.9, errors
    # at the end the error passes through zero with dt, so that only the smallest steps show its order
    errors = [error_at_the_end(top) for top in tops]
    assert slope(sizes[2:], errors[2:]) >= 1.9, errors


def test_default_laws_are_ten_times_as_exact_as_the_papers(top):
    assert worst_error(top) < 0.1 * worst_error(run(1e-3, laws="paper"))


def test_quaternion_stays_a_unit_one(top):
    assert np.abs(np.linalg.norm(top.q[:, 3:], axis=1) - 1).max() < 1e-14


def test_contact_keeps_closed_and_friction_within_its_cone(top):
    audit = top.audit()
    assert audit.ok, str(audit)
    closed = top.t > 0.01
    assert np.abs(top.g_N[closed, 0]).max() < 1e-12
    assert (top.g_N[:, 1] > 0).all()
    assert top.n_iter[1:].mean() < 4


def test_drilling_row_is_there_and_works(top):
    assert [rows.stop - rows.start for rows in top.friction_rows] == [3, 3]
    _, _, directions = top.contact_frames(100)
    assert not directions[2].any()
    # friction and drilling share one cone (157)
    sliding = top.t > 0.1
    size = np.linalg.norm(top.la_F[:, :3], axis=1)
    assert size[sliding] == pytest.approx(0.3 * top.la_N[sliding, 0], rel=1e-8)


def test_spin_changes_as_the_moment_of_friction_says(top):
    """Friction and drilling alone have a moment about the vertical through the centre of mass."""
    inertia, lever = np.array([8e-7, 8e-7, 7e-7]), 3 * np.pi * 5e-4 / 16
    vertical, moment = np.zeros(len(top.t)), np.zeros(len(top.t))
    for i in range(len(top.t)):
        vertical[i] = rotation(top.q[i, 3:])[2] @ (inertia * top.v[i, 3:])
        points, _, d = top.contact_frames(i)
        arm = points[0] - top.q[i, :3]
        moment[i] = np.cross(arm, top.la_F[i, :2] @ d[:2])[2] + lever * top.la_F[i, 2]
    later = slice(100, None)
    change = np.diff(vertical[[100, -1]])
    # the rule of quadrature is of second order: (spin dt)^2
    assert change == pytest.approx(np.trapezoid(moment[later], top.t[later]), rel=(180 * top.dt) ** 2)


def test_energy_only_falls(top):
    later = top.energy.total[20:]
    assert np.diff(later).max() < 1e-6 * np.ptp(top.energy.total)


@pytest.fixture(scope="module")
def whole():
    return run(1e-3, 8.0)


@pytest.mark.long
def test_turns_over_stands_on_the_stick_and_falls_back(whole):
    theta = inclination(whole.q)
    assert whole.success
    assert theta.max() > 2.9
    upright = whole.t[theta.argmax()]
    both = (whole.t > upright) & (np.abs(whole.g_N) < 1e-10).all(axis=1)
    assert both.any()
    assert theta[both] == pytest.approx(BOTH_CLOSED, abs=1e-5)
    assert (whole.la_N[both] >= 0).all()
    # when the spin is used up it falls back
    assert theta[-1] < BOTH_CLOSED - 0.1
    assert whole.g_N[-1, 1] > 1e-3


@pytest.mark.long
def test_long_run_is_clean(whole):
    assert whole.audit().ok, str(whole.audit())
    assert np.abs(np.linalg.norm(whole.q[:, 3:], axis=1) - 1).max() < 1e-14
