"""Ball in cylinder, section 10.3: slip and stick on a wall that must not be entered, at large steps."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import references, robots

DT = 1e-2


def run(dt, t_end, method):
    scene, q0, v0 = robots.load("ball_in_cylinder")
    return nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=method)


@pytest.fixture(scope="module")
def ball():
    return run(DT, 6.0, nga.GeneralizedAlpha(rho_inf=0.5))


def test_stays_on_the_wall_to_the_last_digits(ball):
    assert np.abs(ball.g_N).max() < 1e-10
    assert ball.audit().penetration < 1e-10
    assert np.abs(np.hypot(ball.q[:, 0], ball.q[:, 1] - 1.0) - 0.9).max() < 1e-10


def test_moreau_sinks_in_at_the_same_step(ball):
    moreau = run(DT, 6.0, nga.MoreauJean(theta=0.5))
    assert moreau.g_N.min() < -1e-3


def test_slips_and_sticks_when_it_should(ball):
    starts, slips, _ = references.ball_in_cylinder_arcs(6.0)
    # where a stick is shorter than a step, the slip turns round without it
    length = np.diff([*starts, 6.0])
    clear = [i for i in range(1, len(starts)) if min(length[i - 1 : i + 1]) > 3 * DT and 0 in slips[i - 1 : i + 1]]
    assert len(clear) >= 4
    for i in clear:
        kind = "stick" if slips[i] == 0 else "slip"
        assert any(e.kind == kind and abs(e.t - starts[i]) < 2 * DT for e in ball.events), (kind, starts[i])


def test_second_order_while_it_slips():
    errors = []
    for dt in (1e-2, 5e-3):
        ball = run(dt, 0.7, nga.GeneralizedAlpha(rho_inf=0.5))
        q, v = references.ball_in_cylinder(ball.t)
        errors.append((np.abs(ball.q - q)[:, :2].max(), np.abs(ball.v - v)[5:].max()))
    for coarse, fine in zip(*errors, strict=True):
        assert fine < coarse / 3.6


def test_follows_slip_and_stick(ball):
    q, _ = references.ball_in_cylinder(ball.t)
    error = np.abs(ball.q - q)[:, :2].max(axis=1)
    # dt^2 times accelerations of some ten m/s^2, until the slip first ends
    assert error[ball.t < 0.7].max() < 20 * DT**2
    # a change between slip and stick is known to one step, in which the acceleration jumps by 2 mu la_N / m = 5 m/s^2
    # at most; the ball moves on with that for half of a swing of 1 s
    assert error.max() < 5 * DT * 0.5


def test_normal_force_carries_weight_and_turn(ball):
    n = -(ball.q[:, :2] - [0.0, 1.0]) / 0.9
    expected = (ball.v[:, :2] ** 2).sum(axis=1) / 0.9 + 9.81 * n[:, 1]
    assert ball.la_N[1:, 0] == pytest.approx(expected[1:], abs=1e-6)
    assert (np.abs(ball.la_F[:, 0]) <= 0.1 * ball.la_N[:, 0] + 1e-8).all()


def test_rolls_without_slip_on_a_rough_wall():
    scene, q0, v0 = robots.load("ball_in_cylinder", mu=2.0)
    ball = nga.simulate(scene, q0, v0, t_end=2.0, dt=DT, method=nga.GeneralizedAlpha(rho_inf=0.5))
    n = -(ball.q[:, :2] - [0.0, 1.0]) / 0.9
    # near the height of the axis mu la_N is too small for any mu
    rolls = (ball.t > 0.2) & (ball.t < 1.2)
    assert np.abs(ball.gamma_F[rolls]).max() < 1e-9
    assert (np.abs(ball.v[:, 0] * n[:, 1] - ball.v[:, 1] * n[:, 0] + 0.1 * ball.v[:, 2])[rolls]).max() < 1e-9
