"""Rotating bouncing ball, section 10.1: impact, slip and stick against the closed form and the printed numbers."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import references, robots

LAWS = ("second-order", "paper")
IMPACT = np.sqrt(2 * 0.9 / 9.81)
STICK = 0.7281199942
"""Times of the impact, and of the end of slip at omega = 50 [s]."""


def run(omega=50.0, dt=2e-3, t_end=1.5, laws="second-order", **parameters):
    scene, q0, v0 = robots.load("rotating_ball", omega=omega, **parameters)
    return nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(rho_inf=0.5, laws=laws))


def worst_error(trajectory, **parameters):
    """Largest error of x and z over the run [m]."""
    q, _ = references.rotating_ball(trajectory.t, **parameters)
    return np.abs(trajectory.q - q)[:, :2].max()


@pytest.mark.parametrize("laws", LAWS)
def test_forces_of_the_slipping_ball_are_the_printed_ones(laws):
    ball = run(laws=laws)
    hit = np.argmax(ball.La_N[:, 0])
    # the weight acts for a part of the step of the impact
    weight = 9.81 * ball.dt
    assert ball.t[hit - 1] <= IMPACT <= ball.t[hit]
    assert ball.La_N[hit, 0] == pytest.approx(np.sqrt(2 * 9.81 * 0.9), abs=weight)
    assert abs(ball.La_F[hit, 0]) == pytest.approx(0.2 * np.sqrt(2 * 9.81 * 0.9), abs=0.2 * weight)
    assert ball.La_F[hit, 0] == pytest.approx(-0.2 * ball.La_N[hit, 0], rel=1e-12)
    slipping, rolling = (ball.t >= ball.t[hit]) & (ball.t < STICK), ball.t > STICK + ball.dt
    assert ball.la_F[slipping, 0] == pytest.approx(-1.962, abs=1e-9)
    assert np.abs(ball.la_F[rolling, 0]).max() < 1e-9
    assert ball.la_N[slipping | rolling, 0] == pytest.approx(9.81, abs=1e-9)


@pytest.mark.parametrize("laws", LAWS)
def test_slip_ends_when_it_should(laws):
    ball = run(laws=laws)
    kinds = [(event.kind, event.contact) for event in ball.events]
    assert kinds == [("impact", "ball_0/ground"), ("stick", "ball_0/ground")]
    assert [event.t for event in ball.events] == pytest.approx([IMPACT, STICK], abs=2 * ball.dt)


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("omega", [50.0, 10.0])
def test_newton_has_almost_nothing_to_do(omega, laws):
    ball = run(omega=omega, laws=laws)
    assert ball.n_iter.max() <= 4
    assert ball.n_iter[1:].mean() < 0.05
    located = {"impact", "slip"} if omega == 50.0 else {"impact"}
    assert set(ball.solver_path[1:]) == ({"newton"} if laws == "paper" else {"newton", *located})


@pytest.mark.parametrize("omega", [50.0, 10.0])
@pytest.mark.parametrize(("dt", "bound"), [(1e-2, 2e-5), (1e-3, 3e-7)])
def test_motion_through_the_impact_is_of_second_order(omega, dt, bound):
    assert worst_error(run(omega=omega, dt=dt), omega=omega) < bound


@pytest.mark.parametrize(("dt", "error"), [(1e-2, 2.8e-3), (1e-3, 1.2e-4)])
def test_laws_of_the_paper_are_of_first_order(dt, error):
    assert worst_error(run(dt=dt, laws="paper")) == pytest.approx(error, rel=0.3)


@pytest.mark.parametrize("laws", LAWS)
def test_slow_ball_sticks_at_the_impact_and_rolls(laws):
    ball = run(omega=10.0, laws=laws)
    hit = np.argmax(ball.La_N[:, 0])
    # (53) with gamma_F = 0 after the impact
    assert ball.La_F[hit, 0] == pytest.approx(-2 / 7 * 0.1 * 10.0, abs=1e-9)
    assert np.abs(ball.La_F[hit + 1 :]).max() < 1e-9
    assert np.abs(ball.la_F).max() < 1e-9
    assert np.abs(ball.gamma_F[hit:]).max() < 1e-12


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize(("omega", "La_F"), [(-50.0, 0.8), (-10.0, 2 / 7)])
def test_friction_turns_round_with_the_spin(omega, La_F, laws):
    ball, mirrored = run(omega=omega, t_end=1.0, laws=laws), run(omega=-omega, t_end=1.0, laws=laws)
    assert ball.q[:, 0] == pytest.approx(-mirrored.q[:, 0], abs=1e-12)
    assert ball.La_F.max() >= La_F - 1e-9
    assert ball.la_F.min() > -1e-9


@pytest.mark.parametrize("laws", LAWS)
def test_bounces_accumulate_and_the_ball_comes_to_rest(laws):
    ball = run(omega=0.0, e_N=0.5, t_end=1.8, dt=1e-3, laws=laws)
    end = 3 * IMPACT
    assert ball.success
    assert ball.g_N.min() > -1e-12
    resting = ball.t > end + 0.01
    assert ball.la_N[resting, 0] == pytest.approx(9.81, abs=1e-8)
    # (44) leaves e_N times the speed after each step of rest, to the tolerance of the step
    rate = np.abs(ball.v[resting, 1])
    assert rate[0] < 1e-6
    assert (rate[1:] <= 0.5 * rate[:-1] + 1e-10 * 9.81 * ball.dt).all()
    assert np.abs(ball.v[-1]).max() < 1e-12
    assert ball.q[-1, 1] == pytest.approx(0.1, abs=1e-12)
    impacts = [event.t for event in ball.events if event.kind == "impact"]
    assert impacts[:5] == pytest.approx(IMPACT * (3 - 2 * 0.5 ** np.arange(5)), abs=3 * ball.dt)


@pytest.mark.parametrize("e_N", [0.0, 0.5, 0.8, 1.0])
def test_first_bounce_follows_newtons_law(e_N):
    ball = run(omega=0.0, e_N=e_N, t_end=0.5, dt=1e-3)
    hit = np.argmax(ball.La_N[:, 0])
    before, after = ball.v[hit - 1, 1], ball.v[hit, 1]
    assert ball.P_N[hit, 0] == pytest.approx(after - before + 9.81 * ball.dt, abs=1e-9)
    # at the moment of impact
    assert ball.impacts.t == pytest.approx([IMPACT], abs=1e-12)
    assert ball.impacts.v_before[0, 1] == pytest.approx(-9.81 * IMPACT, abs=1e-11)
    assert ball.impacts.v_after[0, 1] == pytest.approx(e_N * 9.81 * IMPACT, abs=1e-11)
    assert ball.impacts.P_N[0, 0] == pytest.approx((1 + e_N) * 9.81 * IMPACT, abs=1e-11)


@pytest.mark.parametrize("e_N", [0.5, 0.8, 1.0])
def test_papers_bounce_takes_the_velocities_of_the_ends_of_the_step(e_N):
    ball = run(omega=0.0, e_N=e_N, t_end=0.5, dt=1e-3, laws="paper")
    hit = np.argmax(ball.La_N[:, 0])
    assert ball.v[hit, 1] == pytest.approx(-e_N * ball.v[hit - 1, 1], abs=1e-9)  # (44)
    assert len(ball.impacts.t) == 0
