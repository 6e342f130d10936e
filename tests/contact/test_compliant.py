"""Compliant contact: bounces with closed forms and against an ode, friction, derivatives, rest, vibration, files."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import pair_scene
from scipy.integrate import quad, solve_ivp

import ngalpha_pin as nga
from ngalpha_pin.contact.compliant import elastic_forces
from ngalpha_pin.system.system import System

G, MASS, RADIUS = 9.81, 2.0, 0.1
DASHPOT = nga.KelvinVoigt(2e4, 50.0)
HERTZ = nga.HuntCrossley(2e6)
HUNT_CROSSLEY = nga.HuntCrossley(2e6, 0.3)
LAWS = [nga.KelvinVoigt(2e4), DASHPOT, HERTZ, HUNT_CROSSLEY]


def ball(compliance, mu=0.0, gravity=True, joint=pin.JointModelTranslation):
    model = pin.Model()
    model.addJoint(0, joint(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(MASS, RADIUS), pin.SE3.Identity())
    model.addJointFrame(1)
    if not gravity:
        model.gravity.linear = np.zeros(3)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(RADIUS), parent="ball")
    scene.add_contact("ball", "ground", mu=mu, compliance=compliance)
    return scene


def falls(law, depth, rate, t_end):
    """Height above the plane and velocity of a bouncing ball, one solve_ivp from event to event."""
    t, y = 0.0, np.array([-depth, -rate])
    while t < t_end:
        flies = y[0] > 0.0 or (y[0] == 0.0 and y[1] > 0.0)

        def motion(t, y, flies=flies):
            force = 0.0 if flies else law(np.array([max(-y[0], 0.0)]), np.array([-y[1]]))[0][0]
            return [y[1], force / MASS - G]

        touches = lambda t, y: y[0]  # noqa: E731
        touches.terminal, touches.direction = True, -1.0 if flies else 1.0
        part = solve_ivp(motion, (t, t_end), y, "DOP853", events=touches, rtol=1e-10, atol=1e-12)
        t, y = part.t[-1], part.y[:, -1].copy()
        if part.status == 1:
            y[0] = 0.0
    return y


@pytest.mark.parametrize(
    "law", [DASHPOT, *(pytest.param(law, marks=pytest.mark.long) for law in (LAWS[0], HERTZ)), HUNT_CROSSLEY]
)
def test_bounce_against_an_ode(law):
    """Of second order with dt, in the mean over where in a step the contact begins; within the tolerance with rtol."""
    t_end = 0.04 if isinstance(law, nga.KelvinVoigt) else 0.018

    def error(height, **accuracy):
        run = nga.simulate(ball(law), [0.0, 0.0, RADIUS + height], [0.0, 0.0, -1.0], t_end=t_end, **accuracy)
        assert run.audit().ok, str(run.audit())
        assert run.audit().compliance < 1e-9 and run.audit().penetration == 0.0
        z, v = falls(law, -height, 1.0, t_end)
        return max(abs(run.q[-1, 2] - RADIUS - z), abs(run.v[-1, 2] - v))

    for rtol in (1e-4, 1e-6, 1e-8):
        assert error(0.002, rtol=rtol) < 10 * rtol
    steps, places = [45, 135], np.arange(3) / 3
    mean = [np.sqrt(np.mean([error(0.002 + t_end / n * s, dt=t_end / n) ** 2 for s in places])) for n in steps]
    assert np.log(mean[0] / mean[1]) / np.log(3.0) > 1.9


def bounce(law, speed=1.0, t_end=0.015):
    """A bounce without gravity: speed that is left, time in contact [s], largest force [N]."""
    run = nga.simulate(
        ball(law, gravity=False), np.array([0.0, 0.0, RADIUS + 1e-3]), np.array([0.0, 0.0, -speed]),
        t_end=t_end, rtol=1e-9, max_step=t_end / 50,
    )  # fmt: skip
    pressed = run.la_N[:, 0] > 0.0
    left = [event.t for event in run.events if event.kind == "lift-off"][-1]
    assert run.audit().ok
    return run.v[-1, 2], left - 1e-3 / speed, float(run.la_N[pressed].max())


def test_kelvin_voigt_closed_form():
    """It lets go where the damper would pull: e = exp(-zeta w t) with the phase of that moment."""
    k, c = DASHPOT.stiffness, DASHPOT.damping
    w0, zeta = np.sqrt(k / MASS), c / (2 * np.sqrt(k * MASS))
    w = w0 * np.sqrt(1 - zeta**2)
    until = (np.pi - np.arctan2(2 * zeta * np.sqrt(1 - zeta**2), 2 * zeta**2 - 1)) % np.pi
    t = next(x for x in (until / w, (np.pi - until) / w) if abs(_pull(x, k, c, w, w0 * zeta)) < 1e-6)
    left = abs(_velocity(t, w, w0 * zeta))
    e, _, _ = bounce(DASHPOT, t_end=0.04)
    assert e == pytest.approx(left, abs=1e-7)
    e, contact, force = bounce(nga.KelvinVoigt(k), t_end=0.04)
    assert (e, contact, force) == pytest.approx((1.0, np.pi / w0, np.sqrt(k * MASS)), rel=2e-3)


def _velocity(t, w, decay):
    return np.exp(-decay * t) * (np.cos(w * t) - decay / w * np.sin(w * t))


def _pull(t, k, c, w, decay):
    return k * np.exp(-decay * t) * np.sin(w * t) / w + c * _velocity(t, w, decay)


def test_hertz_contact_time_and_force_by_quadrature():
    k, n, speed = HERTZ.stiffness, HERTZ.exponent, 1.0
    deepest = ((n + 1) * MASS * speed**2 / (2 * k)) ** (1 / (n + 1))
    # d = deepest (1 - s^2) takes the root out of the integral
    half = quad(lambda s: 2 * s / np.sqrt(1 - (1 - s * s) ** (n + 1)), 0, 1)[0] * deepest / speed
    e, contact, force = bounce(HERTZ, speed)
    assert (e, contact) == pytest.approx((1.0, 2 * half), abs=1e-8)
    assert force == pytest.approx(k * deepest**n, rel=2e-2)


def test_hunt_crossley_restitution():
    """From d_dot d(d_dot)/dd = -k d^n (1 + c d_dot) / m: both speeds have one value of a closed integral."""
    e, _, _ = bounce(HUNT_CROSSLEY)
    c = HUNT_CROSSLEY.damping
    first, last = ((np.log1p(c * v) - c * v) for v in (1.0, -e))
    assert first == pytest.approx(last, rel=1e-7)


@pytest.mark.parametrize("side", [-0.01, 0.01])
@pytest.mark.parametrize("accuracy", [{"dt": 2e-3}, {"rtol": 1e-7}])
def test_sticks_below_mu_times_the_elastic_force(side, accuracy):
    scene = ball(DASHPOT, mu=0.4)
    scene.add_force(nga.Control(lambda t, q, v: np.array([0.4 * G * MASS * (1 + side), 0.0, 0.0])))
    q0 = np.array([0.0, 0.0, RADIUS - MASS * G / DASHPOT.stiffness])
    run = nga.simulate(scene, q0, t_end=0.2, **accuracy)
    assert run.q[-1, 0] == pytest.approx(
        0.5 * 0.4 * G * side * 0.2**2 if side > 0 else 0.0, abs=1e-14 + 1e-9 * (side > 0)
    )
    assert np.abs(run.q[-1, 2] - q0[2]) < 1e-10
    assert run.audit().ok


@pytest.mark.parametrize("accuracy", [{"dt": 4e-3}, {"rtol": 1e-4}, {"rtol": 1e-8}])
def test_slip_to_rest(accuracy):
    q0 = np.array([0.0, 0.0, RADIUS - MASS * G / DASHPOT.stiffness])
    run = nga.simulate(ball(DASHPOT, mu=0.4), q0, np.array([0.5, 0.2, 0.0]), t_end=0.2, **accuracy)
    assert np.hypot(*run.q[-1, :2]) == pytest.approx(0.29 / (2 * 0.4 * G), abs=1e-9)
    assert np.abs(run.v[-1]).max() < 1e-6 and run.audit().ok


def test_ball_with_spin_bounces_with_friction():
    """In space: order 2 against a run with rtol."""
    scene = ball(HUNT_CROSSLEY, 0.2, joint=pin.JointModelFreeFlyer)
    q0, v0 = np.array([0, 0, 0.11, 0, 0, 0, 1.0]), np.array([0.3, 0.1, -1.0, 0.0, 2.0, 1.0])
    exact = nga.simulate(scene, q0, v0, t_end=0.02, rtol=1e-8)
    runs = [nga.simulate(scene, q0, v0, t_end=0.02, dt=dt) for dt in (1e-3, 2.5e-4)]
    errors = [np.abs(run.v[-1] - exact.v[-1]).max() for run in runs]
    assert all(run.audit().ok for run in (exact, *runs))
    assert np.log(errors[0] / errors[1]) / np.log(4.0) > 1.8


@pytest.mark.parametrize("law", LAWS)
def test_derivatives_of_the_laws(law):
    rng = np.random.default_rng(0)
    for _ in range(20):
        d, r, h = rng.uniform(1e-4, 1e-2), rng.uniform(-2.0, 2.0), 1e-7
        at = lambda d, r: law(np.array([d]), np.array([r]))[0][0]  # noqa: E731
        _, by_d, by_r = law(np.array([d]), np.array([r]))
        assert by_d[0] == pytest.approx((at(d + h, r) - at(d - h, r)) / (2 * h), rel=1e-4, abs=1e-3)
        assert by_r[0] == pytest.approx((at(d, r + h) - at(d, r - h)) / (2 * h), rel=1e-4, abs=1e-3)
        assert at(d, r) >= 0.0


@pytest.mark.parametrize("pair", ["sphere-plane", "vertex-plane", "sphere-hollow cylinder"])
@pytest.mark.parametrize("arrangement", ["fixed", "moving"])
@pytest.mark.parametrize("mu, arm", [(0.3, 0.0), (nga.FrictionEllipse(0.2, 0.5), 0.05)])
def test_kinematics_of_friction_at_the_surface(pair, arrangement, mu, arm):
    """Rates by q and accelerations by v against differences, and the acceleration along a motion."""
    scene = pair_scene(pair, arrangement, mu=mu, contact_radius=0.1, compliance=DASHPOT, rolling_resistance=arm)
    rng, model, system = np.random.default_rng(0), scene.model, System(scene)
    sub, h = system.contacts.subset(np.arange(system.contacts.n)), 1e-6
    q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
    v, a = rng.normal(size=(2, model.nv))

    def rows(q, v):
        system.dynamics(0.0, q, v, a)
        return system.contact_rows(sub, q, v, a)

    here = rows(q, v)
    X, Y = system.row_derivatives([here], v, a)
    acceleration = here.acceleration.copy()
    ahead, back = (rows(pin.integrate(model, q, t * v + 0.5 * t * t * a), v + t * a).rate.copy() for t in (h, -h))
    assert acceleration == pytest.approx((ahead - back) / (2 * h), abs=1e-7)
    for i, e in enumerate(np.eye(model.nv)):
        ends = [rows(pin.integrate(model, q, s * h * e), v).rate.copy() for s in (1, -1)]
        assert X[:, i] == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-7)
        ends = [rows(q, v + s * h * e).acceleration.copy() for s in (1, -1)]
        assert Y[:, i] == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-7)


@pytest.mark.parametrize("law", [DASHPOT, HUNT_CROSSLEY])
def test_rests_and_vibrates(law):
    scene = ball(law, mu=0.3)
    scene.add_force(nga.Control(lambda t, q, v: np.array([2.0, 0.0, 0.0])))
    found = nga.static_equilibrium(scene, np.array([0.0, 0.0, RADIUS]))
    depth = np.array([RADIUS - found.q[2]])
    force, stiffness, _ = law(depth, np.zeros(1))
    assert found.la_N == pytest.approx(force)
    assert found.la_N == pytest.approx([MASS * G])
    assert found.la_F == pytest.approx([-2.0, 0.0]) and found.stable
    frequencies = nga.eigenmodes(scene, np.array([0.0, 0.0, RADIUS])).frequencies
    assert frequencies == pytest.approx(np.sqrt(stiffness / MASS) / (2 * np.pi))
    run = nga.simulate(scene, found.q, t_end=0.05, dt=5e-3)
    assert np.abs(run.q - found.q).max() < 1e-10


def test_saved_and_resumed(tmp_path):
    scene, q0, v0 = ball(HUNT_CROSSLEY, 0.2), np.array([0.0, 0.0, RADIUS + 1e-3]), np.array([0.2, 0.0, -1.0])
    whole = nga.simulate(scene, q0, v0, t_end=0.012, dt=5e-4)
    first = nga.simulate(scene, q0, v0, t_end=0.006, dt=5e-4)
    first.save(tmp_path / "first.npz")
    loaded = nga.Trajectory.load(tmp_path / "first.npz")
    assert loaded.scene.contacts == scene.contacts
    assert loaded.audit().ok
    rest = nga.simulate(scene, state=first.final_state, t_end=0.012, dt=5e-4)
    assert rest.q[-1] == pytest.approx(whole.q[-1], abs=1e-14)


def test_what_is_stored_and_lost():
    """Energy of the account: all of it comes back from Hertz, and what a damper takes is the work of normal forces."""
    for law, lost in ((HERTZ, 0.0), (HUNT_CROSSLEY, None)):
        q0 = np.array([0.0, 0.0, RADIUS + 1e-3])
        run = nga.simulate(ball(law, gravity=False), q0, np.array([0.0, 0.0, -1.0]), t_end=0.018, dt=2e-4)
        energy = run.energy
        assert energy.elastic.max() > 0.6 * 0.5 * MASS
        left = 0.5 * MASS * run.v[-1, 2] ** 2
        assert energy.total[-1] == pytest.approx(left, abs=1e-9)
        if lost is not None:
            assert left == pytest.approx(0.5 * MASS, abs=1e-3)


def test_rigid_and_compliant_contacts_of_one_scene():
    """A ball falls on another one that rests on a rigid plane; the force between them is that of the law."""
    scene = nga.Scene()
    scene.add_plane("ground")
    for name, z in (("lower", 0.1), ("upper", 0.31)):
        scene.add_body(name, coal.Sphere(0.1), mass=1.0, placement=pin.SE3(np.eye(3), np.array([0.0, 0.0, z])))
    scene.add_contact("lower", "ground", mu=0.3)
    scene.add_contact("upper", "lower", mu=0.3, compliance=HUNT_CROSSLEY)
    run = nga.simulate(scene, scene.q_ref, t_end=0.1, dt=5e-4)
    assert run.audit().ok, str(run.audit())
    column = run.contact_names.index("upper/lower")
    assert run.la_N[:, column].max() > 100.0
    assert np.abs(run.q[:, 2]).max() < 1e-9


def test_forces_of_open_contacts_are_none():
    system = System(ball(DASHPOT))
    sub = system.contacts.subset(np.arange(1))
    assert not np.any(elastic_forces(sub, np.array([1e-9]), np.array([-1.0])))


@pytest.mark.parametrize(
    "law, said",
    [
        (lambda: nga.KelvinVoigt(0.0), "KelvinVoigt: stiffness"),
        (lambda: nga.KelvinVoigt(1e4, -1.0), "KelvinVoigt: damping"),
        (lambda: nga.HuntCrossley(1e4, exponent=0.5), "HuntCrossley: exponent"),
        (lambda: nga.HuntCrossley.of_spheres(-0.1, 1e9), "HuntCrossley: radius"),
        (lambda: ball(1e4), "compliance"),
        (
            lambda: nga.simulate(ball(DASHPOT), np.array([0, 0, 0.2]), t_end=1, dt=0.1, method=nga.MoreauJean()),
            "Moreau",
        ),
    ],
)
def test_what_is_refused(law, said):
    with pytest.raises(nga.SceneError, match=said):
        law()


@pytest.mark.parametrize("name", ["e_N", "adhesion"])
def test_laws_that_do_not_go_together(name):
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    with pytest.raises(nga.SceneError, match=f"takes no {name}"):
        scene.add_contact("ball", "ground", compliance=DASHPOT, **{name: 0.5})


def test_shapes_without_a_fixed_point_are_refused():
    scene = nga.Scene()
    for name in ("a", "b"):
        scene.add_body(name, coal.Box(0.1, 0.1, 0.1), mass=1.0)
    scene.add_contact("a", "b", compliance=DASHPOT)
    with pytest.raises(nga.SceneError, match="leave the compliance out"):
        System(scene)
