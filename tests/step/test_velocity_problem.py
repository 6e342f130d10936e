"""Restitution with two phases, and such that depends on the approach, in runs: located, captured, with rtol."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.step.velocity_problem import captured, velocity_problem
from ngalpha_pin.system.system import System

ANGLE, DEPTH = 0.6, 0.05
INERTIA = np.array([1.0, 1.0, 1 / 12])


def rod(e_N, mu=0.5):
    """A rod of 1 kg and 1 m in the plane, with a round tip."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelPlanar(), pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3)), "rod")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.diag([0.05, 0.05, 1 / 12])), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("tip", coal.Sphere(0.01), parent="rod", placement=pin.SE3(np.eye(3), np.array([-0.5, 0, 0])))
    scene.add_contact("tip", "ground", mu=mu, e_N=e_N)
    q0 = np.array([0.0, 0.5 * np.sin(ANGLE) + 0.01 + DEPTH, np.cos(ANGLE), np.sin(ANGLE)])
    return scene, q0, np.array([0.1, -1.0, -0.3])


def energy(v):
    return 0.5 * (INERTIA * v * v).sum(axis=-1)


@pytest.mark.parametrize("law", ["poisson", "stronge"])
def test_located_impacts_lose_energy_where_newtons_law_adds_some(law):
    ends = []
    for e_N in (0.95, nga.Restitution(0.95, law)):
        scene, q0, v0 = rod(e_N)
        exact = nga.simulate(scene, q0, v0, t_end=0.08, rtol=1e-9).v[-1]
        errors = []
        for dt in (1e-2, 1e-3):
            run = nga.simulate(scene, q0, v0, t_end=0.08, dt=dt)
            errors.append(np.abs(run.v[-1] - exact).max())
            assert len(run.impacts.t) == 1
            assert run.audit().ok == (e_N != 0.95), str(run.audit())  # it names the energy that Newton's law adds
        assert np.log10(errors[0] / errors[1]) > 1.9
        ends.append(float((energy(run.impacts.v_after) - energy(run.impacts.v_before))[0]))
    assert ends[1] < 0.0 < ends[0]


@pytest.mark.parametrize("law", ["poisson", "stronge"])
@pytest.mark.parametrize("method", [nga.GeneralizedAlpha(laws="paper"), nga.MoreauJean()])
def test_captured_impacts(law, method):
    """Their normal velocity is that of the law, as far as friction at the end of the step leaves no more energy."""
    scene, q0, v0 = rod(nga.Restitution(0.95, law))
    fine = nga.simulate(scene, q0, v0, t_end=0.06, dt=1e-4, method=method)
    system, contact = System(scene), np.arange(1)
    i = int(np.argmax(fine.P_N[:, 0] > 0.0))
    before, after = fine.v[i - 1], fine.v[min(i + 1, len(fine.t) - 1)]
    assert energy(after) < energy(before) + 1e-3
    problem = velocity_problem(system, 0.0, fine.q[i], before, system.contacts.subset(contact))
    sub = system.contacts.subset(contact)
    leaves = system.contact_rates(sub, fine.q[i], after)[0]
    assert leaves == pytest.approx(-captured(sub, problem.free, 0.0)[0], rel=2e-3)
    assert fine.audit().ok


@pytest.mark.parametrize("law", ["newton", "poisson", "stronge"])
@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"dt": 1e-3}, {"rtol": 1e-4}, {"rtol": 1e-6}, {"rtol": 1e-8}])
def test_restitution_that_falls_with_the_approach(law, accuracy):
    """A ball bounces twice; without friction the three laws are one."""
    e = lambda v: 0.9 / (1 + 0.2 * v)  # noqa: E731
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("ball", coal.Sphere(0.1), mass=2.0)
    scene.add_contact("ball", "ground", e_N=nga.Restitution(e, law))
    q0 = scene.q_ref.copy()
    q0[2] = 0.6
    run = nga.simulate(scene, q0, t_end=0.8, **accuracy)
    first = np.sqrt(2 * 9.81 * 0.5)
    second = e(first) * first
    t = first / 9.81 + np.array([0.0, 2 * second / 9.81])
    within = accuracy.get("rtol", 1e-8)
    assert run.impacts.t == pytest.approx(t, abs=within)
    assert run.impacts.v_after[:, 2] == pytest.approx([second, e(second) * second], abs=within)
    assert run.audit().ok


@pytest.mark.parametrize("law", ["newton", "poisson", "stronge"])
@pytest.mark.parametrize("side", [-0.01, 0.01])
@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-6}])
def test_slip_ends_in_the_impact_or_goes_on(law, side, accuracy):
    """A ball lands with slip: mu at which the percussion of friction stops it at the last moment, +- 1 %."""
    fall, slip, e, way = 1.0, np.array([0.48, 0.36]), 0.5, 0.01
    mu = (1 + side) * 2 / 7 * 0.6 / ((1 + e) * fall)
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("ball", coal.Sphere(0.1), mass=2.0, placement=pin.SE3(np.eye(3), np.array([0, 0, 0.1 + way])))
    scene.add_contact("ball", "ground", mu=mu, e_N=nga.Restitution(e, law))
    before = np.sqrt(fall**2 - 2 * 9.81 * way)
    run = nga.simulate(scene, scene.q_ref, np.array([*slip, -before, 0.0, 0.0, 0.0]), t_end=0.03, **accuracy)
    v, omega = run.impacts.v_after[0, :3], run.impacts.v_after[0, 3:]
    left = v + np.cross(omega, [0.0, 0.0, -0.1])
    assert v[2] == pytest.approx(e * fall, abs=1e-9)
    assert left[:2] == pytest.approx(max(0.0, -side) * slip, abs=1e-9)
    assert run.audit().ok, str(run.audit())


def test_boxes_that_land_on_corners_at_once_lose_energy():
    """Up to sixteen corners, in one step."""
    for n in (1, 4):
        scene = nga.Scene()
        scene.add_plane("ground")
        for i in range(n):
            place = pin.SE3(np.eye(3), np.array([0.5 * i, 0.0, 0.06]))
            scene.add_body(f"box{i}", coal.Box(0.2, 0.2, 0.1), mass=1.0, placement=place)
            scene.add_contact(f"box{i}", "ground", mu=0.4, e_N=nga.Restitution(0.6, "stronge"))
        q0, v0 = scene.q_ref, np.tile([0.5, 0.0, -1.0, 0.0, 0.3, 0.0], n)
        run = nga.simulate(scene, q0, v0, t_end=0.03, dt=2e-3)
        assert run.v[-1, 2] > 0.1
        assert run.audit().ok, str(run.audit())


@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-6}])
def test_a_ball_that_rests_far_away_changes_no_impact(accuracy):
    """Its law of restitution is that of its own impacts, and of bodies that it touches."""
    turn, ends = pin.Quaternion(pin.exp3(np.array([0.3, 0.5, 0.0]))), []
    for law in ("newton", "poisson", "stronge"):
        scene = nga.Scene()
        scene.model.gravity = pin.Motion.Zero()
        scene.add_plane("ground")
        scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
        scene.add_body("slab", coal.Box(0.3, 0.2, 0.1), mass=1.0)
        scene.add_contact("ball", "ground", mu=0.3, e_N=nga.Restitution(0.5, law))
        scene.add_contact("slab", "ground", mu=0.4, e_N=0.7)
        q0 = np.array([2.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.3, *turn.coeffs()])
        v0 = np.concatenate((np.zeros(6), turn.matrix().T @ [0.6, 0.3, -1.0], [1.0, -2.0, 3.0]))
        run = nga.simulate(scene, q0, v0, t_end=0.3, **accuracy)
        assert len(run.impacts.t) > 0 and run.audit().ok, str(run.audit())
        ends.append(run.v[-1])
    assert ends[1] == pytest.approx(ends[0], abs=1e-9) and ends[2] == pytest.approx(ends[0], abs=1e-9)
