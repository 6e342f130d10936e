"""Gaps, slip velocities and their accelerations of features that roll, against finite differences."""

import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import ARRANGEMENTS, all_rows
from feature_scenes import ALL, feature_system
from motions import STEP, along, carried, central, same

import ngalpha_pin as nga
from ngalpha_pin.collision.manifold import SLOTS

CASES = [(i, arrangement, seed) for i in range(0, len(ALL), SLOTS) for arrangement in ARRANGEMENTS for seed in (3, 5)]


@pytest.fixture(params=CASES, ids=lambda c: f"{c[0]} {c[1]} {c[2]}")
def case(request):
    i, arrangement, seed = request.param
    return feature_system(ALL[i : i + SLOTS], arrangement, seed)


def surface(system, q):
    """Pose of the body of side A."""
    data = system.model.createData()
    pin.forwardKinematics(system.model, data, q)
    return data.oMi[system.slots.pairs[0].joints[0]]


def test_rates_are_the_derivatives_of_the_gaps(case):
    system, q, v, a = case
    rows = all_rows(system, q, v, a)
    found = central(lambda s: all_rows(system, pin.integrate(system.model, q, s * v), v, a).g_N)
    assert same(rows.rate[:SLOTS], found, 1e-6)
    assert rows.W @ v == pytest.approx(rows.rate, abs=1e-12)


def test_normals_are_stationary(case):
    """No turning of the normal changes the separation to first order, and the gap is that along the normal."""
    system, q, v, a = case
    rows = all_rows(system, q, v, a)
    k = SLOTS
    for i in range(k):
        frame = np.array([*rows.directions[k + 3 * i : k + 3 * i + 2], rows.normals[i]])
        assert np.abs(frame @ frame.T - np.eye(3)).max() < 1e-12
    p_A, p_B, _ = rows._points(slice(None))
    straight = [np.column_stack((rows._a.E[i], rows._b.E[i])) for i in range(k)]
    for i in range(k):
        n, E = rows.normals[i], straight[i]
        apart = p_B[i] - p_A[i] - rows.g_N[i] * n
        assert np.abs(n @ E).max() < 1e-10
        # what is left lies in the straight directions
        assert np.linalg.norm(apart - E @ np.linalg.lstsq(E, apart, rcond=None)[0]) < 1e-9


def test_accelerations_are_the_derivatives_of_the_rates(case):
    system, q, v, a = case
    at = all_rows(system, q, v, a), surface(system, q)
    found = central(lambda s: followed(system, *along(system.model, q, v, a, s), at))
    assert same(at[0].acceleration, found, 1e-6)


def test_derivative_of_the_rates_by_the_configuration(case):
    system, q, v, a = case
    rows = all_rows(system, q, v, a)
    at, X = (rows, surface(system, q)), rows.derivatives(system.motion(v, a))[0]
    every = np.eye(system.model.nv)
    found = [central(lambda s, e=e: followed(system, pin.integrate(system.model, q, s * e), v, at)) for e in every]
    assert same(X, np.array(found).T, 1e-6)


def test_derivative_of_the_accelerations_by_the_velocity(case):
    system, q, v, a = case
    Y = all_rows(system, q, v, a).derivatives(system.motion(v, a))[1]
    every = np.eye(system.model.nv)
    found = [central(lambda s, e=e: all_rows(system, q, v + s * e, a).acceleration) for e in every]
    assert same(Y, np.array(found).T, 1e-6)


def followed(system, q, v, at):
    """As `carried`, with the pose of side A."""
    return carried(system, q, v, at, surface)


@pytest.mark.parametrize("side", "ab")
def test_features_that_roll_on_moving_surfaces(side):
    pairs = [("side", "side"), ("rim", "edge"), ("face", "ellipsoid"), ("ellipsoid", "face"), ("ball", "rim")]
    names = ("b", "a") if side == "a" else ("a", "b")
    T = 0.4
    moving = nga.SurfaceVelocity(
        (0.7, -0.4, 0.3), (0.5, 0.8, -1.1), (0.2, -0.1, 0.3), lambda t: (1.0 + 0.5 * np.sin(3 * t), 1.5 * np.cos(3 * t))
    )
    system, q, v, a = feature_system(
        (3 * pairs)[:SLOTS], "moving", 3, names, mu=0.4, contact_radius=0.2, rolling_resistance=0.1,
        surface_velocity=moving,
    )  # fmt: skip
    rows = all_rows(system, q, v, a, T)
    at, every = (rows, surface(system, q)), np.eye(system.model.nv)
    assert np.abs(rows.surface_rate[SLOTS:]).min() > 1e-3
    X, Y = rows.derivatives(system.motion(v, a, T))
    found = central(lambda s: carried(system, *along(system.model, q, v, a, s), at, surface, T + s))
    assert same(rows.acceleration, found, 1e-6)
    moved = [pin.integrate(system.model, q, STEP * e) for e in (*every, *-every)]
    rates = np.array([carried(system, x, v, at, surface, T) for x in moved])
    by_v = [central(lambda s, e=e: all_rows(system, q, v + s * e, a, T).acceleration) for e in every]
    n = len(every)
    assert same(X, (rates[:n] - rates[n:]).T / (2 * STEP), 1e-6) and same(Y, np.array(by_v).T, 1e-6)
