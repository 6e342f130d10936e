"""Contacts (148)-(157) and constraints (153) of the oracle: printed formulas, differences over time, directions."""

import numpy as np
import pytest

from ngalpha_pin import oracle, robots
from ngalpha_pin.oracle.kinematics import Motion

SYSTEMS = ("rotating_ball", "ball_in_corner", "ball_in_cylinder", "painleve_rod", "hopper", "tippe_top")
STEP = 1e-4
"""Of the differences over time [s]: errors of 1e-8 of the third derivative, and of 1e-8 of rounding."""


def random_motion(name, seed):
    scene, q0, _ = robots.load(name)
    p, rng = oracle.problem_of(scene), np.random.default_rng(seed)
    q = p.moved(q0, 0.02 * rng.normal(size=p.nv))
    v, a = 0.1 * rng.normal(size=(2, p.nv))
    return p, q, v, a


def along(p, q, v, a, t):
    """The motion with the velocity v and the acceleration a at q, a moment later."""
    return Motion(p, 0.3 + t, p.moved(q, t * v + t * t / 2 * a), v + t * a, a)


def levels(motion):
    """Positions, velocities and accelerations of all rows."""
    c, g = motion.contacts, motion.constraints
    return (
        np.hstack([*(k.g_N for k in c), g.g]),
        np.hstack([*(k.g_N_dot for k in c), g.g_dot]),
        np.hstack([*(k.g_N_ddot for k in c), g.g_ddot]),
        np.hstack([k.gamma_F for k in c]),
        np.hstack([k.gamma_F_dot for k in c]),
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", SYSTEMS)
def test_rates_are_those_of_differences(name, seed):
    p, q, v, a = random_motion(name, seed)
    minus, now, plus = (levels(along(p, q, v, a, t)) for t in (-STEP, 0.0, STEP))
    assert np.allclose((plus[0] - minus[0]) / (2 * STEP), now[1], rtol=1e-6, atol=1e-6)
    assert np.allclose((plus[1] - minus[1]) / (2 * STEP), now[2], rtol=1e-5, atol=1e-5)
    assert np.allclose((plus[3] - minus[3]) / (2 * STEP), now[4], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("name", SYSTEMS)
def test_directions_are_the_derivatives_by_the_velocities(name):
    p, q, v, a = random_motion(name, 4)
    motion, still = Motion(p, 0.3, q, v, a), Motion(p, 0.3, q, 0 * v, a)
    for c, rest in zip(motion.contacts, still.contacts, strict=True):
        assert c.g_N_dot - rest.g_N_dot == pytest.approx(c.W_N @ v, abs=1e-13)
        assert np.allclose(c.gamma_F - rest.gamma_F, c.W_F.T @ v, rtol=0.0, atol=1e-13)
    g, rest = motion.constraints, still.constraints
    assert np.allclose(g.g_dot - rest.g_dot, g.W_g.T @ v, rtol=0.0, atol=1e-13)


def test_balls_are_those_that_the_paper_prints():
    R, angle = 0.1, np.pi / 4
    for name in ("rotating_ball", "ball_in_corner", "ball_in_cylinder"):
        p, q, v, a = random_motion(name, 5)
        (x, y), (u_x, u_y, u_phi) = q[:2], v
        found = [(c.g_N, c.gamma_F[0]) for c in Motion(p, 0.0, q, v, a).contacts]
        s, c = np.sin(angle), np.cos(angle)
        from_axis = np.array([x, y - 1.0])
        n = -from_axis / np.linalg.norm(from_axis)
        wanted = {
            "rotating_ball": [(y - R, u_x + R * u_phi)],  # (148)
            "ball_in_corner": [  # (149)
                (-x * s + y * c - R, u_x * c + u_y * s + R * u_phi),
                (x * s + y * c - R, u_x * c - u_y * s + R * u_phi),
            ],
            # (150), (151); the tangent of the oracle points the other way
            "ball_in_cylinder": [(1.0 - R - np.linalg.norm(from_axis), -(u_x * n[1] - u_y * n[0] + R * u_phi))],
        }[name]
        assert np.allclose(found, wanted, rtol=0.0, atol=1e-13), name


def test_rod_is_the_one_that_the_paper_prints():
    p, q, v, a = random_motion("painleve_rod", 6)
    (c,), phi = Motion(p, 0.0, q, v, a).contacts, np.arctan2(q[3], q[2])
    assert c.g_N == pytest.approx(q[1] - np.sin(phi), abs=1e-13)  # (152)
    assert c.gamma_F[0] == pytest.approx(v[0] - v[2] * np.sin(phi), abs=1e-13)


def test_tippe_top_is_the_one_that_the_paper_prints():
    p, q, v, a = random_motion("tippe_top", 7)
    x, y, z, w = q[3:]
    e_z = np.array([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)])  # axis of the top
    e_x = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
    Omega = np.stack((e_x, np.cross(e_z, e_x), e_z), axis=1) @ v[3:]
    up = np.array([0.0, 0.0, 1.0])
    for c, arm, radius in zip(Motion(p, 0.0, q, v, a).contacts, (3e-3, 1.6e-2), (1.5e-2, 5e-3), strict=True):
        assert c.g_N == pytest.approx(q[2] + arm * e_z[2] - radius, abs=1e-15)  # (156)
        v_P = v[:3] + np.cross(Omega, arm * e_z) - radius * np.cross(Omega, up)
        assert np.allclose(c.gamma_F, [v_P[0], v_P[1], 3 * np.pi * 5e-4 / 16 * Omega[2]], rtol=0.0, atol=1e-14)  # (157)


def test_only_rows_that_can_move_are_kept():
    rows = {name: oracle.problem_of(robots.load(name)[0]) for name in SYSTEMS}
    assert [c.rows for c in rows["tippe_top"].contacts] == [(0, 1, 2), (0, 1, 2)]
    assert all(c.rows == (0,) for name in SYSTEMS[:5] for c in rows[name].contacts)
    assert len(rows["hopper"].rows) == 4  # the angle of the hip, two of the knee, and its angle (153)
