"""References of rolling and rocking: what mechanics says of them, and the order in which the method comes to them."""

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import references, robots
from ngalpha_pin.references import rocking, rolling
from ngalpha_pin.references.spinning_body import rotation
from ngalpha_pin.report.points import MaterialPoints, largest_distance

THETA, RHO = 1.0, 0.5


def errors_of(start, reference, sizes, t_end, rho_inf):
    """Largest distances of the material points from the reference."""
    points, errors = MaterialPoints(start[0]), []
    for dt in sizes:
        run = nga.simulate(*start, t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(rho_inf=rho_inf))
        errors.append(largest_distance(points.positions(run.q), points.positions(reference(run.t)[0])))
    return np.array(errors)


def order(errors):
    return np.log2(errors[:-1] / errors[1:])[-1]


def wobbling():
    """The disc of the steady precession, which also falls over at the start."""
    scene, q0, v0 = robots.load("rolling_disc", theta=THETA, rho=RHO)
    v0 = v0.copy()
    A = rotation(q0[3:])
    v0[3:] += A.T @ np.array([0.0, 1.5, 0.0])  # about the horizontal diameter
    v0[:3] = np.cross(rolling._arm(A[:, 2]), A @ v0[3:])
    return scene, q0, v0


def kinetic_and_potential(q, v):
    return (v[:, :3] ** 2).sum(axis=1) / 2 + v[:, 3:6] ** 2 @ rolling.DISC / 2 + rolling.GRAVITY * q[:, 2]


def test_steady_precession_is_a_solution_of_free_rolling():
    t = np.linspace(0.0, 1.0, 21)
    _, q0, v0 = robots.load("rolling_disc", theta=THETA, rho=RHO)
    steady, free = references.rolling_disc(t, THETA, RHO), references.free_rolling_disc(t, q0, v0)
    turns = [rotation(p) for p in steady[0][:, 3:]], [rotation(p) for p in free[0][:, 3:]]
    assert np.abs(steady[0][:, :3] - free[0][:, :3]).max() < 1e-9
    assert np.abs(np.array(turns[0]) - turns[1]).max() < 1e-8
    assert np.abs(steady[1] - free[1]).max() < 1e-7


def test_free_disc_keeps_its_energy_and_rolls():
    scene, q0, v0 = wobbling()
    t = np.linspace(0.0, 0.6, 601)
    q, v = references.free_rolling_disc(t, q0, v0)
    assert np.ptp(kinetic_and_potential(q, v)) < 1e-10
    assert np.ptp(q[:, 2]) > 5e-3
    # the velocities are the rates of the positions, and the lowest point of the rim is at rest on the ground
    middle = slice(1, -1)
    assert np.gradient(q[:, :3], t, axis=0)[middle] == pytest.approx(v[middle, :3], abs=2e-3)
    for q_i, v_i in zip(q, v, strict=True):
        A = rotation(q_i[3:])
        arm = rolling._arm(A[:, 2])
        assert np.abs(v_i[:3] + np.cross(A @ v_i[3:], arm)).max() < 1e-12
        assert abs(q_i[2] + arm[2]) < 1e-15


def test_method_comes_to_the_rolling_disc_in_second_order():
    start = wobbling()
    free = errors_of(start, lambda t: references.free_rolling_disc(t, *start[1:]), (8e-3, 4e-3), 0.2, 0.9)
    assert order(free) == pytest.approx(2.0, abs=0.1) and free[-1] < 1e-3
    steady = robots.load("rolling_disc", theta=THETA, rho=RHO)
    circle = errors_of(steady, lambda t: references.rolling_disc(t, THETA, RHO), (8e-3, 4e-3), 0.2, 0.9)
    assert order(circle) == pytest.approx(2.0, abs=0.1) and circle[-1] < 1e-3


@pytest.mark.parametrize("j", [2 / 5, 2 / 3])
def test_method_comes_to_the_ball_on_the_turntable_in_second_order(j):
    start = robots.load("turntable", j=j)
    errors = errors_of(start, lambda t: references.turntable(t, j=j), (1e-2, 5e-3), 1.0, 0.9)
    assert order(errors) == pytest.approx(2.0, abs=0.1) and errors[-1] < 1e-3
    q, v = references.turntable(np.linspace(0.0, 1.0, 11), j=j)
    world = np.array([rotation(p) @ w for p, w in zip(q[:, 3:7], v[:, 3:6], strict=True)])
    # the lowest point goes with the table, and the ball does not turn about the vertical
    at_table = v[:, :2] + 0.1 * np.column_stack([-world[:, 1], world[:, 0]])
    assert at_table == pytest.approx(3.0 * np.column_stack([-q[:, 1], q[:, 0]]), abs=1e-12)
    assert np.abs(world[:, 2]).max() < 1e-10


def test_rocking_block_loses_at_every_impact_what_housner_says():
    starts, _, arcs = rocking.rocking_arcs(0.15, 2.0)
    assert len(starts) >= 4
    for start, before, after in zip(starts[1:], arcs[:-1], arcs[1:], strict=False):
        assert abs(before(start)[0]) < 1e-11
        assert after(start)[1] == pytest.approx((1 - 1.5 * 0.1**2 / 0.17) * before(start)[1], rel=1e-12)
    t = np.linspace(0.0, 1.6, 801)
    q, v = references.rocking_block(t)
    energy = v[:, :2] ** 2 @ [1.0, 1.0] + (2.0 / 3.0 * 0.17) * v[:, 2] ** 2 / 2 + 2.0 * 9.81 * q[:, 1]
    assert np.diff(energy).max() < 1e-9 * np.ptp(energy)
    assert len(np.unique(np.round(energy, 8))) == sum(start < 1.6 for start in starts)


def test_method_comes_to_the_rocking_block_in_second_order():
    errors = errors_of(robots.load("rocking_block"), references.rocking_block, (1e-2, 5e-3, 2.5e-3), 1.6, 0.5)
    assert np.log(errors[0] / errors[-1]) / np.log(4.0) >= 1.8
    assert errors[-1] < 1e-3
