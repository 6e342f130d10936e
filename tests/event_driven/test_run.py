"""Runs of chosen accuracy: errors against references, events, their times, what is said when it cannot be met."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import ngalpha_pin as nga
from ngalpha_pin import references, robots
from ngalpha_pin.system.system import System

FALL = np.sqrt(2 * 0.9 / 9.81)


def position_error(name, run, **parameters):
    q, _ = getattr(references, name)(run.t, **parameters)
    return np.nanmax(np.abs(run.q - q)[:, :2])


def in_tolerances(run, q):
    """Largest error of a coordinate in units of what was asked for."""
    return float((np.abs(run.q - q) / (run.chosen.atol + run.chosen.rtol * np.abs(q))).max())


TOLERANCES = [
    pytest.param(rtol, marks=() if rtol in (1e-3, 1e-6, 1e-9) else pytest.mark.long)
    for rtol in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
]


@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize(
    ("name", "parameters", "t_end"),
    [
        ("rotating_ball", {"omega": 50.0}, 1.5),
        ("rotating_ball", {"omega": 10.0}, 1.5),
        ("rotating_ball", {"omega": 0.0, "e_N": 0.5}, 1.6),
        ("ball_in_corner", {}, 2.0),
        ("ball_in_cylinder", {}, 2.0),
        ("rolling_disc", {}, 2.0),
        pytest.param("tippe_top", {}, 4.5, marks=pytest.mark.long),
    ],
)
def test_error_is_within_the_tolerance(name, parameters, t_end, rtol):
    run = nga.simulate(*robots.load(name, **parameters), t_end=t_end, rtol=rtol)
    assert run.success
    assert in_tolerances(run, getattr(references, name)(run.t, **parameters)[0]) <= 10.0
    assert run.audit().ok, str(run.audit())
    if name != "tippe_top":  # it turns 130 times
        assert len(run.t) - 1 < (400 if rtol > 1e-8 else 1000)


def test_tippe_top_for_a_short_while():
    run = nga.simulate(*robots.load("tippe_top"), t_end=0.3, rtol=1e-8)
    q, _ = references.tippe_top(run.t)
    assert np.abs(run.q - q).max() < 1e-7
    assert run.audit().ok, str(run.audit())


@pytest.mark.parametrize(
    ("build", "reference"),
    [
        (lambda: robots.load("rocking_block"), lambda t: references.rocking_block(t)[0]),
        (lambda: robots.load("cradle"), lambda t: references.cradle(t)[0]),
    ],
)
@pytest.mark.parametrize("rtol", TOLERANCES)
def test_impacts_that_throw_other_contacts_open(build, reference, rtol):
    run = nga.simulate(*build(), t_end=2.0, rtol=rtol)
    assert in_tolerances(run, reference(run.t)) <= 10.0
    assert len(run.impacts.t) >= 3
    assert run.audit().ok, str(run.audit())
    assert len(run.t) < 60


def test_arm_costs_what_the_integrator_costs():
    scene, q0, _ = robots.load("arm")
    system, n = System(scene), scene.model.nv
    run = nga.simulate(scene, q0, t_end=1.0, rtol=1e-9)

    def rate(t, y):
        dynamics = system.dynamics(t, y[:n], y[n:], np.zeros(n))
        return np.concatenate((y[n:], -np.linalg.solve(dynamics.M, dynamics.residual)))

    y0 = np.concatenate((q0, np.zeros(n)))
    alone = solve_ivp(rate, (0, 1), y0, method="DOP853", rtol=1e-9, atol=1e-9)
    exact = solve_ivp(rate, (0, 1), y0, method="DOP853", rtol=1e-13, atol=1e-14)
    assert run.chosen.n_evaluations <= 3 * alone.nfev
    assert np.abs(run.q[-1] - exact.y[:n, -1]).max() < 1e-8


def dropped_box(e_N):
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "box")
    model.appendBodyToJoint(j, pin.Inertia.FromBox(1.0, 0.2, 0.3, 0.1), pin.SE3.Identity())
    model.addJointFrame(j)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("b", coal.Box(0.2, 0.3, 0.1), parent="box")
    scene.add_contact("b", "ground", mu=0.5, e_N=e_N)
    q0 = pin.neutral(model)
    q0[2], q0[3:] = 0.3, pin.Quaternion(pin.rpy.rpyToMatrix(0.05, 0.1, 0.2)).coeffs()
    return scene, q0


@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
@pytest.mark.parametrize("e_N", [0.0, 0.5])
def test_box_chatters_to_rest(e_N, rtol):
    run = nga.simulate(*dropped_box(e_N), t_end=2.0, rtol=rtol)
    assert run.success
    assert len(run.t) - 1 <= 400
    assert np.abs(run.v[-1]).max() < 1e-9
    assert run.q[-1, 2] == pytest.approx(0.05, abs=1e-9)
    assert run.audit().penetration < 1e-12


@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
def test_hundreds_of_bounces_take_a_bounded_number_of_steps(rtol):
    run = nga.simulate(*robots.load("rotating_ball", e_N=0.9), t_end=10.0, rtol=rtol)
    impacts = [event for event in run.events if event.kind == "impact"]
    assert len(impacts) > 30
    assert len(run.t) - 1 <= 3 * len(impacts) + 60
    assert np.abs(run.v[-1, 1]) < 1e-12
    assert run.q[-1, 1] == pytest.approx(0.1, abs=1e-12)


def test_bounces_and_their_times_are_events():
    run = nga.simulate(*robots.load("rotating_ball", omega=0.0, e_N=0.5), t_end=1.6, rtol=1e-9)
    impacts = [event.t for event in run.events if event.kind == "impact"]
    assert impacts[:6] == pytest.approx(FALL * (3 - 2 * 0.5 ** np.arange(6)), abs=1e-8)
    # the last one is none: a bounce lower than the tolerance
    assert run.events[-1].kind == "closed"
    assert run.events[-1].t == pytest.approx(3 * FALL, abs=1e-4)


def test_stick_and_slip_are_located():
    run = nga.simulate(*robots.load("ball_in_cylinder"), t_end=1.0, rtol=1e-8)
    starts, _, _ = references.ball_in_cylinder_arcs(2.0)
    assert [event.kind for event in run.events] == ["stick", "slip"]
    assert [event.t for event in run.events] == pytest.approx(starts[1:3], abs=1e-7)


def test_lift_off_is_located():
    """A ball on a hollow cylinder's floor that turns up and leaves it; here: a ball rolls off the top of a sphere."""
    model = pin.Model()
    j = 0
    for kind, name in ((pin.JointModelPX(), "x"), (pin.JointModelPZ(), "z")):
        j = model.addJoint(j, kind, pin.SE3.Identity(), name)
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3) * 1e-3), pin.SE3.Identity())
    model.addJointFrame(j)
    scene = nga.Scene(model)
    scene.add_geometry("dome", coal.Sphere(0.9))
    scene.add_geometry("ball", coal.Sphere(0.1), parent="z")
    scene.add_contact("ball", "dome")
    start = 0.3  # angle from the top; a bead without friction leaves where cos = 2/3 cos(start)
    run = nga.simulate(scene, np.array([np.sin(start), np.cos(start)]), t_end=1.0, rtol=1e-9)
    event = run.events[0]
    assert event.kind == "lift-off"
    i = np.searchsorted(run.t, event.t)
    assert run.t[i] == event.t
    assert run.q[i, 1] == pytest.approx(2 / 3 * np.cos(start), abs=1e-8)
    assert np.hypot(*run.q[i]) == pytest.approx(1.0, abs=1e-12)


def test_wanted_times_and_percussions_between_them():
    times = np.linspace(0.1, 1.6, 16)
    run = nga.simulate(*robots.load("rotating_ball", omega=0.0, e_N=0.5), t_end=1.6, rtol=1e-8, t_eval=times)
    assert run.t == pytest.approx(np.concatenate(([0.0], times)), abs=0)
    assert position_error("rotating_ball", run, omega=0.0, e_N=0.5) < 1e-7
    # momentum: all percussions together carry the weight
    assert np.cumsum(run.P_N[:, 0]) == pytest.approx(run.v[:, 1] + 9.81 * run.t, abs=1e-8)
    assert run.P_N[-1, 0] == pytest.approx(0.981, abs=1e-8)
    assert run.audit().ok, str(run.audit())


def test_users_events_end_the_run_at_their_time():
    def turning_point(t, q, v):
        return v[1]

    def low(t, q, v):
        return q[1] - 0.3

    turning_point.terminal, turning_point.direction = 2, -1
    scene, q0, v0 = robots.load("rotating_ball", omega=0.0, e_N=0.5)
    run = nga.simulate(
        scene, q0, np.array([0.0, 1e-3, 0.0]), t_end=3.0, rtol=1e-9, max_step=0.05, events=[turning_point, low]
    )
    assert run.message == "stopped by an event"
    tops, lows = run.chosen.t_events
    assert len(tops) == 2
    assert run.t[-1] == tops[1]
    assert np.abs(run.chosen.v_events[0][:, 1]).max() < 1e-8
    assert run.chosen.q_events[1][:, 1] == pytest.approx(np.full(len(lows), 0.3), abs=1e-8)
    assert len(lows) == 2  # down, and up after the impact


def test_event_that_an_impact_jumps_over():
    def turns(t, q, v):
        return v[1]

    turns.terminal = True
    run = nga.simulate(*robots.load("rotating_ball", omega=0.0, e_N=0.5), t_end=1.0, rtol=1e-9, events=turns)
    assert run.t[-1] == pytest.approx(FALL, abs=1e-9)


def test_longest_step_and_what_was_rejected_are_kept(tmp_path):
    run = nga.simulate(*robots.load("ball_in_corner"), t_end=1.0, rtol=1e-6, max_step=0.02)
    assert np.diff(run.t).max() <= 0.02 + 1e-15
    assert run.chosen.rejected >= 0
    table = str(run.audit())
    assert "rejected steps" in table and "shortest" in table
    run.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    assert loaded.events == run.events
    assert loaded.chosen.rtol == 1e-6
    assert str(loaded.audit()) == table


def test_run_goes_on_from_its_final_state():
    scene, q0, v0 = robots.load("rotating_ball", omega=0.0, e_N=0.5)
    first = nga.simulate(scene, q0, v0, t_end=0.7, rtol=1e-9)
    second = nga.simulate(scene, state=first.final_state, t_end=1.6, rtol=1e-9)
    assert second.t[0] == first.t[-1]
    assert position_error("rotating_ball", second, omega=0.0, e_N=0.5) < 1e-8
    fixed = nga.simulate(scene, state=first.final_state, t_end=1.0, dt=1e-3)
    assert position_error("rotating_ball", fixed, omega=0.0, e_N=0.5) < 1e-8


def test_sliding_up_to_a_singular_normal_force():
    run = nga.simulate(*robots.load("painleve_rod"), t_end=0.8145, rtol=1e-8)
    q, _ = references.painleve_rod(run.t)
    assert run.success
    assert np.abs(run.q - q).max() < 1e-7


@pytest.fixture
def only_captured(monkeypatch):
    """No smooth phase is ever integrated."""
    monkeypatch.setattr("ngalpha_pin.event_driven.smooth_phase.SmoothPhase.agrees", lambda *_: False)


def test_steps_of_the_method_are_controlled(only_captured):
    run = nga.simulate(*robots.load("ball_in_corner"), t_end=1.0, rtol=1e-5)
    assert set(run.solver_path[1:]) == {"captured"}
    assert position_error("ball_in_corner", run) < 1e-4
    assert run.audit().ok, str(run.audit())
    steps = np.diff(run.t)
    assert steps.max() > 100 * steps.min()
    cylinder = nga.simulate(*robots.load("ball_in_cylinder"), t_end=0.7, rtol=1e-5)
    assert position_error("ball_in_cylinder", cylinder) < 1e-4


def test_accuracy_that_cannot_be_met_is_said(only_captured):
    run = nga.simulate(*robots.load("ball_in_cylinder"), t_end=0.5, rtol=1e-8, min_step=0.05)
    assert run.success
    t, names = run.chosen.unmet[0]
    assert names == ("ball_0/tube",)
    assert f"miss the tolerance, the first at t = {t:.6g} s with ball_0/tube in contact" in run.message
    assert not run.audit().ok
    assert "missed" in str(run.audit())


def test_step_that_does_not_converge_ends_the_run_and_says_where(only_captured, monkeypatch):
    step = nga.GeneralizedAlpha.step

    def fails_later(self, system, state, dt):
        result = step(self, system, state, dt)
        return replace(result, converged=state.t + dt < 0.2)

    monkeypatch.setattr(nga.GeneralizedAlpha, "step", fails_later)
    scene, q0, v0 = robots.load("ball_in_cylinder")
    run = nga.simulate(scene, q0, v0, t_end=0.5, rtol=1e-3, min_step=1e-3, on_failure="stop")
    assert not run.success
    assert run.t[-1] == pytest.approx(0.2, abs=1e-3)
    assert "did not converge with ball_0/tube in contact" in run.message
    with pytest.raises(nga.NotConverged) as caught:
        nga.simulate(scene, q0, v0, t_end=0.5, rtol=1e-3, min_step=1e-3)
    assert caught.value.trajectory.t[-1] == run.t[-1]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"rtol": 1e-3, "dt": 1e-3}, "either dt or rtol"),
        ({"rtol": -1.0}, "rtol = -1"),
        ({"rtol": 1e-3, "atol": 0.0}, "atol = 0"),
        ({"rtol": 1e-3, "atol": np.nan}, "atol = nan"),
        ({"rtol": 1e-3, "min_step": 1.0, "max_step": 0.1}, "min_step"),
        ({"rtol": 1e-3, "t_eval": [0.2, 0.1]}, "increasing"),
        ({"rtol": 1e-3, "t_eval": [0.1, 2.0]}, "outside"),
        ({"rtol": 1e-3, "events": [3]}, "a function of"),
        ({"dt": 1e-3, "t_eval": [0.1]}, "with rtol"),
        ({}, "give a step dt"),
    ],
)
def test_input_that_cannot_be_used_is_refused(options, said):
    scene, q0, v0 = robots.load("rotating_ball")
    with pytest.raises(nga.SceneError, match=said):
        nga.simulate(scene, q0, v0, t_end=1.0, **options)


# angles [rad] of the test set for initial value problems at 0.03 s: beta, Theta, gamma, delta, Phi, epsilon, Omega
ANDREWS_END = (
    0.1581077119629904e2, -0.1575637105984298e2, 0.4082224013073101e-1, 0.5244099658805304,
    -0.5347301163226948, 0.1048080741042263e1, 0.5347301163226948,
)  # fmt: skip


def test_andrews_mechanism():
    run = nga.simulate(*robots.load("andrews"), t_end=0.03, rtol=1e-8)
    assert np.abs(run.q[-1] - ANDREWS_END).max() <= 1e-7
    audit = run.audit()
    assert audit.ok, str(audit)
    assert audit.drift_g < 1e-14
    assert len(run.t) < 200


def test_slip_that_begins_on_the_edge_of_the_cone_is_against_the_force():
    """Its acceleration is rounding then; against its sign friction would drive the ball."""
    run = nga.simulate(*robots.load("ball_in_cylinder"), t_end=0.9, rtol=1e-10)
    assert in_tolerances(run, references.ball_in_cylinder(run.t)[0]) <= 10.0
    assert np.diff(run.energy.total).max() < 1e-12


def test_slip_that_stops_in_no_time():
    """The feet of ANYmal wedge while they slip, so that their forces grow without bound within microseconds."""
    scene, q0, v0 = robots.load("anymal")
    exact, *others = (nga.simulate(scene, q0, v0, t_end=0.3, rtol=rtol) for rtol in (1e-10, 1e-3, 1e-6))
    for run in others:
        assert run.success
        assert np.abs(run.q[-1] - exact.q[-1]).max() <= 10 * run.chosen.rtol
        assert len(run.t) < 150


LEANS = np.radians(5.0)


def box_on_its_edge():
    """It leans over its edge, turns about it, begins to slip where the force leaves the cone, and falls on its face."""
    scene, q0 = dropped_box(0.0)
    tilt = np.arctan2(0.2, 0.1) - LEANS
    q0[2] = 0.1 * np.sin(tilt) + 0.05 * np.cos(tilt)
    q0[3:] = pin.Quaternion(pin.exp3(np.array([0.0, tilt, 0.0]))).coeffs()
    return scene, q0


def edge_reference(t):
    """Position (x, z) and turning of the box, in the plane, up to its fall on the face; and when it begins to slip."""
    half, inertia, mu, g = np.hypot(0.1, 0.05), (0.2**2 + 0.1**2) / 12, 0.5, 9.81

    def forces(y, slips):
        # accelerations of the lean and of the edge, la_N and la_F; the centre is at half (sin, cos) from the edge
        s, c, w = half * np.sin(y[0]), half * np.cos(y[0]), y[2]
        balance = [[c, 1.0, 0.0, -1.0], [-s, 0.0, -1.0, 0.0], [inertia, 0.0, -s, c]]
        law = [0.0, 0.0, slips * mu, -1.0] if slips else [0.0, 1.0, 0.0, 0.0]
        return np.linalg.solve([*balance, law], [s * w**2, c * w**2 - g, 0.0, 0.0])

    def rate(_, y, slips):
        return [y[2], y[3], *forces(y, slips)[:2]]

    def leaves_the_cone(_, y, slips):
        _, _, la_N, la_F = forces(y, slips)
        return mu * la_N - abs(la_F)

    leaves_the_cone.terminal = True
    precise = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "dense_output": True}
    turns = solve_ivp(rate, (0, 1), [LEANS, 0.0, 0.0, 0.0], args=(0,), events=leaves_the_cone, **precise)
    begins, y = turns.t[-1], turns.y[:, -1]
    slips = solve_ivp(rate, (begins, t[-1] + 1e-9), y, args=(np.sign(forces(y, 0)[3]),), **precise)
    lean, edge, _, _ = np.where(t < begins, turns.sol(np.minimum(t, begins)), slips.sol(np.maximum(t, begins)))
    x, z = half * np.sin(LEANS) - edge - half * np.sin(lean), half * np.cos(lean)
    return np.column_stack([x, z, np.arctan2(0.2, 0.1) - lean]), begins


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-8])
def test_slip_that_begins_slowly_is_stiff(rtol):
    """Its direction turns the faster the slower it is; the number of steps stays that of a smooth motion."""
    run = nga.simulate(*box_on_its_edge(), t_end=0.4, rtol=rtol)
    exact, begins = edge_reference(run.t)
    found = np.column_stack([run.q[:, 0], run.q[:, 2], 2 * np.arcsin(run.q[:, 4])])
    assert np.abs(found - exact).max() <= 10 * rtol
    assert [event.t for event in run.events if event.kind == "slip"] == pytest.approx(2 * [begins], abs=10 * rtol)
    assert len(run.t) <= 130  # the phase begins again twice where the slip is that of rounding


def test_dependent_constraints():
    """Six hinges of a Bricard linkage have one more row than they need."""
    rough, exact = (nga.simulate(*robots.load("bricard"), t_end=1.0, rtol=rtol) for rtol in (1e-6, 1e-10))
    assert np.abs(rough.q[-1] - exact.q[-1]).max() < 1e-6
    assert exact.audit().ok, str(exact.audit())


def test_beams_are_integrated_at_full_order():
    scene, q0, v0 = robots.load("hopper")
    run = nga.simulate(scene, q0, v0, t_end=1e-3, rtol=1e-3)
    assert set(run.solver_path[1:]) == {"smooth"}
    assert run.success
