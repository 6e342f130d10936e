"""Surfaces that move along themselves: kinematics against differences, belts and turntables against closed forms."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import PAIRS, all_rows, pair_scene, random_state
from motions import along, carried, central, same, surface_pose
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import ngalpha_pin as nga
from ngalpha_pin.results.energy_balance import balance
from ngalpha_pin.system.system import System

G = 9.81
T = 0.4
GENERAL = {"linear": (0.7, -0.4, 0.3), "angular": (0.5, 0.8, -1.1), "centre": (0.2, -0.1, 0.3)}


def speed(t):
    """A factor and its rate."""
    return 1.0 + 0.5 * np.sin(3.0 * t), 1.5 * np.cos(3.0 * t)


def turned_pair(pair, arrangement, side, **law):
    """The pair with a moving surface of "a", which has the surface of the contact, or of "b", which has the points."""
    scene = pair_scene(pair, arrangement, **law)
    scene.contacts.clear()
    names = ("b", "a") if side == "a" else ("a", "b")
    moving = nga.SurfaceVelocity(**GENERAL, speed=speed)
    scene.add_contact(*names, mu=0.4, contact_radius=0.2, surface_velocity=moving)
    return scene


# of two spheres the one that is named first has the point
CASES = [(p, "moving", side) for p in PAIRS for side in "ab" if (p, side) != ("sphere-sphere", "b")]
CASES += [("vertex-plane", "fixed", "a"), ("sphere-hollow cylinder", "fixed", "b"), ("vertex-plane", "humanoid", "b")]


@pytest.fixture(params=CASES, ids=lambda c: " ".join(c))
def case(request):
    system = System(turned_pair(*request.param))
    return request.param, system, *random_state(system.model, 1)


def test_slip_is_that_of_the_moving_material(case):
    """Against the velocity of the surface at the point of contact, from the pose of its geometry alone."""
    (_, _, side), system, q, v, a = case
    rows, k = all_rows(system, q, v, a, T), system.contacts.n_points
    model, scene = system.model, system.scene
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    geometry = scene.geometry(side)
    pose = data.oMi[int(geometry.parentJoint)] * geometry.placement
    still = all_rows(System(pair_scene(*case[0][:2])), q, v, a, T)
    for i in range(k):
        point = rows.c[i] - system.contacts.radius[i] * rows.normals[i]
        x = pose.actInv(point)
        w = np.array(GENERAL["linear"]) + np.cross(GENERAL["angular"], x - np.array(GENERAL["centre"]))
        sign, s = (1.0 if side == "b" else -1.0), speed(T)[0]
        t = rows.directions[k + 3 * i : k + 3 * i + 2]
        expected = (
            sign
            * s
            * np.append(
                t @ pose.rotation @ w, 3 * np.pi / 16 * 0.2 * rows.normals[i] @ pose.rotation @ GENERAL["angular"]
            )
        )
        at = slice(k + 3 * i, k + 3 * i + 3)
        assert rows.rate[at] - still.rate[at] == pytest.approx(expected, abs=1e-12)
    assert (rows.rate[:k] == still.rate[:k]).all() and (rows.acceleration[:k] == still.acceleration[:k]).all()


def test_accelerations_are_the_derivatives_of_the_rates(case):
    _, system, q, v, a = case
    rows = all_rows(system, q, v, a, T)
    at = rows, surface_pose(system, q)
    found = central(lambda s: carried(system, *along(system.model, q, v, a, s), at, t=T + s))
    assert same(rows.acceleration, found)


def test_derivatives_for_the_newton_matrix(case):
    _, system, q, v, a = case
    rows = all_rows(system, q, v, a, T)
    at, every = (rows, surface_pose(system, q)), np.eye(system.model.nv)
    X, Y = rows.derivatives(system.motion(v, a, T))
    by_q = [central(lambda s, e=e: carried(system, pin.integrate(system.model, q, s * e), v, at, t=T)) for e in every]
    by_v = [central(lambda s, e=e: all_rows(system, q, v + s * e, a, T).acceleration) for e in every]
    assert same(X, np.array(by_q).T) and same(Y, np.array(by_v).T)


def box_on_belt(angle=0.0, height=0.0, endless=False, **law):
    """A box of 1 kg and 0.1 m on, or above, a finite belt that climbs towards +x; x of q is along the belt."""
    model, tilt = pin.Model(), pin.SE3(pin.exp3(np.array([0.0, -angle, 0.0])), np.zeros(3))
    model.addJoint(0, pin.JointModelFreeFlyer(), tilt, "box")
    model.appendBodyToJoint(1, pin.Inertia.FromBox(1.0, 0.1, 0.1, 0.1), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    below = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.05]))
    if endless:
        scene.add_plane("belt", normal=tilt.rotation[:, 2])
    else:
        scene.add_geometry("belt", coal.Box(4.0, 1.0, 0.1), placement=tilt * below)
    scene.add_geometry("box", coal.Box(0.1, 0.1, 0.1), parent="box")
    scene.add_contact("box", "belt", **law)
    q0 = pin.neutral(model)
    q0[2] = 0.05 + height
    return scene, q0


def carried_along(t, mu, angle, v_belt):
    """Way of a box that is put onto a belt: it slips until it has the speed of the belt."""
    a = G * (mu * np.cos(angle) - np.sin(angle))
    stop = v_belt / a if a > 0.0 else np.inf
    return np.where(t < stop, a * t**2 / 2, v_belt * (t - stop / 2))


@pytest.mark.parametrize(
    ("mu", "angle", "dt"), [(0.3, 0.0, 1e-2), (0.7, np.pi / 6, 1e-2), (0.5, np.pi / 6, 1e-2), (0.7, np.pi / 6, 1e-3)]
)
def test_box_is_carried_by_a_finite_belt(mu, angle, dt):
    scene, q0 = box_on_belt(angle, mu=mu, surface_velocity=(0.5, 0.0, 0.0))
    run = nga.simulate(scene, q0, t_end=0.4 if dt > 2e-3 else 0.25, dt=dt)
    assert np.abs(run.q[:, 0] - carried_along(run.t, mu, angle, 0.5)).max() < 1e-9
    assert run.audit().ok


@pytest.mark.parametrize(("dt", "t_end"), [(1e-2, 0.4), (1e-3, 0.25)])
def test_box_that_is_dropped_on_a_belt(dt, t_end):
    """It lands flat and stays: the impact and the slip have closed forms."""
    scene, q0 = box_on_belt(height=0.02, mu=0.3, surface_velocity=(0.5, 0.0, 0.0))
    run = nga.simulate(scene, q0, t_end=t_end, dt=dt)
    lands = np.sqrt(2 * 0.02 / G)
    after = np.maximum(run.t - lands, 0.0)
    kick = 0.3 * G * lands  # of friction in the impact
    stop = (0.5 - kick) / (0.3 * G)
    x = np.where(after < stop, kick * after + 0.3 * G * after**2 / 2, 0.5 * after - (0.5 - kick) * stop / 2)
    assert np.abs(run.q[:, 0] - x).max() < 1e-6
    audit, account = run.audit(), balance(run)
    assert audit.ok
    assert account.surfaces[-1] == pytest.approx(0.5 * 0.5, rel=1e-9)  # the impulse of friction times the belt


@pytest.mark.parametrize("side", [-0.01, 0.01])
def test_box_sticks_to_a_belt_that_speeds_up_slower_than_friction_can(side):
    """On both sides of mu g, over the end of the ramp of the speed."""
    a = 0.3 * G * (1 + side)
    ramp = nga.SurfaceVelocity(linear=(a, 0, 0), speed=lambda t: min(t, 0.2), breakpoints=(0.2,))
    scene, q0 = box_on_belt(mu=0.3, surface_velocity=ramp)
    run = nga.simulate(scene, q0, t_end=0.3, dt=1e-2)
    real = min(a, 0.3 * G)
    stop = 0.2 * a / real
    x = np.where(run.t < stop, real * run.t**2 / 2, 0.2 * a * (run.t - stop / 2))
    assert np.abs(run.q[:, 0] - x).max() < 1e-9
    slip = np.linalg.norm(run.contact_motion.gamma_F[run.t < 0.2 - 1e-9, :2], axis=1)
    assert slip.max() == pytest.approx(0.0 if side < 0 else 0.19 * 0.01 * 0.3 * G, abs=1e-9)


@pytest.mark.parametrize("speed", [CubicSpline([0, 0.1, 0.3, 0.6], [0, 1, -1, 0.5]), lambda t: np.sin(9 * t)])
def test_slip_on_a_surface_that_turns_and_moves_to_and_fro(speed):
    """Of second order with dt, and within ten times the tolerance with rtol."""
    moving = nga.SurfaceVelocity(linear=(0.3, 0.2, 0.0), angular=(0.0, 0.0, 2.0), speed=speed)
    scene, q0 = box_on_belt(endless=True, mu=0.2, surface_velocity=moving)
    v0 = np.array([1.2, 0.5, 0.0, 0.0, 0.0, 1.0])

    def end(**accuracy):
        run = nga.simulate(scene, q0, v0, t_end=0.05, **accuracy)
        assert run.audit().ok
        assert "dt" in accuracy or balance(run).error < 1e-8  # what surfaces do in long steps, to the fourth order
        return run.q[-1]

    exact = end(rtol=1e-11, atol=1e-13)
    coarse, fine = (np.abs(end(dt=dt) - exact).max() for dt in (1e-2, 1e-3))
    assert np.log10(coarse / fine) > 1.95
    for rtol in (1e-4, 1e-6, 1e-8):
        assert np.abs(end(rtol=rtol, atol=rtol) - exact).max() <= 10 * rtol


def ball_on_turntable(rate, mu):
    """A ball of 0.1 m that rolls on a plane which turns about the origin, and its circle (Earnshaw 1844)."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("table")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="ball")
    scene.add_contact("ball", "table", mu=mu, surface_velocity=nga.SurfaceVelocity(angular=(0.0, 0.0, rate)))
    x, v = np.array([0.4, 0.0]), np.array([0.0, 0.3])
    # v + omega x (-r e_z) is the velocity of the table
    slip = rate * np.array([-x[1], x[0]]) - v
    omega = np.array([slip[1], -slip[0]]) / 0.1
    q0 = np.concatenate((x, [0.1, 0, 0, 0, 1]))
    return scene, q0, np.array([*v, 0.0, *omega, 0.0]), 2 / 7 * rate


def test_ball_runs_a_circle_on_a_turntable():
    scene, q0, v0, around = ball_on_turntable(3.0, 1.0)
    errors = []
    for accuracy in ({"dt": 1e-2}, {"dt": 1e-3}, {"rtol": 1e-8, "atol": 1e-10}):
        run = nga.simulate(scene, q0, v0, t_end=0.3, **accuracy)
        assert run.audit().ok
        phase = around * run.t
        # x' = around e_z x (x - centre)
        centre = np.array([0.4 - 0.3 / around, 0.0])
        circle = centre + 0.3 / around * np.column_stack((np.cos(phase), np.sin(phase)))
        errors.append(np.abs(run.q[:, :2] - circle).max())
    assert np.log10(errors[0] / errors[1]) > 1.95 and errors[2] < 1e-7


def test_slider_across_a_belt_feels_only_its_part_of_the_friction():
    """It moves along x alone; the belt crosses along y, so that friction along x is viscous: it never stops."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slider")
    model.addJoint(1, pin.JointModelPZ(), pin.SE3.Identity(), "lift")
    model.appendBodyToJoint(2, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(2)
    scene = nga.Scene(model)
    scene.add_plane("belt")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="lift")
    scene.add_contact("ball", "belt", mu=0.3, surface_velocity=(0.0, 0.5, 0.0))
    q0, v0 = np.array([0.0, 0.1]), np.array([1.0, 0.0])
    ends = {}
    for accuracy in ({"dt": 1e-2}, {"dt": 1e-3}, {"rtol": 1e-10, "atol": 1e-12}):
        run = nga.simulate(scene, q0, v0, t_end=1.0, **accuracy)
        ends[next(iter(accuracy.values()))] = run.q[-1, 0]
        assert run.audit().ok and run.v[-1, 0] > 0.0
    # x'' = -mu g x' / sqrt(x'^2 + w^2): its first integral gives the time of a speed
    exact = solve_ivp(
        lambda _, y: [y[1], -0.3 * G * y[1] / np.hypot(y[1], 0.5)], (0, 1), [0.0, 1.0], rtol=1e-12, atol=1e-14
    ).y[0, -1]
    coarse, fine, chosen = (abs(x - exact) for x in ends.values())
    assert np.log10(coarse / fine) > 1.95 and chosen < 1e-9


def test_tracks_of_a_tank_drive_it():
    """The moving surface is that of the body: it pushes itself off with mu g until its tracks do not slip."""
    scene, q0 = box_on_belt(endless=True)
    scene.contacts.clear()
    scene.add_contact("belt", "box", mu=0.3, surface_velocity=(-0.5, 0.0, 0.0))
    run = nga.simulate(scene, q0, t_end=0.4, dt=1e-2)
    assert np.abs(run.q[:, 0] - carried_along(run.t, 0.3, 0.0, 0.5)).max() < 1e-9
    assert run.audit().ok
    assert balance(run).surfaces[-1] == pytest.approx(0.25, rel=1e-9)


def test_nothing_rests_on_a_moving_surface():
    scene, q0 = box_on_belt(mu=0.3, surface_velocity=(0.5, 0.0, 0.0))
    with pytest.raises(nga.SceneError, match="static equilibrium.*belt"):
        nga.static_equilibrium(scene, q0)


def test_run_with_a_moving_surface_is_saved_and_resumed(tmp_path):
    """Also with a speed that is a function: its values at the recorded times are in the file."""
    moving = nga.SurfaceVelocity(linear=(0.5, 0.0, 0.0), speed=lambda t: np.cos(5 * t))
    scene, q0 = box_on_belt(endless=True, mu=0.3, surface_velocity=moving)
    whole = nga.simulate(scene, q0, t_end=0.2, dt=1e-2)
    half = nga.simulate(scene, q0, t_end=0.1, dt=1e-2)
    rest = nga.simulate(scene, state=half.final_state, t_end=0.2, dt=1e-2)
    assert (rest.q[-1] == whole.q[-1]).all()
    whole.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    assert np.abs(loaded.contact_motion.gamma_F - whole.contact_motion.gamma_F).max() < 1e-12
    assert loaded.audit().ok
    assert np.abs(balance(loaded).surfaces - balance(whole).surfaces).max() < 1e-12
