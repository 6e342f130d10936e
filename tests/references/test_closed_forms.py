"""The reference motions themselves: published numbers, invariants, laws of contact."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import approx_fprime

from ngalpha_pin import references
from ngalpha_pin.references import spinning_body
from ngalpha_pin.references.walled_ball import sample

BALL = np.array([1.0, 1.0, 0.4 * 0.1**2])


def ball_energy(q, v):
    return v**2 @ BALL / 2 + 9.81 * q[:, 1]


def never_grows(energy):
    return np.diff(energy).max() < 1e-11 * np.ptp(energy)


@pytest.mark.parametrize(("omega", "La_F", "la_F"), [(50.0, -0.84042846, -1.962), (10.0, -2 / 7, 0.0), (-10, 2 / 7, 0)])
def test_rotating_ball_has_the_printed_forces(omega, La_F, la_F):
    impact = references.rotating_ball_arcs(omega=omega)[1]
    assert impact.La_N == pytest.approx(np.sqrt(2 * 9.81 * 0.9), rel=1e-14)
    assert impact.La_F == pytest.approx(La_F, rel=1e-8)
    assert impact.la_N == pytest.approx(9.81)
    assert impact.la_F == pytest.approx(la_F, abs=1e-14)


def test_rotating_ball_rolls_in_the_end():
    t = np.linspace(0, 3, 3001)
    q, v = references.rotating_ball(t)
    rolling = t > 0.72811999417504
    assert np.abs(v[rolling, 0] + 0.1 * v[rolling, 2]).max() < 1e-14
    assert (v[~rolling, 0] + 0.1 * v[~rolling, 2]).min() > 0
    # the angular momentum about a point of the ground does not change: -R m u_x + theta u_phi = theta omega
    assert v[-1, 0] == pytest.approx(-2 / 7 * 0.1 * 50, rel=1e-13)
    assert q[:, 1].min() == pytest.approx(0.1, abs=1e-15)


def test_bounces_accumulate():
    t_1 = np.sqrt(2 * 0.9 / 9.81)
    arcs = references.rotating_ball_arcs(omega=0.0, e_N=0.5)
    assert [arc.t for arc in arcs[1:8]] == pytest.approx([t_1 * (3 - 2 * 0.5**k) for k in range(7)], rel=1e-13)
    assert arcs[-1].t == pytest.approx(3 * t_1, rel=1e-9)
    q, v = sample(arcs, np.array([3 * t_1 + 0.1]))
    assert q[0, 1] == pytest.approx(0.1, abs=1e-14)
    assert np.abs(v).max() < 1e-14


@pytest.mark.parametrize("omega", [50.0, 10.0, 0.0])
@pytest.mark.parametrize("e_N", [0.0, 0.5, 0.8])
def test_rotating_ball_only_loses_energy(omega, e_N):
    q, v = references.rotating_ball(np.linspace(0, 5, 2001), omega=omega, e_N=e_N)
    assert never_grows(ball_energy(q, v))
    assert q[:, 1].min() > 0.1 - 1e-14


def test_ball_in_corner_comes_to_rest_as_printed():
    arcs = references.ball_in_corner_arcs()
    assert arcs[-1].t == pytest.approx(1.3608451678, abs=1e-8)
    t = np.linspace(0, 2, 4001)
    q, v = references.ball_in_corner(t)
    assert never_grows(ball_energy(q, v))
    assert np.abs(v[t > 1.361]).max() < 1e-9
    gaps = q[:, :2] @ np.array([[-1, 1], [1, 1]]) / np.sqrt(2) - 0.1
    assert gaps.min() > -1e-14
    assert gaps[-1] == pytest.approx([0, 0], abs=1e-12)


def test_ball_jams_in_a_steep_wedge():
    """The half-angle of 10 degrees is below the angle of friction: it falls, hits both walls at once and stays."""
    steep, t_1 = np.radians(80.0), np.sqrt(2 * (0.8 - 0.1 / np.cos(np.radians(80.0))) / 9.81)
    wedge = {"alpha": steep, "beta": steep, "mu": 0.5, "e_N_right": 0.0, "x": 0.0, "height": 0.8}
    falls, jams = references.ball_in_corner_arcs(1.0, **wedge)
    assert jams.t == pytest.approx(t_1, rel=1e-13)
    for size, (N, F) in ((9.81 * t_1, (jams.La_N, jams.La_F)), (9.81, (jams.la_N, jams.la_F))):
        assert N.sum() * np.cos(steep) + np.abs(F).sum() * np.sin(steep) == pytest.approx(size)
        assert (np.abs(F) <= 0.5 * N + 1e-13).all()
    _, v = references.ball_in_corner(np.array([0.1, 0.5]), **wedge)
    assert v[0] == pytest.approx([0.0, -0.981, 0.0])
    assert np.abs(v[1]).max() < 1e-13


def test_ball_in_corner_obeys_the_laws_of_contact():
    s = np.sqrt(0.5)
    W_N, W_F = np.array([[-s, s, 0], [s, s, 0]]), np.array([[s, s, 0.1], [s, -s, 0.1]])
    e_N, before = np.array([0.5, 0.0]), np.zeros(3)
    arcs = references.ball_in_corner_arcs()
    for arc, following in zip(arcs, [*arcs[1:], None], strict=True):
        assert np.abs(BALL * (arc.v - before) - arc.La_N @ W_N - arc.La_F @ W_F).max() < 1e-12
        for N, F in ((arc.La_N, arc.La_F), (arc.la_N, arc.la_F)):
            assert (N >= 0).all()
            assert (np.abs(F) <= 0.3 * N + 1e-13).all()
        xi = W_N @ arc.v + e_N * (W_N @ before)
        assert np.abs(arc.La_N * xi).max() < 1e-13
        before = arc.v + (following.t - arc.t) * arc.a if following else before


@pytest.mark.parametrize(("margin", "slides"), [(-0.01, False), (0.01, True)])
def test_block_slides_beyond_the_angle_of_friction(margin, slides):
    mu = 0.5
    s, _ = references.box_on_incline(np.array([1.0]), np.arctan(mu) + margin, mu, speed=0.0)
    assert (s[0, 0] > 0) == slides


def test_block_sent_uphill_comes_back_slower():
    angle, mu = 0.6, 0.2
    stop = 2.0 / (9.81 * (np.sin(angle) + mu * np.cos(angle)))
    back = 9.81 * (np.sin(angle) - mu * np.cos(angle))
    s, s_dot = references.box_on_incline(np.array([stop, stop + 0.5]), angle, mu, speed=-2.0)
    assert s[:, 0] == pytest.approx([-stop, -stop + back * 0.125])
    assert s_dot[:, 0] == pytest.approx([0, back / 2], abs=1e-14)
    s, s_dot = references.box_on_incline(np.array([0.1, 5.0]), 0.1, 0.3, speed=2.0)
    assert s_dot[1, 0] == 0 < s_dot[0, 0]


def test_pendulum_against_integration():
    t = np.linspace(0, 5, 101)
    angle, rate = references.pendulum(t, 2.5, 3.0)
    swing = solve_ivp(lambda _, y: [y[1], -9 * np.sin(y[0])], (0, 5), [2.5, 0], t_eval=t, rtol=1e-12, atol=1e-13)
    assert np.abs(angle[:, 0] - swing.y[0]).max() < 1e-9
    assert np.abs(rate[:, 0] - swing.y[1]).max() < 1e-9


def test_free_body_keeps_energy_and_angular_momentum():
    inertia, t = np.array([1.0, 2.0, 2.5]), np.linspace(0, 5, 51)
    q0 = np.array([1.0, 2.0, 3.0, 0.5, 0.5, 0.5, 0.5])
    q, v = references.free_body(t, q0, np.array([1.0, 0.0, 0.0, 0.1, 3.0, 0.1]), inertia)
    momentum = np.array([spinning_body.rotation(p) @ (inertia * w) for p, w in zip(q[:, 3:], v[:, 3:], strict=True)])
    assert np.ptp(momentum, axis=0).max() < 1e-10
    assert np.ptp(v[:, 3:] ** 2 @ inertia) < 1e-10
    assert np.ptp((v[:, :3] ** 2).sum(axis=1) / 2 + 9.81 * q[:, 2]) < 1e-11
    # the velocity is the rate of the position, seen from the body: it flips, so the frame matters
    assert np.gradient(q[:, 0], t)[1:-1] == pytest.approx(
        [(spinning_body.rotation(p) @ u[:3])[0] for p, u in zip(q[1:-1, 3:], v[1:-1], strict=True)], abs=1e-9
    )


def test_ball_in_cylinder_stays_on_the_wall_and_slips_and_sticks():
    t = np.linspace(0, 6, 3001)
    q, v = references.ball_in_cylinder(t)
    radius = np.hypot(q[:, 0], q[:, 1] - 1)
    assert np.abs(radius - 0.9).max() < 1e-14
    assert never_grows(ball_energy(q, v))
    starts, slips, _ = references.ball_in_cylinder_arcs(6.0)
    assert len(starts) == 11
    assert starts[1:3] == pytest.approx([0.75857, 0.76127], abs=1e-5)
    n = np.column_stack([-q[:, 0], 1 - q[:, 1]]) / 0.9
    slip = v[:, 0] * n[:, 1] - v[:, 1] * n[:, 0] + 0.1 * v[:, 2]
    sign = np.array(slips)[np.searchsorted(starts, t, side="right") - 1]
    assert (sign == 0).any()
    assert np.abs(slip[sign == 0]).max() < 1e-10
    assert (slip * sign).min() > -1e-10
    # la_N = m (speed^2 / radius + g cos of the inclination of the wall)
    assert ((v[1:, :2] ** 2).sum(axis=1) / 0.9 + 9.81 * n[1:, 1]).min() > 0


def test_painleve_rod_slides_on_its_tip_until_the_blow_up():
    t_c = references.painleve_slide().t[-1]
    assert t_c == pytest.approx(0.8145497, abs=1e-7)
    t = np.linspace(0, 0.81, 2001)
    q, v = references.painleve_rod(t)
    assert np.abs(q[:, 1] - q[:, 3]).max() < 1e-12
    assert np.abs(v[:, 1] - v[:, 2] * q[:, 2]).max() < 1e-11
    assert never_grows(v**2 @ [1, 1, 1 / 3] / 2 + 10 * q[:, 1])
    # the momentum in x changes by friction alone, that in z by the normal force and the weight
    push = v[:, 1] + 10 * t
    assert np.diff(push).min() > 0
    assert v[:, 0] - 30 == pytest.approx(-5 / 3 * push, abs=1e-10)
    assert (v[:, 0] - v[:, 2] * q[:, 3]).min() > 0
    assert np.isnan(references.painleve_rod(np.array([t_c]))[0]).all()


def tippe_top_energy(q, v):
    return v[:, :3] ** 2 @ np.full(3, 3e-3) + v[:, 3:] ** 2 @ spinning_body.INERTIA / 2 + 6e-3 * 9.81 * q[:, 2]


def test_tippe_top_stays_on_the_ground_and_turns_over():
    t = np.linspace(0, 1.37, 500)
    q, v = references.tippe_top(t)
    axis = np.array([spinning_body.rotation(p)[2] for p in q[:, 3:]])
    assert np.abs(q[1:, 2] + 3e-3 * axis[1:, 2] - 1.5e-2).max() < 1e-15
    assert never_grows(tippe_top_energy(q, v))
    # the velocity of the centre of the body has no vertical part
    turning = np.cross(v[:, 3:], [0, 0, 3e-3])
    assert np.abs(v[1:, 2] + (axis * turning).sum(axis=1)[1:]).max() < 1e-15
    theta = np.arccos(axis[:, 2])
    assert theta[0] == pytest.approx(0.1, abs=1e-14)
    assert theta[-1] > 2.4


@pytest.mark.long
def test_tippe_top_stands_on_its_stick_until_the_body_comes_down_again():
    t = np.linspace(1.3711, 4.55, 2000)
    q, v = references.tippe_top(t)
    axis = np.array([spinning_body.rotation(p)[2] for p in q[:, 3:]])
    assert np.abs(q[:, 2] + 1.6e-2 * axis[:, 2] - 5e-3).max() < 1e-15
    assert never_grows(tippe_top_energy(q, v))
    assert (q[:, 2] + 3e-3 * axis[:, 2] - 1.5e-2).min() > 0
    assert np.isnan(references.tippe_top(np.array([4.56]))[0]).all()
    # the impact of the stick: momentum and energy are lost to a percussion within the cone of friction
    slid, stands = spinning_body.slide()[1], spinning_body.stand(5.0)
    _, p, before = spinning_body.full_state(slid.y[:, -1])
    after = spinning_body.full_state(stands.y[:, 0], spinning_body.STICK)[2]
    contact = spinning_body.Contact(spinning_body.rotation(p), spinning_body.STICK)
    percussion = np.concatenate([np.full(3, 6e-3), spinning_body.INERTIA]) * (after - before)
    W = np.vstack((contact.W_N, contact.W_F)).T
    found = np.linalg.lstsq(W, percussion, rcond=None)[0]
    assert np.abs(W @ found - percussion).max() < 1e-12 * np.abs(percussion).max()
    assert found[0] > 0
    assert np.linalg.norm(found[1:]) == pytest.approx(0.3 * found[0], rel=1e-9)
    assert abs(contact.W_N @ after) < 1e-14


def test_tippe_top_without_drilling_keeps_the_constant_of_jellett(monkeypatch):
    monkeypatch.setattr(spinning_body, "DRILL", 0.0)
    t_1, slide = spinning_body.slide.__wrapped__(0.5)
    values = []
    for y in slide.y.T:
        _, p, u = spinning_body.full_state(y)
        arm = spinning_body.A_1 * spinning_body.UP - spinning_body.R_1 * spinning_body.rotation(p)[2]
        values.append(spinning_body.INERTIA * u[3:] @ arm)
    assert np.ptp(values) < 1e-9 * np.abs(values).max()


def test_directions_of_the_tippe_top_contact():
    """W_N is the gradient of the gap along a motion, W_F the velocity of the contact point."""
    p = np.array([0.1, -0.3, 0.2, 0.9])
    p /= np.linalg.norm(p)
    contact = spinning_body.Contact(spinning_body.rotation(p))

    def gap(omega):
        moved = p + spinning_body.spin(p, omega)
        return spinning_body.A_1 * spinning_body.rotation(moved / np.linalg.norm(moved))[2, 2]

    assert contact.W_N[3:] == pytest.approx(approx_fprime(np.zeros(3), gap, 1e-7), abs=1e-9)
    u = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    omega = contact.A @ u[3:]
    point = contact.A @ [0, 0, spinning_body.A_1] - [0, 0, spinning_body.R_1]
    velocity = u[:3] + np.cross(omega, point)
    assert contact.W_F @ u == pytest.approx([velocity[0], velocity[1], 3 * np.pi / 16 * 5e-4 * omega[2]], rel=1e-12)
