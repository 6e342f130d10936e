"""Limits, dry friction, damping, armature and effort of joints against closed forms; each can be left out."""

import numpy as np
import pinocchio as pin
import pytest
from joint_scenes import NO, slider
from scipy.linalg import expm
from scipy.optimize import brentq

import ngalpha_pin as nga
from ngalpha_pin.contact.limit_rows import LimitedRows
from ngalpha_pin.contact.point_rows import Rows
from ngalpha_pin.system.system import System

G = 9.81


def run(scene, q=0.0, v=0.0, t_end=1.0, dt=1e-2, **method):
    return nga.simulate(scene, np.array([q]), np.array([v]), t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(**method))


def bounces(t, height, e):
    """A mass dropped on a stop: its height, its velocity and the time from which it rests."""
    q, v = np.zeros_like(t), np.zeros_like(t)
    start, end, q0, v0 = 0.0, np.sqrt(2 * height / G), height, 0.0
    while end - start > 1e-12:
        here = (t >= start) & (t < end)
        s = t[here] - start
        q[here], v[here] = q0 + v0 * s - G * s * s / 2, v0 - G * s
        v0 = e * (G * (end - start) - v0)
        start, end, q0 = end, end + 2 * v0 / G, 0.0
    return q, v, end


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_joint_stop_bounces_and_comes_to_rest(side):
    """The bounces accumulate at sqrt(2 h / g) (1 + e) / (1 - e)."""
    h, e, errors = 1.0, 0.5, []
    rest = np.sqrt(2 * h / G) * (1 + e) / (1 - e)
    for dt in (4e-3, 1e-3):
        scene = slider(limits=(0.3, NO) if side > 0 else (-NO, -0.3), gravity=-side * G)
        scene.joints = nga.JointLaws(e_N={"slide": e})
        found = run(scene, side * (0.3 + h), t_end=2.0, dt=dt, rho_inf=0.9)
        q, _, end = bounces(found.t, h, e)
        assert end == pytest.approx(rest)
        errors.append(np.abs(side * found.q[:, 0] - 0.3 - q).max())
        assert found.contact_names == (f"slide {'lower' if side > 0 else 'upper'} limit",)
        assert found.t[np.abs(found.v[:, 0]) > 1e-3][-1] == pytest.approx(rest, abs=2 * dt)
        assert found.la_N[-1, 0] == pytest.approx(G)
        # what gravity gave, the stop took
        assert found.P_N.sum() == pytest.approx(2.0 * G, rel=1e-9)
        assert found.audit().ok
        assert found.audit().penetration < 1e-12
    # between and at the bounces, all of them inside of steps, exact
    assert max(errors) < 1e-12


def test_first_bounce_returns_with_e():
    scene = slider(limits=(0.0, NO))
    scene.joints = nga.JointLaws(e_N=0.5)
    found = run(scene, 0.105, -2.0, t_end=0.2)
    assert found.v[-1, 0] == pytest.approx(1.0, abs=1e-12)
    assert [event.kind for event in found.events][:1] == ["impact"]


def test_dry_friction_stops_the_joint_at_the_closed_form_time():
    errors = []
    for dt in (2e-2, 1e-2):
        found = run(slider(mass=2.0, friction=3.0), v=1.0, dt=dt)
        stop = 2.0 / 3.0
        s = np.minimum(found.t, stop)
        errors.append(np.abs(found.q[:, 0] - (s - 0.75 * s**2)).max())
        assert np.allclose(found.tau_f[found.t < stop - dt], -3.0)
        assert np.abs(found.v[found.t > stop + dt]).max() < 1e-15
        assert np.abs(found.tau_f[found.t > stop + 2 * dt]).max() < 1e-12
        assert found.P_f.sum() == pytest.approx(-2.0)
    assert errors[1] < 3e-5
    assert errors[1] < errors[0] / 3


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_dry_friction_sticks_below_and_slides_above_its_bound(sign):
    def pushed(force):
        scene = slider(friction=2.0)
        scene.add_force(nga.Control(lambda t, q, v: np.array([sign * force])))
        return run(scene)

    below, above = pushed(0.99 * 2.0), pushed(1.01 * 2.0)
    assert not below.v.any()
    assert not below.q.any()
    assert below.tau_f == pytest.approx(np.full((101, 1), -sign * 1.98))
    assert above.q[-1, 0] == pytest.approx(sign * 0.01, rel=1e-12)
    assert above.tau_f == pytest.approx(np.full((101, 1), -sign * 2.0))
    assert above.friction_names == ("slide",)


def test_dry_friction_with_different_bounds():
    scene = slider()
    scene.model.lowerDryFrictionLimit, scene.model.upperDryFrictionLimit = np.array([-1.0]), np.array([3.0])
    # forwards it is braked by 1 N, backwards by 3 N
    assert run(scene, v=1.0, t_end=0.5).v[-1, 0] == pytest.approx(0.5)
    assert run(scene, v=-2.0, t_end=0.5).v[-1, 0] == pytest.approx(-0.5)


def test_damping_and_armature():
    """V exp(-d t / (m + armature)), to second order."""
    errors = []
    for dt in (2e-2, 1e-2):
        found = run(slider(mass=1.0, damping=3.0, armature=0.5), v=1.0, dt=dt)
        errors.append(np.abs(found.v[:, 0] - np.exp(-2.0 * found.t)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def servo(t, x, U, kp, kd):
    """Unit mass at x under the force -kp x - kd v within +-U: arcs of a parabola and of the linear oscillator."""
    y, start, out = np.array([x, 0.0]), 0.0, np.zeros((len(t), 2))
    A = np.array([[0.0, 1.0], [-kp, -kd]])

    def flow(y, u, s):
        if u is None:
            return expm(A * s) @ y
        return np.array([y[0] + y[1] * s + u * s * s / 2, y[1] + u * s])

    def wish(y):
        return -kp * y[0] - kd * y[1]

    mode = float(np.clip(wish(y), -U, U)) if abs(wish(y)) > U else None
    while start < t[-1]:

        def leaves(s, y=y, mode=mode):
            w = wish(flow(y, mode, s))
            return (U - abs(w)) if mode is None else U - np.sign(mode) * w

        grid = np.linspace(0.0, t[-1] - start + 1e-9, 400)[1:]
        signs = np.array([leaves(s) for s in grid]) * (1.0 if mode is None else -1.0)
        past = np.flatnonzero(signs < -1e-9)
        length = grid[-1]
        if len(past):
            low = grid[past[0] - 1] if past[0] else 1e-9
            length = brentq(leaves, low, grid[past[0]], xtol=1e-14)
        here = (t >= start) & (t <= start + length)
        out[here] = [flow(y, mode, s) for s in t[here] - start]
        y, start = flow(y, mode, length), start + length
        mode = None if mode is not None else float(np.copysign(U, wish(y)))
    return out


def test_position_law_with_effort_limit_is_bang_bang():
    """It pulls with all it has, brakes with all it has, then settles: parabolas to round-off, the rest to order 2."""
    U, kp, kd, errors = 5.0, 100.0, 25.0, []
    for dt in (4e-3, 2e-3):
        scene = slider(effort=U)
        scene.add_force(nga.JointPD(np.array([1.0]), kp, kd))
        found = run(scene, t_end=1.6, dt=dt, rho_inf=0.9)
        expected = servo(found.t, -1.0, U, kp, kd)
        errors.append(np.abs(found.q[:, 0] - 1.0 - expected[:, 0]).max())
        full = found.t < 0.4
        assert np.abs(found.q[full, 0] - U / 2 * found.t[full] ** 2).max() < 1e-12
        a = np.gradient(expected[:, 1], found.t)
        assert a.min() == pytest.approx(-U, rel=1e-3)  # it does brake with all it has
    assert errors[1] < 3e-5
    assert errors[1] < errors[0] / 2.5


def test_effort_limit_holds_for_controls_alone():
    scene = slider(effort=5.0, gravity=-G)
    scene.add_force(nga.Control(lambda t, q, v: np.array([-100.0])))
    assert run(scene).v[-1, 0] == pytest.approx(-G - 5.0)
    scene = slider(effort=5.0)
    scene.add_force(nga.JointSpring("slide", 0.0, rest=1.0))
    scene.add_force(nga.Wrench("slide", (100.0, 0.0, 0.0)))  # not of the motor
    assert run(scene).v[-1, 0] == pytest.approx(100.0)


def test_effort_limit_of_the_torque_of_a_step():
    simulator = nga.Simulator(slider(effort=5.0), 1e-2)
    state = simulator.step(simulator.initial_state(np.zeros(1)), tau=np.array([50.0]))
    state = simulator.step(state, tau=np.array([50.0]))
    assert state.a[0] == pytest.approx(5.0)


def braked(**kinds):
    return slider(limits=(-0.2, 0.2), friction=1.0, damping=2.0, armature=3.0, effort=4.0, **kinds)


@pytest.mark.parametrize("left_out", ["limits", "friction", "damping", "armature", "effort"])
def test_each_property_can_be_left_out(left_out):
    """The motion is that of the model without the property."""
    scene = braked()
    scene.joints = nga.JointLaws(**{left_out: False})
    given = {"limits": (-0.2, 0.2), "friction": 1.0, "damping": 2.0, "armature": 3.0, "effort": 4.0}
    del given[left_out]
    without = slider(**given)
    runs = []
    for s in (scene, without, braked()):
        s.add_force(nga.Control(lambda t, q, v: np.array([5.0])))
        runs.append(run(s, v=0.5, t_end=0.6))
    assert (runs[0].q == runs[1].q).all()
    assert np.abs(runs[0].q - runs[2].q).max() > 1e-3


@pytest.mark.parametrize("limits", [(-NO, NO), (-np.inf, np.inf), (0.0, 0.0), (1.0, -1.0)])
def test_infinite_and_empty_limits_cost_nothing(limits, count):
    scene = slider(limits=limits, gravity=1.0)
    assert System(scene).contacts.n == 0
    calls = [count(LimitedRows, "__init__"), count(Rows, "__init__"), count(pin, "forwardKinematics")]
    assert run(scene, q=0.5).q[-1, 0] == pytest.approx(1.0)
    assert [len(c) for c in calls] == [0, 0, 0]


def test_one_finite_limit_is_one_row():
    assert System(slider(limits=(-1.0, NO))).contacts.names == ("slide lower limit",)
    assert System(slider(limits=(-1.0, 2.0))).contacts.n == 2


def test_continuous_joint_has_no_limit():
    """It turns on and on."""
    scene = slider(joint=pin.JointModelRUBX())
    assert System(scene).contacts.n == 0
    found = nga.simulate(scene, np.array([1.0, 0.0]), np.array([10.0]), t_end=1.0, dt=1e-2)
    assert found.q[-1] == pytest.approx([np.cos(10.0), np.sin(10.0)])


def test_restitution_is_checked():
    for e_N, message in (({"elbow": 0.5}, "no joint named 'elbow'"), (1.5, "expected a finite"), (np.nan, "expected")):
        scene = slider(limits=(0.0, 1.0))
        with pytest.raises(nga.SceneError, match=message):
            scene.joints = nga.JointLaws(e_N=e_N)
            run(scene)


def test_start_beyond_a_limit_names_the_joint():
    with pytest.raises(nga.Penetration, match="slide upper limit by 0.5"):
        run(slider(limits=(0.0, 1.0)), q=1.5)
