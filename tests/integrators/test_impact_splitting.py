"""Through impacts at second order with a fixed step: exact where the arcs are parabolas, slope 2 elsewhere."""

import dataclasses

import coal
import numpy as np
import pinocchio as pin
import pytest
from box_scenes import falls
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin import references, robots
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.integrators.impact_splitting import MAX_IMPACTS, _first_closing


def position_error(name, run, **parameters):
    q, _ = getattr(references, name)(run.t, **parameters)
    return np.abs(run.q - q)[:, :2].max()


def slope(sizes, errors):
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


@pytest.mark.parametrize(("dt", "bound"), [(1e-2, 5e-5), (1e-3, 1e-8)])
@pytest.mark.parametrize("omega", [0.0, 50.0])
def test_ball_that_bounces_to_rest(dt, bound, omega):
    parameters = {"omega": omega, "e_N": 0.5}
    run = nga.simulate(*robots.load("rotating_ball", **parameters), t_end=1.6, dt=dt)
    assert position_error("rotating_ball", run, **parameters) <= bound
    assert run.audit().ok, str(run.audit())
    # the bounces accumulate within the step of the last ones, and the ball rests from then on
    rest = run.t > 3 * np.sqrt(2 * 0.9 / 9.81) + 2 * dt
    assert np.abs(run.g_N[rest]).max() < 1e-12
    assert set(run.solver_path[rest]) == {"newton"}


@pytest.mark.parametrize("dt", [1e-2, 1e-3, pytest.param(1e-4, marks=pytest.mark.long)])
def test_ball_in_corner_is_exact_between_two_planes(dt):
    """The impact on one plane throws the ball off the other; all arcs are parabolas, so only rounding is left."""
    run = nga.simulate(*robots.load("ball_in_corner"), t_end=1.25, dt=dt)
    assert position_error("ball_in_corner", run) < 1e-11
    arcs = [arc for arc in references.ball_in_corner_arcs(1.25) if arc.La_N.any()]
    assert run.impacts.t == pytest.approx([arc.t for arc in arcs], abs=1e-11)
    assert run.impacts.P_N == pytest.approx(np.array([arc.La_N for arc in arcs]), abs=1e-9)
    # the signs of the friction directions are those of the package
    assert np.abs(run.impacts.P_F) == pytest.approx(np.abs([arc.La_F for arc in arcs]), abs=1e-9)


SCENES = {
    "rocking block": (lambda: robots.load("rocking_block"), lambda t: references.rocking_block(t)[0], 1.6),
    "cradle": (lambda: robots.load("cradle"), lambda t: references.cradle(t)[0], 2.0),
}


@pytest.mark.parametrize("name", SCENES)
def test_second_order_through_impacts(name):
    build, reference, t_end = SCENES[name]
    sizes, errors = [1e-2, 5e-3, 2.5e-3], []
    for dt in sizes:
        run = nga.simulate(*build(), t_end=t_end, dt=dt)
        assert run.audit().ok, str(run.audit())
        errors.append(np.abs(run.q - reference(run.t)).max())
    assert len(run.impacts.t) >= 3
    assert slope(sizes, errors) >= 1.9, errors


@pytest.mark.long
@pytest.mark.parametrize("name", SCENES)
def test_second_order_through_impacts_down_to_small_steps(name):
    build, reference, t_end = SCENES[name]
    sizes, errors = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4], []
    for dt in sizes:
        run = nga.simulate(*build(), t_end=t_end, dt=dt)
        errors.append(np.abs(run.q - reference(run.t)).max())
    assert slope(sizes, errors) >= 1.9, errors


def test_impact_without_restitution_is_located_too():
    run = nga.simulate(*robots.load("rotating_ball", omega=10.0), t_end=1.0, dt=1e-2)
    assert position_error("rotating_ball", run, omega=10.0) < 1e-13


def test_forgotten_forces_of_a_contact_do_not_hide_its_next_impact():
    """With rho_inf = 0.9 the auxiliary forces of a contact live on for many steps after it has opened."""
    scene, q0, v0 = robots.load("ball_in_corner")
    run = nga.simulate(scene, q0, v0, t_end=1.25, dt=2e-3, method=GeneralizedAlpha(rho_inf=0.9))
    assert position_error("ball_in_corner", run) < 1e-11


@pytest.mark.parametrize("dt", [1e-2, 1e-3])
def test_impact_of_a_body_that_turns_far_in_a_step_is_located(dt):
    """The end of a step then moves with its length at another rate than its velocity."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.05), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.05), parent="ball")
    scene.add_contact("ball", "ground", e_N=1.0)
    v0 = np.array([0.0, 0.0, -30.0, 35.0, 1.0, 15.0])
    run = nga.simulate(scene, np.array([0.0, 0, 0.9, 0, 0, 0, 1.0]), v0, t_end=0.06, dt=dt)
    assert run.impacts.t == pytest.approx([0.85 / 30.0], abs=20.0 * dt**2)
    assert run.audit().ok, str(run.audit())


def bouncing(e_N, n=1):
    """n balls that fall side by side from different heights."""
    return balls(n, pin.JointModelPZ, e_N=e_N), 0.1 + 0.05 * (1.0 + np.arange(n))


def test_bounces_of_several_bodies_within_one_step():
    run = nga.simulate(*bouncing(0.7, 3), t_end=0.4, dt=0.1)
    assert len(run.impacts.t) >= 5
    for i in range(3):
        alone = nga.simulate(*bouncing(0.7, 3), t_end=0.4, dt=1e-3)
        assert np.abs(run.q[:, i] - alone.q[::100, i]).max() < 1e-12


@pytest.mark.parametrize("part", [0.7, 0.9, 0.999, 1.001])
def test_ball_that_bounces_and_comes_back_within_one_step(part):
    """After its impact it flies for this part of the rest of the step: a parabola, so nothing is off."""
    dt, after, g = 2e-2, 5e-3, 9.81
    rebound = g * part * (dt - after) / 2.0
    v = g * after - 2.0 * rebound  # e_N = 0.5
    start = np.array([0.1 - v * after + g * after**2 / 2.0])
    run = nga.simulate(bouncing(0.5)[0], start, np.array([v]), t_end=dt, dt=dt)
    again = part < 1.0
    left, speed = ((1.0 - part) * (dt - after), rebound / 2.0) if again else (dt - after, rebound)
    assert len(run.impacts.t) == 1 + again
    assert run.v[-1, 0] == pytest.approx(speed - g * left, abs=1e-9)
    assert run.q[-1, 0] - 0.1 == pytest.approx(speed * left - g * left**2 / 2.0, abs=1e-11)
    assert run.audit().ok, str(run.audit())


def test_cube_whose_face_jumps_off_and_comes_back():
    """As closed contacts its four corners would be dependent directions that do not meet the laws of an impact."""
    scene = falls.boxes([np.full(3, 0.1048)], "plane", mu=0.18, e_N=0.125)
    scene.model.inertias[1] = pin.Inertia(0.37, np.zeros(3), 8.1e-4 * np.eye(3))
    q0 = np.array([-0.149990, -0.041248, 0.052478, 0.247810, -0.662262, -0.248793, -0.661893])
    v0 = np.array([0.122253, -0.498415, 0.594463, 0.724690, -0.001076, -2.350690])
    q0 = pin.normalize(scene.model, q0)
    run = nga.simulate(scene, q0, v0, t_end=10 / 148, dt=1 / 148)
    assert run.n_iter.max() <= 50
    assert run.audit().ok, str(run.audit())


@pytest.mark.parametrize("azimuth", [0.3, 1.0])
def test_rim_that_comes_down_between_the_points_that_the_step_has_known(azimuth):
    """Nearly flat, a rim is known by points that are fixed in a step; its lowest one is where it meets the ground."""
    tilt = 1e-3
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("can", coal.Cylinder(0.1, 0.2), mass=1.0)
    scene.add_contact("can", "ground", mu=0.4)
    R = pin.exp3(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
    q0 = np.array([0.0, 0.0, 0.1 * np.cos(tilt) + 0.1 * np.sin(tilt) + 1e-7, *pin.Quaternion(R).coeffs()])
    omega = np.array([0.4 * np.sin(azimuth), -0.4 * np.cos(azimuth) - 1.5, 2.0])
    run = nga.simulate(scene, q0, np.concatenate((R.T @ [0.0, 0.0, 0.12], R.T @ omega)), t_end=0.006, dt=2e-3)
    assert len(run.impacts.t)
    for q in run.impacts.q:
        cosine = pin.XYZQUATToSE3(q).rotation[2, 2]
        assert abs(q[2] - 0.1 * cosine - 0.1 * np.sqrt(1.0 - cosine**2)) < 1e-9
    assert run.audit().ok, str(run.audit())


def test_work_of_many_bounces_is_bounded():
    run = nga.simulate(*bouncing(0.9), t_end=2.2, dt=2e-2)
    assert run.success
    assert len(run.impacts.t) > 20
    assert np.bincount(np.searchsorted(run.t, run.impacts.t)).max() <= MAX_IMPACTS
    assert run.audit().penetration < 1e-12
    assert run.q[-1, 0] == pytest.approx(0.1, abs=1e-9)
    assert np.diff(run.energy.total).max() < 1e-9


def test_laws_of_the_paper_do_not_locate_impacts():
    method = GeneralizedAlpha(laws="paper")
    run = nga.simulate(*robots.load("rotating_ball", e_N=0.5), t_end=0.6, dt=1e-2, method=method)
    assert len(run.impacts.t) == 0
    assert "impact" not in run.solver_path


def test_step_without_impact_pays_nothing(monkeypatch):
    called = []
    for name in ("integrators.division.cut_at_impact", "system.contact_search.ContactSearch.hitting"):
        monkeypatch.setattr(f"ngalpha_pin.{name}", lambda *arguments: called.append(arguments))
    nga.simulate(*robots.load("rotating_ball", height=0.1, e_N=0.5), t_end=0.2, dt=1e-3)
    nga.simulate(*robots.load("quadruped", height=0.5), t_end=0.1, dt=1e-3)
    assert not called


@pytest.mark.parametrize("change", ["v_after", "P_N", "P_F"])
def test_audit_finds_an_impact_against_the_laws(change):
    run = nga.simulate(*robots.load("rotating_ball", e_N=0.5), t_end=0.5, dt=1e-2)
    assert run.audit().ok
    assert run.audit().impact_law < 1e-12
    value = getattr(run.impacts, change).copy()
    value[0] *= 1.001
    changed = dataclasses.replace(run, impacts=run.impacts._replace(**{change: value}))
    assert changed.audit().impact_law > 1e-4
    assert not changed.audit().ok


def test_impacts_are_events_and_are_saved(tmp_path):
    run = nga.simulate(*robots.load("rotating_ball", e_N=0.5, omega=0.0), t_end=1.2, dt=1e-2)
    fall = np.sqrt(2 * 0.9 / 9.81)
    found = [event.t for event in run.events if event.kind == "impact"]
    assert found[:3] == pytest.approx(fall * np.array([1.0, 2.0, 2.5]), abs=1e-10)
    run.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    for name, array in run.impacts._asdict().items():
        assert np.array_equal(getattr(loaded.impacts, name), array)
    assert loaded.events == run.events


def test_gap_that_is_open_at_the_start_is_no_contact_that_leaves():
    """A hundredth of what its speed makes of it in the step: it closes where its own parabola comes back."""
    gap, rate = (lambda s: 0.01 + s - 1.2 * s * s), (lambda s: 1.0 - 2.4 * s)
    ends = [(np.array([gap(s)]), np.array([rate(s)])) for s in (0.0, 1.0)]
    assert _first_closing(0.0, 1.0, *ends) == pytest.approx((1.0 + np.sqrt(1.048)) / 2.4, rel=1e-12)
