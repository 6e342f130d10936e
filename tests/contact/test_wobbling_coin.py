"""A coin that wobbles on its rim with rolling resistance, against its own equations of motion, to its rest."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import ngalpha_pin as nga

G, R, HALF, ARM = 9.81, 0.1, 5e-3, 2e-2  # gravity, radius, half of the thickness, arm of the rolling resistance
INERTIA = np.diag([(3 * R**2 + 4 * HALF**2) / 12] * 2 + [R**2 / 2])  # for a kilogram
UP = np.array([0.0, 0.0, 1.0])


def rotation_of(q):
    return pin.Quaternion(q / np.linalg.norm(q)).matrix()


def lowest(axis):
    """From the centre to the point that touches."""
    across = UP - axis[2] * axis
    return -HALF * axis - R * across / np.linalg.norm(across)


def rate(t, y):
    """Of place, quaternion and angular velocity in the world: rolling without slip, F = g + d/dt (r x omega), and a
    moment ARM N against the part of omega that is level."""
    rotation, omega = rotation_of(y[3:7]), y[7:]
    axis, J = rotation[:, 2], rotation @ INERTIA @ rotation.T
    r, turned = lowest(axis), np.cross(omega, axis)
    r_rate = (lowest(axis + 1e-6 * turned) - lowest(axis - 1e-6 * turned)) / 2e-6
    level = np.array([omega[0], omega[1], 0.0]) / np.hypot(*omega[:2])
    force, by_turn = G * UP + np.cross(r_rate, omega), pin.skew(r)  # F = force + r x omega_dot
    left = J - by_turn @ by_turn + ARM * np.outer(level, by_turn[2])
    right = -np.cross(omega, J @ omega) + np.cross(r, force) - ARM * force[2] * level
    v, w = y[3:6], y[6]
    q_rate = 0.5 * np.append(w * omega + np.cross(omega, v), -omega @ v)
    return np.concatenate((np.cross(r, omega), q_rate, np.linalg.solve(left, right)))


def coin(tilt):
    """Scene, start, velocity, and the start of the equations; it turns about the diameter through the ground."""
    rotation = pin.utils.rotate("y", tilt)
    r = lowest(rotation[:, 2])
    omega = -np.sqrt(4 * G * np.sin(tilt) / R) * r / np.linalg.norm(r)
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("coin", coal.Cylinder(R, 2 * HALF), mass=1.0)
    scene.add_contact("coin", "ground", mu=2.0, rolling_resistance=ARM)
    q0 = np.array([0.0, 0.0, -r[2], *pin.Quaternion(rotation).coeffs()])
    v0 = np.concatenate((rotation.T @ np.cross(r, omega), rotation.T @ omega))
    return scene, q0, v0, np.concatenate((q0, omega))


def test_coin_wobbles():
    """Its point of contact runs around the rim twice as fast as the coin turns; of order two, and to what rtol asks."""
    scene, q0, v0, start = coin(0.3)
    right = solve_ivp(rate, (0.0, 0.05), start, rtol=1e-11, atol=1e-13).y[:7, -1]
    errors = []
    for accuracy in ({"dt": 2e-3}, {"dt": 1e-3}, {"rtol": 1e-4}, {"rtol": 1e-6}):
        run = nga.simulate(scene, q0, v0, t_end=0.05, **accuracy)
        place = np.abs(run.q[-1, :3] - right[:3]).max()
        turned = np.linalg.norm(pin.log3(rotation_of(right[3:]).T @ rotation_of(run.q[-1, 3:])))
        errors.append((place, turned))
        assert run.audit().ok, str(run.audit())
        assert max(place, turned) < 10 * accuracy.get("rtol", 1.0)
    assert (np.log2(np.divide(errors[0], errors[1])) > 1.9).all()
    assert errors[1][0] < 1e-6


@pytest.mark.long
def test_wobbling_coin_comes_to_rest():
    """In finite time, flat and without creep.

    Towards the end its point runs around the rim in a few steps: the rest comes some steps early.
    """
    dt, flat = 1e-3, 1e-4

    def is_flat(t, y):
        return np.hypot(*rotation_of(y[3:7])[:2, 2]) - flat

    is_flat.terminal = True
    scene, q0, v0, start = coin(2e-3)
    until = solve_ivp(rate, (0.0, 1.0), start, rtol=1e-9, atol=1e-11, events=is_flat).t[-1]
    run = nga.simulate(scene, q0, v0, t_end=0.03, dt=dt)
    rests = np.flatnonzero(np.abs(run.v).max(axis=1) < 1e-12)
    assert abs(run.t[rests[0]] - until) < 20 * dt
    assert len(rests) == len(run.t) - rests[0] > 5
    assert np.ptp(run.q[rests[2:]], axis=0).max() < 1e-13  # steps remember the last impact
    assert run.q[-1, 2] == pytest.approx(HALF, abs=1e-14)
    assert np.abs(rotation_of(run.q[-1, 3:])[:2, 2]).max() < 1e-14
    assert run.audit().penetration < 1e-10
    energy = run.energy.total
    assert np.diff(energy).max() < 1e-12
