"""Derivatives of runs against closed forms: a ball that bounces, a body that slides to rest."""

import coal
import numpy as np
import pytest
from contact_scenes import balls

import ngalpha_pin as nga

G = 9.81
DT = 1e-2


def complex_step(function, x):
    """Derivatives of a closed form, shape (outputs, inputs), to all digits."""
    columns = []
    for i in range(len(x)):
        z = np.array(x, dtype=complex)
        z[i] += 1e-30j
        columns.append(np.imag(function(z)) / 1e-30)
    return np.array(columns).T


def bouncing(z0, vz0, e_N, t_end, radius=0.1):
    """Height and speed of a ball at the end, of complex numbers as well."""
    z, v, t = z0 - radius, vz0, 0.0
    while True:
        fall = (v + np.sqrt(v * v + 2.0 * G * z)) / G
        if t + fall.real > t_end:
            s = t_end - t
            return np.array([z + radius + v * s - G * s * s / 2.0, v - G * s])
        z, v, t = 0.0, -e_N * (v - G * fall), t + fall


def end(run, columns):
    derivatives = run.derivatives
    return np.concatenate((derivatives.q[-1], derivatives.v[-1]))[:, columns]


@pytest.mark.parametrize("t_end", (0.3, 0.7, 1.3))
def test_bounces_have_their_moments_in_the_derivatives(t_end):
    z0, vz0, e_N = 0.9, 0.3, 0.7
    run = nga.simulate(
        balls(1, mu=0.3, e_N=e_N), np.array([0.0, 0.0, z0]), np.array([0.4, 0.0, vz0]), t_end=t_end, dt=DT,
        sensitivities=nga.Sensitivities(q0=True, v0=True, parameters=["e_N"]),
    )  # fmt: skip
    assert (run.derivatives.status == "impact").sum() == len(run.impacts.t)
    exact = complex_step(lambda x: bouncing(*x, t_end), [z0, vz0, e_N])
    np.testing.assert_allclose(end(run, [2, 5, 6])[[2, 5]], exact, rtol=0, atol=1e-10)


def sliding(v0, mu, gravity_along, t_end):
    """Way and speed of a body that slides until it stops, on a plane along which part of gravity acts."""
    brakes = mu * G - gravity_along
    if brakes.real > 0.0 and (v0 / brakes).real < t_end:
        return np.array([v0 * v0 / (2.0 * brakes), 0.0 * v0])
    return np.array([v0 * t_end - brakes * t_end**2 / 2.0, v0 - brakes * t_end])


@pytest.mark.parametrize("t_end", (0.2, 0.6))
def test_a_slip_that_ends_has_its_moment_in_the_derivatives(t_end):
    v0, mu = 1.3, 0.35
    run = nga.simulate(
        balls(1, mu=mu), np.array([0.0, 0.0, 0.1]), np.array([v0, 0.0, 0.0]), t_end=t_end, dt=DT,
        sensitivities=nga.Sensitivities(v0=True, parameters=["mu[g0]", "mass[ball_0]"]),
    )  # fmt: skip
    stops = v0 / (mu * G) < t_end
    assert (run.derivatives.status == "switch").sum() == stops
    exact = complex_step(lambda x: sliding(x[0], x[1], 0.0, t_end), [v0, mu])
    np.testing.assert_allclose(end(run, [0, 3])[[0, 3]], exact, rtol=0, atol=1e-10)
    assert set(run.derivatives.vanishing) >= {"mass[ball_0]", "v0[2]"}


def oblique(x0, z0, vx0, mu, e_N, t_end):
    """A point that bounces once and slips in the impact: friction takes mu times the normal percussion."""
    t = np.sqrt(2.0 * (z0 - 0.1) / G)
    v = G * t
    vx, s = vx0 - mu * (1.0 + e_N) * v, t_end - t
    return np.array([x0 + vx0 * t + vx * s, 0.1 + e_N * v * s - G * s * s / 2.0, vx, e_N * v - G * s])


def test_friction_of_an_impact_is_in_the_derivatives():
    x = [0.2, 0.7, 3.0, 0.25, 0.6]
    run = nga.simulate(
        balls(1, mu=x[3], e_N=x[4]), np.array([x[0], 0.0, x[1]]), np.array([x[2], 0.0, 0.0]), t_end=0.5, dt=DT,
        sensitivities=nga.Sensitivities(q0=True, v0=True, parameters=["mu", "e_N"]),
    )  # fmt: skip
    exact = complex_step(lambda z: oblique(*z, 0.5), x)
    np.testing.assert_allclose(end(run, [0, 2, 3, 6, 7])[[0, 2, 3, 5]], exact, rtol=0, atol=1e-10)


def test_two_elastic_balls_exchange_their_motion():
    scene = nga.Scene(balls(2).model)
    for i in range(2):
        scene.add_geometry(f"b{i}", coal.Sphere(0.1), parent=f"ball_{i}")
    scene.add_contact("b0", "b1", mu=0.0, e_N=1.0)
    scene.model.gravity.linear = np.zeros(3)
    run = nga.simulate(
        scene, np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0]), np.array([1.0, 0, 0, 0, 0, 0]), t_end=1.0, dt=0.03,
        sensitivities=nga.Sensitivities(q0=True, v0=True),
    )  # fmt: skip
    # the second ball goes on from where the first one hits it: x2 = x1 + 0.2 + v1 t
    np.testing.assert_allclose(end(run, [0, 3, 6, 9])[3], [1.0, 0.0, 0.99, 0.0], atol=1e-10)


@pytest.mark.parametrize("height", (1e-2, 1e-4))
def test_grazing_grows_like_one_over_the_speed_of_approach(height):
    t_end = np.sqrt(2 * height / G) + 2e-3
    run = nga.simulate(
        balls(1, e_N=0.9), np.array([0.0, 0.0, 0.1 + height]), t_end=t_end, dt=t_end / 7,
        sensitivities=nga.Sensitivities(q0=True),
    )  # fmt: skip
    exact = complex_step(lambda x: bouncing(x[0], 0.0 * x[0], 0.9, t_end), [0.1 + height])
    np.testing.assert_allclose(end(run, [2])[[2, 5]], exact, rtol=1e-7)
    assert run.derivatives.approach == pytest.approx(np.sqrt(2 * G * height), rel=1e-6)


@pytest.mark.parametrize("steps", (40, 40 + 1e-9, 40 - 1e-9))
def test_an_impact_at_the_end_of_a_step_has_its_moment(steps):
    z0, t_end = 0.1 + G * (steps * DT) ** 2 / 2, 0.5
    run = nga.simulate(
        balls(1, e_N=0.5), np.array([0.0, 0.0, z0]), t_end=t_end, dt=DT, sensitivities=nga.Sensitivities(q0=True)
    )
    exact = complex_step(lambda x: bouncing(x[0], 0.0 * x[0], 0.5, t_end), [z0])
    np.testing.assert_allclose(end(run, [2])[[2, 5]], exact, rtol=1e-6)


def test_bounces_that_accumulate_leave_a_ball_at_rest():
    run = nga.simulate(
        balls(1, e_N=0.3), np.array([0.0, 0.0, 0.2]), t_end=0.5, dt=DT,
        sensitivities=nga.Sensitivities(q0=True, parameters=["e_N"]),
    )  # fmt: skip
    assert np.abs(run.v[-1]).max() < 1e-9
    np.testing.assert_allclose(end(run, [2, 3])[[2, 5]], 0.0, atol=1e-9)


def test_a_box_that_slides_on_four_corners_moves_as_a_point():
    scene, q0, v0 = nga.robots.load("box_on_incline")
    with pytest.warns(UserWarning, match="a derivative among several at t = 0.01 s.* are not determined"):
        run = nga.simulate(scene, q0, v0, t_end=0.1, dt=DT, sensitivities=nga.Sensitivities(v0=True))
    assert set(run.derivatives.status[1:]) == {"dependent"}
    along = run.derivatives.q[-1, 0, 0]
    assert run.derivatives.v[-1, 0, 0] == pytest.approx(1.0, abs=1e-12) and along == pytest.approx(0.1, abs=1e-12)
