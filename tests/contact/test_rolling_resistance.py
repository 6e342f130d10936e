"""Rolling resistance: kinematics and laws against differences, balls and wheels against closed forms."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import PAIRS, all_rows, pair_scene, random_state
from motions import along, carried, central, same, surface_pose
from scipy.integrate import solve_ivp

import ngalpha_pin as nga
from ngalpha_pin import oracle
from ngalpha_pin.contact.laws import ContactResidual
from ngalpha_pin.numerics.gauss_seidel import solve_contact_problem, violation
from ngalpha_pin.results.energy_balance import balance
from ngalpha_pin.system.system import System

G, R, ARM = 9.81, 0.1, 1e-2
INERTIA = 0.4 * R**2  # of a solid ball, for a kilogram
SLOWS = G * ARM / R / (1 + INERTIA / R**2)  # deceleration of a ball that rolls
LAW = {"mu": 0.4, "contact_radius": 0.2, "rolling_resistance": 0.05}
T = 0.4


def speed(t):
    """A factor and its rate."""
    return 1.0 + 0.5 * np.sin(3 * t), 1.5 * np.cos(3 * t)


MOVING = nga.SurfaceVelocity((0.7, -0.4, 0.3), (0.5, 0.8, -1.1), (0.2, -0.1, 0.3), speed)


def planar_ball(slope=0.0, mu=0.5, arm=ARM, height=0.0, shape=None, **law):
    """A ball of 1 kg in the plane of x and z on a slope that falls towards +x; q = (x, z, angle), x along the slope."""
    model, tilt = pin.Model(), pin.SE3(pin.utils.rotate("y", slope), np.zeros(3))
    first = model.addJoint(0, pin.JointModelPX(), tilt, "x")
    second = model.addJoint(first, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    ball = model.addJoint(second, pin.JointModelRY(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(ball, pin.Inertia(1.0, np.zeros(3), INERTIA * np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(ball)
    scene = nga.Scene(model)
    scene.add_plane("ground", normal=tilt.rotation[:, 2])
    scene.add_geometry("ball", shape or coal.Sphere(R), parent="ball")
    scene.add_contact("ball", "ground", mu=mu, rolling_resistance=arm, **law)
    return scene, np.array([0.0, R + height, 0.0])


def free_ball(**law):
    """The same ball in space on a level plane."""
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("ball", coal.Sphere(R), mass=1.0, placement=pin.SE3(np.eye(3), np.array([0.0, 0.0, R])))
    scene.add_contact("ball", "ground", **{"mu": 0.5, "rolling_resistance": ARM, **law})
    return scene


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("arrangement", ["moving", "humanoid"])
def test_kinematics(pair, arrangement):
    scene = pair_scene(pair, arrangement)
    scene.contacts.clear()
    scene.add_contact("b", "a", **LAW, surface_velocity=MOVING)
    system = System(scene)
    q, v, a = random_state(system.model, 1)
    rows, k = all_rows(system, q, v, a, T), system.contacts.n_points
    at, every = (rows, surface_pose(system, q)), np.eye(system.model.nv)
    # the rate is that of the bodies about the tangents, with what the surface turns
    omega = np.array([rows.rate[k + 3 + 5 * i : k + 5 + 5 * i] for i in range(k)]) / system.contacts.lever[:, None]
    tangents = rows.directions[k:].reshape(k, 5, 3)[:, :2]
    pin.forwardKinematics(system.model, system.data, q, v)
    joints = [int(scene.geometry(name).parentJoint) for name in "ab"]
    turn_a, turn_b = (system.data.oMi[j].rotation @ system.data.v[j].angular for j in joints)
    material = (surface_pose(system, q) * scene.geometry("a").placement).rotation @ MOVING.angular
    assert np.abs(omega - tangents @ (turn_b - turn_a - speed(T)[0] * material)).max() < 1e-12
    X, Y = rows.derivatives(system.motion(v, a, T))
    found = central(lambda s: carried(system, *along(system.model, q, v, a, s), at, t=T + s))
    by_q = [central(lambda s, e=e: carried(system, pin.integrate(system.model, q, s * e), v, at, t=T)) for e in every]
    by_v = [central(lambda s, e=e: all_rows(system, q, v + s * e, a, T).acceleration) for e in every]
    assert same(rows.acceleration, found)
    assert same(X, np.array(by_q).T) and same(Y, np.array(by_v).T)


def stopping_distance(v):
    """Of a ball that rolls with a velocity."""
    return v**2 / (2 * SLOWS)


@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-4}, {"rtol": 1e-8}])
def test_ball_comes_to_rest(accuracy):
    """In finite time, without creep, and with all of its energy in the account."""
    scene, q0 = planar_ball()
    run = nga.simulate(scene, q0, np.array([0.3, 0.0, 3.0]), t_end=0.6, **accuracy)
    assert run.q[-1, 0] == pytest.approx(stopping_distance(0.3), abs=1e-9 if "dt" in accuracy else accuracy["rtol"])
    rests = run.t > 0.3 / SLOWS + accuracy.get("dt", 0.0)
    assert np.abs(run.v[rests]).max() < 1e-14 and np.ptp(run.q[rests], axis=0).max() < 1e-13
    (event,) = run.events
    assert event.kind == "rest" and event.t == pytest.approx(0.3 / SLOWS, abs=accuracy.get("dt", accuracy.get("rtol")))
    assert run.audit().ok
    account = balance(run)
    assert account.friction[-1] == pytest.approx(-0.5 * 1.4 * 0.3**2, abs=1e-6)


def test_ball_in_space_comes_to_rest():
    """Of second order through the end; its configuration turns, so that steps are not exact."""
    scene, v0, errors = free_ball(), np.array([0.06, 0.08, 0.0, -0.8, 0.6, 0.0]), []
    for dt in (1e-2, 1e-3):
        run = nga.simulate(scene, scene.q_ref, v0, t_end=0.16, dt=dt)
        errors.append(np.linalg.norm(run.q[-1, :2] - stopping_distance(0.1) * np.array([0.6, 0.8])))
        assert np.abs(run.v[-1]).max() < 1e-13 and run.audit().ok
    assert np.log10(errors[0] / errors[1]) > 1.9 and errors[1] < 1e-6
    for rtol in (1e-4, 1e-6, 1e-8):
        run = nga.simulate(scene, scene.q_ref, v0, t_end=0.16, rtol=rtol)
        assert np.linalg.norm(run.q[-1, :2] - stopping_distance(0.1) * np.array([0.6, 0.8])) < rtol


@pytest.mark.parametrize("side", [-0.01, 0.01])
@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"dt": 2e-3}, {"rtol": 1e-6}])
def test_angle_of_rolling_resistance(side, accuracy):
    slope = np.arctan(ARM / R * (1 + side))
    scene, q0 = planar_ball(slope)
    run = nga.simulate(scene, q0, t_end=0.2, **accuracy)
    a = max(0.0, G * (np.sin(slope) - np.cos(slope) * ARM / R) / 1.4)
    assert run.q[-1] == pytest.approx([a / 50, R, a / 50 / R], abs=1e-12)
    assert (np.abs(run.v).max() < 1e-14) == (side < 0.0)
    assert run.audit().ok


def skids(y, arm=ARM, mu=0.5):
    """Accelerations of a ball in space, from its velocity and angular velocity, while it slips."""
    v, omega = y[2:5], y[5:8]
    slip = v + np.cross(omega, [0.0, 0.0, -R])
    force = -mu * G * slip / max(np.linalg.norm(slip), 1e-300)
    about = omega * [1.0, 1.0, 0.0]
    moment = np.cross([0.0, 0.0, -R], force) - arm * G * about / max(np.linalg.norm(about), 1e-300)
    return np.concatenate((v[:2], force, moment / INERTIA))


@pytest.mark.parametrize("rtols", [(1e-4,), pytest.param((1e-6, 1e-8), marks=pytest.mark.long)])
def test_skid_that_turns_into_rolling(rtols):
    """Slip, rolling and rest in space, against solve_ivp."""
    v0, omega0, scene = np.array([0.2, 0.05, 0.0]), np.array([-0.75, 0.5, 1.0]), free_ball()
    stop = lambda t, y: np.linalg.norm(y[2:5] + np.cross(y[5:8], [0.0, 0.0, -R])) - 1e-10  # noqa: E731
    stop.terminal = True
    y0 = np.concatenate(([0.0, 0.0], v0, omega0))
    slips = solve_ivp(lambda t, y: skids(y), (0, 1), y0, "Radau", events=stop, rtol=1e-11, atol=1e-13)
    x, v = slips.y[:2, -1], slips.y[2:4, -1]
    rolls = np.linalg.norm(v)
    exact, errors = x + v / rolls * stopping_distance(rolls), []
    t_end = slips.t[-1] + rolls / SLOWS + 0.05
    for accuracy in ({"dt": 1e-2}, {"dt": 1e-3}, *({"rtol": rtol} for rtol in rtols)):
        run = nga.simulate(scene, scene.q_ref, np.concatenate((v0, omega0)), t_end=t_end, **accuracy)
        errors.append(np.linalg.norm(run.q[-1, :2] - exact))
        # on its last way the slip turns into the direction of what the rolling resistance does
        assert run.audit().ok and [event.kind for event in run.events if event.kind != "slip"] == ["stick", "rest"]
        if "rtol" in accuracy:
            assert errors.pop() < 10 * accuracy["rtol"]
    assert np.log10(errors[0] / errors[1]) > 1.9


@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"dt": 2e-3}, {"rtol": 1e-6}])
def test_spin_stops_in_finite_time(accuracy):
    """Drilling has a cone of its own with slip: it slows a ball down that spins on the spot."""
    scene, radius, spin = free_ball(contact_radius=0.02), 0.02, 5.0
    slows = 3 * np.pi / 16 * radius * 0.5 * G / INERTIA
    run = nga.simulate(scene, scene.q_ref, np.array([0, 0, 0, 0, 0, spin]), t_end=1.1 * spin / slows, **accuracy)
    angle = pin.log3(pin.Quaternion(run.q[-1, 3:7]).matrix())[2]
    assert angle == pytest.approx(spin**2 / 2 / slows, abs=1e-9 if "dt" in accuracy else 1e-6)
    assert np.abs(run.v[-1]).max() < 1e-13 and [event.kind for event in run.events] == ["stick"]
    assert run.audit().ok


@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-8}])
@pytest.mark.parametrize("omega", [3.0, 0.02])
@pytest.mark.parametrize("law", ["newton", "poisson", "stronge"])
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_percussions_obey_the_same_cone(accuracy, omega, law, e):
    """A rolling ball falls: the percussion brakes its rolling by its arm, or stops it."""
    scene, q0 = planar_ball(height=0.05, e_N=nga.Restitution(e, law))
    fall = np.sqrt(2 * G * 0.05)
    run = nga.simulate(scene, q0, np.array([R * omega, 0.0, omega]), t_end=fall / G + 0.05, **accuracy)
    after = max(0.0, omega - (1 + e) * fall * ARM / (INERTIA + R**2))
    assert run.impacts.v_after[0] == pytest.approx([R * after, e * fall, after], abs=1e-9)
    assert run.audit().ok


@pytest.mark.parametrize("law", ["newton", "poisson", "stronge"])
def test_percussion_of_slip_and_of_rolling_at_both_bounds(law):
    """A ball lands with slip while it turns: friction and resistance are both as large as they can be."""
    e, v, omega, fall = 0.5, 2.0, -10.0, np.sqrt(2 * G * 0.05)
    scene, q0 = planar_ball(mu=0.1, arm=0.008, height=0.05, e_N=nga.Restitution(e, law))
    run = nga.simulate(scene, q0, np.array([v, 0.0, omega]), t_end=fall / G + 0.02, dt=1e-2)
    P = (1 + e) * fall
    assert run.impacts.v_after[0] == pytest.approx(
        [v - 0.1 * P, e * fall, omega + (0.1 * R + 0.008) * P / INERTIA], abs=1e-9
    )
    assert run.audit().ok, str(run.audit())


def test_rolling_that_turns_back():
    """Backspin on a plane: the ball slips, turns back, rolls and rests; all moments in closed form."""
    (scene, q0), mu = planar_ball(mu=0.2), 0.2
    v, omega = 0.2, -4.0
    # the friction of slip turns the ball forward, with rolling resistance along until it turns, then against it
    up = (mu * R + ARM) * G / INERTIA
    t1, down = -omega / up, (mu * R - ARM) * G / INERTIA
    t2 = (v - mu * G * t1) / (mu * G + R * down)
    v2 = v - mu * G * (t1 + t2)
    exact, errors = v * (t1 + t2) - mu * G * (t1 + t2) ** 2 / 2 + stopping_distance(v2), []
    assert v2 > 0.0
    for accuracy in ({"dt": 1e-2}, {"dt": 2e-3}, {"rtol": 1e-8}):
        run = nga.simulate(scene, q0, np.array([v, 0.0, omega]), t_end=t1 + t2 + v2 / SLOWS + 0.05, **accuracy)
        errors.append(abs(run.q[-1, 0] - exact))
        assert run.audit().ok
        assert [event.kind for event in run.events] == ["roll", "stick", "rest"]
    assert max(errors) < 1e-8


def test_derivatives_of_the_laws():
    """Dense and by entries, against differences, where slip and rolling each stick or not, at random iterates."""
    scene = free_ball(contact_radius=0.02)
    sub, rng = System(scene).contacts.subset(np.arange(1)), np.random.default_rng(0)
    k, m, n = 1, 5, 13
    gamma_c, beta_c, seen = 0.004, 1e-5, set()
    for i in range(32):
        y, x, r = rng.normal(size=n), rng.normal(size=n), np.full(n, 1e3)
        y[[0, 1, 7]], x[[0, 1, 7]] = -1.0, 1.0 + np.abs(x[[0, 1, 7]])  # closed
        for cone, rows in enumerate((np.arange(2, 5), np.arange(5, 7))):
            rows = np.concatenate((rows, rows + 6)) if i >> cone + 3 & 1 else rows
            if i >> cone & 1:  # sticks, to the velocity or to the acceleration
                y[rows], x[rows] = 1e-5 * y[rows], 1e-3 * x[rows]
        A = rng.normal(size=(n, n))

        def residual(x, y, r=r, whole=bool(i & 4)):
            z = x.copy()
            z[:k] += beta_c * x[k + k + m : k + k + m + k]
            z[k : 2 * k + m] += gamma_c * x[2 * k + m :]
            return ContactResidual(sub, y, z, x[k : 2 * k + m], y[2 * k : 2 * k + m], r, whole)

        here, Dz = residual(x, y), np.eye(n, n + 1)
        Dz[0, 7] = beta_c
        Dz[np.arange(1, 7), np.arange(7, 13)] = gamma_c
        seen.add((*here.stick.tolist(), *here.stick_a.tolist()))
        J = here.jacobian(np.column_stack((A, np.zeros(n))), Dz)[:, :n]
        h = 1e-8
        moved = np.array([[residual(x + s * e, y + s * A @ e).R for s in (h, -h)] for e in np.eye(n)])
        found = (moved[:, 0] - moved[:, 1]).T / (2 * h)
        assert np.abs(J - found).max() < 1e-5
        dense = np.zeros((2, n, n))
        for place, (values, at) in zip(dense, here.derivatives(gamma_c, np.full(here.sub.k, beta_c)), strict=True):
            np.add.at(place, at, values)
        assert np.abs(dense[0] @ A + dense[1] - J).max() < 1e-9 * np.abs(J).max()
    assert len(seen) == 9  # three states of each cone


def test_contact_problems_with_two_cones():
    """Random problems of several contacts, some of which roll: both laws, by sweeps and Newton's method."""
    rng = np.random.default_rng(3)
    for k in (1, 4, 9):
        kinds = [[0, 0, 0, 1, 1] if i % 2 == 0 else [0, 0] for i in range(k)]
        rolls = [i for i in range(k) if i % 2 == 0]
        of_F = np.array([k + rolls.index(i) if kind else i for i, own in enumerate(kinds) for kind in own])
        of_cone, mu = np.concatenate((np.arange(k), rolls)), rng.uniform(0.05, 0.4, k + len(rolls))
        n = k + len(of_F)
        W = rng.normal(size=(n, n + 3))
        G, b = W @ W.T, rng.normal(size=n) - np.where(np.arange(n) < k, 2.0, 0.0)
        P, converged, _ = solve_contact_problem(G, b, mu, of_F, np.zeros(n), of_cone=of_cone)
        assert converged and violation(G, b, mu, of_F, P, of_cone=of_cone) < 1e-9
        size = np.sqrt(np.bincount(of_F, P[k:] ** 2, len(mu)))
        assert (size <= mu * P[:k][of_cone] * (1 + 1e-9)).all() and (size[k:] > 0.0).any()


def test_wheel_on_two_rims():
    """A cylinder rolls on a line: two points share its weight and its rolling resistance."""
    scene = nga.Scene()
    scene.add_plane("ground")
    lies = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.array([0.0, 0.0, R]))
    scene.add_body("wheel", coal.Cylinder(R, 0.06), mass=1.0, placement=lies)
    scene.add_contact("wheel", "ground", mu=0.5, rolling_resistance=ARM)
    slows = G * ARM / R / 1.5
    run = nga.simulate(scene, scene.q_ref, np.array([0.2, 0, 0, 0, 0, -2.0]), t_end=0.2 / slows + 0.05, dt=5e-3)
    assert np.linalg.norm(run.q[-1, :2] - run.q[0, :2]) == pytest.approx(0.2**2 / 2 / slows, abs=1e-5)
    assert np.abs(run.v[-1]).max() < 1e-12 and run.audit().ok


@pytest.mark.parametrize("arm", [2e-3, 1e-2])
def test_box_that_slides_on_a_face_neither_rolls_nor_turns(arm):
    """Its corners could share moments that cancel or shift its weight sideways; the smallest are none."""
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("box", coal.Box(0.2, 0.2, 0.15), mass=1.9)
    scene.add_contact("box", "ground", mu=0.5, rolling_resistance=arm)
    q0 = scene.place_on("ground", scene.q_ref)
    run = nga.simulate(scene, q0, np.eye(1, 6)[0] * 0.5, t_end=0.15, dt=1e-2)
    assert run.q[-1, 0] == pytest.approx(0.5**2 / (2 * 0.5 * G), abs=1e-8)
    assert np.abs(run.q[:, [1, 3, 4, 5]]).max() < 1e-9 and np.abs(run.v[-1]).max() < 1e-12
    assert run.audit().ok, str(run.audit())


def test_box_that_slides_and_turns_moves_as_without_rolling_resistance():
    """But for how its corners share the load, which no law says."""
    runs = []
    for law in ({}, {"rolling_resistance": 2e-3}):
        scene = nga.Scene()
        scene.add_plane("ground")
        scene.add_body("box", coal.Box(0.2, 0.2, 0.15), mass=1.9)
        scene.add_contact("box", "ground", mu=0.69, **law)
        v0 = np.array([-0.668, -0.707, 0.0, 0.0, 0.0, 2.838])
        runs.append(nga.simulate(scene, scene.place_on("ground", scene.q_ref), v0, t_end=0.2, dt=1e-2))
        assert runs[-1].audit().ok and np.abs(runs[-1].v[-1]).max() < 1e-12
    assert np.abs(runs[0].q - runs[1].q).max() < 1e-5
    assert runs[1].n_iter.max() <= 20


def coin(slope=0.0):
    """A cylinder in space that stands on its rim, and the velocity with which it rolls along x of the world."""
    scene, turned = nga.Scene(), pin.utils.rotate("x", np.pi / 2)
    scene.add_plane("ground")
    scene.model.gravity.linear = G * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    scene.add_body("coin", coal.Cylinder(R, 0.03), mass=1.0, placement=pin.SE3(turned, np.array([0.0, 0.0, R])))
    scene.add_contact("coin", "ground", mu=0.5, rolling_resistance=ARM)
    return scene, np.concatenate((turned.T @ [0.1, 0.0, 0.0], turned.T @ [0.0, 0.1 / R, 0.0]))


def test_coin_stops():
    """Both ends of its line of contact share the resistance."""
    scene, v0 = coin()
    for accuracy in ({"dt": 2e-2}, {"dt": 1e-2}, {"rtol": 1e-6}):
        run = nga.simulate(scene, scene.q_ref, v0, t_end=0.18, **accuracy)
        assert run.q[-1, 0] == pytest.approx(0.75 * 0.1**2 * R / (G * ARM), abs=1e-6 if "dt" in accuracy else 1e-8)
        assert np.abs(run.v[-1]).max() < 1e-14
        assert run.audit().ok, str(run.audit())


@pytest.mark.parametrize("side", [-0.01, 0.01])
def test_coin_on_a_slope(side):
    slope = np.arctan((1 + side) * ARM / R)
    scene, _ = coin(slope)
    run = nga.simulate(scene, scene.q_ref, t_end=0.1, dt=1e-2)
    a = G * (np.sin(slope) - ARM / R * np.cos(slope)) / 1.5
    assert run.q[-1, 0] == pytest.approx(max(0.5 * a * 0.1**2, 0.0), abs=1e-12 if side < 0 else 1e-8)


@pytest.mark.parametrize("method", [nga.MoreauJean(), nga.GeneralizedAlpha(laws="paper")])
@pytest.mark.parametrize("law", ["newton", "stronge"])
def test_other_methods(method, law):
    scene, q0 = planar_ball(e_N=nga.Restitution(0.5, law))
    run = nga.simulate(scene, q0, np.array([0.3, 0.0, 3.0]), t_end=0.5, dt=2e-3, method=method)
    assert run.q[-1, 0] == pytest.approx(stopping_distance(0.3), abs=1e-3)
    assert np.abs(run.v[-1]).max() < 1e-12 and run.audit().ok


def test_declaration_files_and_events(tmp_path):
    for bad in (-1e-3, np.nan, "soft"):
        with pytest.raises(nga.SceneError, match="rolling_resistance"):
            planar_ball(arm=bad)
    scene, q0 = planar_ball()
    v0 = np.array([0.3, 0.0, 3.0])
    with pytest.raises(nga.SceneError, match="rolling resistance"):
        oracle.simulate(scene, q0, v0, t_end=0.1, dt=1e-2)
    whole = nga.simulate(scene, q0, v0, t_end=0.5, dt=1e-2)
    first = nga.simulate(scene, q0, v0, t_end=0.2, dt=1e-2)
    first.save(tmp_path / "run.npz")
    loaded = nga.Trajectory.load(tmp_path / "run.npz")
    assert loaded.scene.contacts[0].law.rolling_resistance == ARM and loaded.audit().ok
    rest = nga.simulate(loaded.scene, state=loaded.final_state, t_end=0.5, dt=1e-2)
    np.testing.assert_array_equal(rest.q[-1], whole.q[-1])
    assert [event.kind for event in whole.pair_events] == ["rests"]
    # what the contact does to the ball: its weight, the force that slows it down, and the moment about its point
    wrench = whole.contact_force("ball/ground").about(whole.contact_point("ball/ground"))
    assert wrench.force[10] == pytest.approx([-SLOWS, 0.0, G], abs=1e-9)
    assert wrench.moment[10] == pytest.approx([0.0, -ARM * G, 0.0], abs=1e-9)


def test_static_equilibrium_says_what_rolls():
    for side in (-0.01, 0.01):
        scene, q0 = planar_ball(np.arctan(ARM / R * (1 + side)))
        if side < 0.0:
            assert nga.static_equilibrium(scene, q0).q == pytest.approx(q0)
        else:
            with pytest.raises(nga.SceneError, match="would roll"):
                nga.static_equilibrium(scene, q0)
