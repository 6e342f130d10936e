"""Friction ellipses: kinematics against differences, paths against solve_ivp, the force that dissipates most."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import PAIRS, all_rows, pair_scene, random_state
from motions import along, central, same
from scipy.integrate import solve_ivp

import ngalpha_pin as nga
from ngalpha_pin import oracle
from ngalpha_pin.system.contact_search import load_slots
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

G, T = 9.81, 0.4
MU, TURNED, FRONT, INERTIA = (0.05, 0.3), 0.5, 0.2, 0.02
AXIS = (0.5, -0.7, 0.9)


def speed(t):
    """A factor and its rate."""
    return 1.0 + 0.5 * np.sin(3 * t), 1.5 * np.cos(3 * t)


MOVING = nga.SurfaceVelocity((0.7, -0.4, 0.3), (0.5, 0.8, -1.1), (0.2, -0.1, 0.3), speed)


@pytest.mark.parametrize("side", "ab")
@pytest.mark.parametrize("pair", [*PAIRS, "box-box"])
def test_kinematics(pair, side):
    """Rates along the axes of the ellipse and about them, their accelerations and derivatives, by differences."""
    scene = pair_scene("sphere-plane" if pair == "box-box" else pair, "moving")
    scene.contacts.clear()
    names = ("b", "a")
    if pair == "box-box":
        names = ("corner", "face")
        pose = pin.SE3(pin.exp3(np.array([0.6, -0.5, 0.2])), np.zeros(3))
        scene.add_geometry("corner", coal.Box(0.3, 0.4, 0.5), parent="body_0", placement=pose)
        scene.add_geometry("face", coal.Ellipsoid(0.5, 0.7, 0.9), parent="body_1")
    frame = names["ba".index(side)]
    ellipse = nga.FrictionEllipse(0.1, 0.3, AXIS, frame)
    scene.add_contact(*names, mu=ellipse, contact_radius=0.2, rolling_resistance=0.1, surface_velocity=MOVING)
    system = System(scene)
    q, v, a = random_state(system.model, 1)
    if pair == "box-box":
        q[7:10] = q[:3] + np.array([0.5, 0.3, 0.4])
        load_slots(system, State(0.0, q, v, a), 0.0, 10.0)

    def rows_at(q, v, a, t):
        if pair != "box-box":
            return all_rows(system, q, v, a, t)
        system.dynamics(t, q, v, a)
        loaded = system.contacts.n_fixed + np.flatnonzero(system.slots.loaded)
        return system.contact_rows(system.contacts.subset(loaded), q, v, a, t)

    rows, every = rows_at(q, v, a, T), np.eye(system.model.nv)
    k = len(rows.g_N)
    assert k > 0
    pin.forwardKinematics(system.model, system.data, q)
    geometry = scene.geometry(frame)
    u = (system.data.oMi[int(geometry.parentJoint)] * geometry.placement).rotation @ np.array(ellipse.axis)
    for i in range(k):
        n, (d1, d2) = rows.normals[i], rows.directions[k + 5 * i : k + 5 * i + 2]
        laid = u - (n @ u) * n
        assert d1 == pytest.approx(laid / np.linalg.norm(laid) / 3, abs=1e-12)
        assert d2 == pytest.approx(np.cross(n, laid) / np.linalg.norm(laid), abs=1e-12)
    tolerance = 1e-6 if pair == "box-box" else 1e-7
    X, Y = rows.derivatives(system.motion(v, a, T))
    found = central(lambda s: rows_at(*along(system.model, q, v, a, s), np.zeros_like(v), T + s).rate)
    by_q = [central(lambda s, e=e: rows_at(pin.integrate(system.model, q, s * e), v, a, T).rate) for e in every]
    by_v = [central(lambda s, e=e: rows_at(q, v + s * e, a, T).acceleration) for e in every]
    assert same(rows.acceleration, found, tolerance)
    assert same(X, np.array(by_q).T, tolerance) and same(Y, np.array(by_v).T, tolerance)


def sledge(mu, front=0.0, q_z=0.1):
    """A body of 1 kg on runners that touch in one point in front of its centre; it moves along x, y, z and yaws."""
    model = pin.Model()
    joint = 0
    for kind in (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ, pin.JointModelRZ):
        joint = model.addJoint(joint, kind(), pin.SE3.Identity(), kind.__name__)
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), INERTIA * np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(joint)
    model.addFrame(
        pin.Frame("north", 0, 0, pin.SE3(pin.utils.rotate("z", TURNED), np.zeros(3)), pin.FrameType.OP_FRAME)
    )
    scene = nga.Scene(model)
    scene.add_plane("ice")
    ahead = pin.SE3(np.eye(3), np.array([front, 0.0, 0.0]))
    scene.add_geometry("runner", coal.Sphere(0.1), parent="JointModelRZ", placement=ahead)
    scene.add_contact("runner", "ice", mu=mu)
    return scene, np.array([0.0, 0.0, 0.1, 0.3])


def slides(t, y, with_body):
    """Rates of (x, y, yaw) and their velocities of a sledge that slips."""
    yaw, (vx, vy, spin) = y[2], y[3:]
    arm = FRONT * np.array([np.cos(yaw), np.sin(yaw)])
    slip = np.array([vx - spin * arm[1], vy + spin * arm[0]])
    angle = yaw if with_body else TURNED
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    w, squared = axes @ slip, np.array(MU) ** 2
    force = axes.T @ (-G * squared * w / np.sqrt(squared @ w**2))
    return np.concatenate((y[3:], force, [(arm[0] * force[1] - arm[1] * force[0]) / INERTIA]))


@pytest.mark.parametrize("with_body", [True, False])
@pytest.mark.parametrize("rtols", [(1e-4,), pytest.param((1e-6, 1e-8), marks=pytest.mark.long)])
def test_sledge_on_ice(with_body, rtols):
    """Its path with axes that it carries, or that the ice has: of second order, within the tolerance with rtol."""
    scene, q0 = sledge(nga.FrictionEllipse(*MU, frame="runner" if with_body else "north"), FRONT)
    y0 = np.array([0.0, 0.0, 0.3, 0.9, 0.6, 2.0])
    t_end = 0.2
    exact = solve_ivp(slides, (0, t_end), y0, "DOP853", args=(with_body,), rtol=1e-12, atol=1e-13).y[:3, -1]
    v0, errors = np.array([0.9, 0.6, 0.0, 2.0]), []
    for accuracy in ({"dt": 1e-2}, {"dt": 1e-3}, *({"rtol": rtol} for rtol in rtols)):
        run = nga.simulate(scene, q0, v0, t_end=t_end, **accuracy)
        errors.append(np.abs(run.q[-1, [0, 1, 3]] - exact).max())
        assert run.audit().ok
        if "rtol" in accuracy:
            assert errors.pop() < 10 * accuracy["rtol"]
    assert np.log10(errors[0] / errors[1]) > 1.9
    # of all forces of the ellipse the one whose power is least: its normal is along the slip
    scale = np.array(MU) / max(MU)
    force, slip = scale * run.la_F[1:], run.gamma_F[1:] / scale
    assert (force / MU) ** 2 @ np.ones(2) == pytest.approx(run.la_N[1:, 0] ** 2, rel=1e-9)
    along = -force / np.array(MU) ** 2
    cosine = (along * slip).sum(axis=1) / np.linalg.norm(along, axis=1) / np.linalg.norm(slip, axis=1)
    assert cosine == pytest.approx(1.0, abs=1e-9)
    world = run.contact_force("runner/ice").force[1:, :2]
    assert np.linalg.norm(world, axis=1) == pytest.approx(np.linalg.norm(force, axis=1), rel=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.4, np.pi / 2])
@pytest.mark.parametrize("accuracy", [{"dt": 1e-2, "t_end": 0.2}, {"rtol": 1e-6, "t_end": 0.05}])
def test_both_sides_of_the_ellipse(angle, accuracy):
    limit = G / np.hypot(np.cos(angle) / MU[0], np.sin(angle) / MU[1])
    for side in (-0.01, 0.01):
        scene, q0 = sledge(nga.FrictionEllipse(*MU, frame="north"))
        push = limit * (1 + side) * np.array([np.cos(angle + TURNED), np.sin(angle + TURNED), 0.0, 0.0])
        scene.add_force(nga.Control(lambda t, q, v, push=push: push))
        run = nga.simulate(scene, q0, **accuracy)
        assert (np.abs(run.q - q0).max() < 1e-14) == (side < 0.0)
        assert run.audit().ok


@pytest.mark.parametrize("accuracy", [{"dt": 5e-3}, pytest.param({"rtol": 1e-6}, marks=pytest.mark.long)])
def test_sledge_comes_to_rest(accuracy):
    """Along its runners, in closed form; the end of the slip is located."""
    scene, q0 = sledge(nga.FrictionEllipse(*MU, frame="runner"))
    v0 = 0.1 * np.array([np.cos(0.3), np.sin(0.3), 0.0, 0.0])
    run = nga.simulate(scene, q0, v0, t_end=0.25, **accuracy)
    assert run.q[-1, :2] == pytest.approx(0.1**2 / 2 / (MU[0] * G) * np.array([np.cos(0.3), np.sin(0.3)]), abs=1e-8)
    assert np.abs(run.v[-1]).max() < 1e-13 and [event.kind for event in run.events] == ["stick"] and run.audit().ok


def test_isotropic_limit():
    """To rounding; along axes that turn to the tolerance of a step: accelerations say how far friction moves."""
    v0 = np.array([0.9, 0.6, 0.0, 2.0])
    for dt in (1e-2, 2e-3):
        laws = 0.3, nga.FrictionEllipse(0.3, 0.3, frame="ice"), nga.FrictionEllipse(0.3, 0.3, frame="runner")
        runs = [nga.simulate(*sledge(mu, FRONT), v0, t_end=0.1, dt=dt) for mu in laws]
        assert np.abs(runs[1].q - runs[0].q).max() < 1e-13 and np.abs(runs[1].v - runs[0].v).max() < 1e-12
        assert np.abs(runs[2].q[-1] - runs[0].q[-1]).max() < 1e-11


@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-6}])
def test_rail_across_the_axes(accuracy):
    """Where bodies can move one way alone, that way meets the part of the ellipse along it that dissipates most."""
    model = pin.Model()
    first = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    second = model.addJoint(first, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    model.appendBodyToJoint(second, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(second)
    scene = nga.Scene(model)
    scene.add_plane("ice")
    scene.add_geometry("block", coal.Sphere(0.1), parent="z")
    axis = (np.cos(0.7), np.sin(0.7), 0.0)
    scene.add_contact("block", "ice", mu=nga.FrictionEllipse(*MU, axis))
    mu = np.hypot(MU[0] * axis[0], MU[1] * axis[1])
    run = nga.simulate(scene, np.array([0.0, 0.1]), np.array([1.0, 0.0]), t_end=0.3, **accuracy)
    assert run.q[-1, 0] == pytest.approx(0.3 - mu * G * 0.3**2 / 2, abs=1e-9)
    assert run.audit().ok


def test_impact_obeys_the_ellipse():
    scene, q0 = sledge(nga.FrictionEllipse(*MU, frame="north"))
    q0[2] += 0.05
    v0 = np.array([2.0, -1.0, 0.0, 0.0])
    run = nga.simulate(scene, q0, v0, t_end=0.12, dt=1e-2)
    fall = np.sqrt(2 * G * 0.05)
    jump = (run.impacts.v_after[0] - run.impacts.v_before[0])[:2]
    R = pin.utils.rotate("z", TURNED)[:2, :2]
    after = R.T @ run.impacts.v_after[0, :2]
    squared = np.array(MU) ** 2
    assert R.T @ jump == pytest.approx(-fall * squared * after / np.sqrt(squared @ after**2), abs=1e-9)
    assert run.audit().ok


def test_declaration_and_files(tmp_path):
    for make, words in (
        (lambda: nga.FrictionEllipse(0.0, 0.2), "along"),
        (lambda: nga.FrictionEllipse(0.1, np.nan), "across"),
        (lambda: nga.FrictionEllipse(0.1, 0.2, (0, 0, 0)), "axis"),
        (lambda: sledge(nga.FrictionEllipse(0.1, 0.2, frame="JointModelPX")), "neither of the bodies"),
        (lambda: sledge(nga.FrictionEllipse(0.1, 0.2, frame="nothing")), "nothing"),
        (lambda: sledge(0.1)[0].set_surface("*", mu=nga.FrictionEllipse(0.1, 0.2)), "mu"),
    ):
        with pytest.raises(nga.SceneError, match=words):
            make()
    scene, q0 = sledge(nga.FrictionEllipse(*MU, frame="north"))
    run = nga.simulate(scene, q0, np.array([1.0, 0.0, 0.0, 0.0]), t_end=0.05, dt=1e-2)
    run.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    assert loaded.scene.contacts[0].law.ellipse == scene.contacts[0].law.ellipse and loaded.audit().ok
    on = [nga.simulate(x.scene, state=x.final_state, t_end=0.1, dt=1e-2) for x in (run, loaded)]
    np.testing.assert_array_equal(on[0].q, on[1].q)
    with pytest.raises(nga.SceneError, match="ellipses"):
        oracle.simulate(scene, q0, t_end=0.1, dt=1e-2)
