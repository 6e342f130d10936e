"""Ball in corner, section 10.2: to rest between two planes, where the force directions are dependent."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import references, robots

DT = 1e-3
LAWS = ("second-order", "paper")


@pytest.fixture(scope="module", params=LAWS)
def ball(request):
    scene, q0, v0 = robots.load("ball_in_corner")
    return nga.simulate(scene, q0, v0, t_end=2.0, dt=DT, method=nga.GeneralizedAlpha(rho_inf=0.5, laws=request.param))


def test_comes_to_rest_on_both_planes(ball):
    rest = ball.t > 1.4
    assert np.abs(ball.q[rest, :2] - [0.0, 0.1 * np.sqrt(2)]).max() < 1e-10
    assert np.abs(ball.v[-1]).max() < 1e-9
    assert np.abs(ball.g_N[rest]).max() < 1e-10
    # which of many equilibria holds the ball is not determined, but they hold its weight
    points, normals, directions = ball.contact_frames(len(ball.t) - 1)
    force = ball.la_N[-1] @ normals + ball.la_F[-1] @ directions
    assert force == pytest.approx([0.0, 0.0, 9.81], abs=1e-7)


def test_goes_through_singular_matrices(ball):
    assert ball.success
    assert {"minimum-norm", "fixed-point"} & set(ball.solver_path)
    assert ball.n_iter[1:].mean() < 3


def test_obeys_the_laws_all_the_way(ball):
    audit = ball.audit()
    assert audit.ok, str(audit)
    assert audit.penetration < 1e-10
    assert audit.cone_violation < 1e-9


def test_follows_the_exact_motion_as_closely_as_its_impacts_are_known_in_time(ball):
    q, _ = references.ball_in_corner(ball.t)
    fastest = np.abs(ball.v[:, :2]).max()
    assert np.abs(ball.q - q)[:, :2].max() < fastest * DT


def test_first_impact_is_the_printed_one(ball):
    arc = references.ball_in_corner_arcs()[1]
    hit = np.flatnonzero(ball.P_N[:, 1] > 0)[0]
    assert ball.t[hit - 1] <= arc.t <= ball.t[hit]
    assert ball.P_N[hit, 1] == pytest.approx(arc.La_N[1], abs=9.81 * DT)
    assert abs(ball.P_F[hit, 1]) == pytest.approx(abs(arc.La_F[1]), abs=9.81 * DT)


def test_loses_energy_only(ball):
    total = ball.energy.total
    assert np.diff(total).max() < 1e-6 * np.ptp(total)
