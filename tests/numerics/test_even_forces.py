"""Forces that are not unique: a cube on four corners, pushed at its top, and one that slides on another."""

import coal
import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin.numerics.even_forces import even_forces
from ngalpha_pin.numerics.proximal_newton import Rows

CORNERS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])


def cube(mu):
    """Directions and laws of a body of unit mass and inertia on four corners, 1 m below and beside its centre."""

    def row(at, along):
        return np.concatenate((along, np.cross(at, along)))

    at = np.column_stack((CORNERS, -np.ones(4)))
    x, y, z = np.eye(3)
    W = np.array([row(p, z) for p in at] + [row(p, along) for p in at for along in (x, y)])
    return W, Rows(np.full(4, mu), np.repeat(np.arange(4), 2))


def evened(mu, load, la):
    W, rows = cube(mu)
    return W, even_forces(W @ W.T, W @ load, rows, la, np.ones(4, dtype=bool), np.zeros(8))


def braced(W, load, normal):
    """Forces that carry a load with given normal ones, and friction that cancels along a side."""
    F = np.linalg.lstsq(W[4:].T, -load - W[:4].T @ normal, rcond=None)[0]
    assert W[4:].T @ F + W[:4].T @ normal == pytest.approx(-load, abs=1e-12)
    return np.concatenate((normal, F + 0.1 * np.array([0.0, 1.0, 0, -1.0, 0, 0, 0, 0])))


def test_normal_forces_are_even_and_friction_in_proportion_to_them():
    load = np.array([1.0, 0.0, -10.0, 0.0, 1.0, 0.0])  # pushed along x at its top
    tilt = 0.25 * (1.0 + 1.0)  # moment of the push, and of the friction under it, over four arms
    even = np.array([2.5 + tilt] * 2 + [2.5 - tilt] * 2)
    for uneven in (0.7, 2.0):  # with 2.0, one corner has no force at all
        W, la = evened(0.5, load, braced(cube(0.5)[0], load, even + uneven * np.array([1.0, -1.0, -1.0, 1.0])))
        assert la[:4] == pytest.approx(even, abs=1e-12)
        assert la[4:] == pytest.approx(np.column_stack((-0.1 * even, np.zeros(4))).ravel(), abs=1e-12)
        assert W.T @ la == pytest.approx(-load, abs=1e-12)


def test_forces_that_the_laws_do_not_allow_to_be_even_stay_on_the_corners_that_have_them():
    """A load outside of what four even corners can carry: the corner across has nothing, and no negative force."""
    load = np.array([0.0, 0.0, -10.0, -6.0, 6.0, 0.0])
    la = np.concatenate(([6.0, 2.0, 2.0, 0.0], np.zeros(8)))
    W, found = evened(0.5, load, la)
    assert W.T @ la == pytest.approx(-load, abs=1e-12)
    assert found == pytest.approx(la, abs=1e-12)


@pytest.mark.parametrize("dt, n", [(1e-3, 30), (1e-2, 12)])
def test_box_that_slides_on_a_box_leaves_it_where_it_is(dt, n):
    """The friction above tilts the lower one: 1/16 of the load on each corner behind, 7/16 on each before."""
    scene = nga.Scene()
    scene.add_plane("ground")
    for name in ("lower", "upper"):
        scene.add_body(name, coal.Box(0.2, 0.2, 0.2), mass=1.0)
    scene.add_contact("lower", "ground", mu=0.5)
    scene.add_contact("upper", "lower", mu=0.5)
    q0 = np.array([0, 0, 0.1, 0, 0, 0, 1, 0, 0, 0.3, 0, 0, 0, 1.0])
    run = nga.simulate(scene, q0, np.r_[np.zeros(6), 0.5, np.zeros(5)], t_end=n * dt, dt=dt)
    weight = 2 * 9.81
    on_ground = [i for i, name in enumerate(run.contact_names) if name.endswith("ground") and run.la_N[0, i] > 0.0]
    assert sorted(run.la_N[0, on_ground]) == pytest.approx([weight / 16] * 2 + [weight * 7 / 16] * 2, rel=1e-9)
    assert run.audit().ok
    assert abs(run.q[:, :2]).max() < 5e-3 * dt**2 and abs(run.q[:, 3:6]).max() < 1e-10
    t = min(run.t[-1], 0.5 / (0.5 * 9.81))
    assert run.q[-1, 7] == pytest.approx(0.5 * t - 0.25 * 9.81 * t**2, abs=1e-9)
    assert np.isin(run.solver_path[1:], ("fixed-point", "halved")).sum() <= 1
