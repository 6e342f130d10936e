"""Own unilateral constraints: against contacts of shapes, closed forms and time, in both modes."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import ngalpha_pin as nga
from ngalpha_pin.system.system import System

G = 9.81


def particle():
    """A mass of 1 kg that moves without turning."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "particle")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(joint)
    return nga.Scene(model)


def on_floor(mu=0.0, e_N=0.0):
    scene = particle()
    slip = (lambda t, q, v: v[:2]) if mu else None
    scene.add_unilateral(nga.UnilateralConstraint(lambda t, q: q[2] - 0.1, e_N, mu, slip, name="floor"))
    return scene


def on_plane(mu=0.0, e_N=0.0):
    scene = particle()
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="particle")
    scene.add_contact("ball", "ground", mu=mu, e_N=e_N)
    return scene


@pytest.mark.parametrize("how", [{"dt": 1e-2}, {"rtol": 1e-8, "t_eval": [0.1, 0.18, 0.25]}], ids=("dt", "rtol"))
@pytest.mark.parametrize("mu, e_N", [(0.0, 0.5), (0.3, 0.0)])
def test_it_is_the_contact_of_a_ball_with_the_ground(mu, e_N, how):
    q0, v0 = [0.0, 0.0, 0.2], [0.4, -0.1, 0.0]
    own, shape = (nga.simulate(make(mu, e_N), q0, v0, t_end=0.25, **how) for make in (on_floor, on_plane))
    assert own.q[:, :3] == pytest.approx(shape.q, abs=1e-7)
    assert own.v[:, :3] == pytest.approx(shape.v, abs=1e-6)
    assert [event.kind for event in own.events] == [event.kind for event in shape.events]
    assert own.q[:, -1] == pytest.approx(own.t, abs=1e-12)  # the clock
    assert own.audit().ok, str(own.audit())


def test_a_ball_in_a_bowl_of_a_function():
    """On a paraboloid: at rest at its bottom, and a force along the gradient where it is pushed off it."""
    scene = particle()
    scene.add_unilateral(nga.UnilateralConstraint(lambda t, q: q[2] - 0.5 * (q[0] ** 2 + q[1] ** 2), name="bowl"))
    run = nga.simulate(scene, [0.4, 0.0, 0.08], t_end=0.6, dt=1.5e-2)
    energy = 0.5 * (run.v[:, :3] ** 2).sum(axis=1) + G * run.q[:, 2]
    assert energy == pytest.approx(energy[0], abs=4e-3)
    assert np.abs(run.g_N).max() < 1e-9 and (run.la_N[1:] > 0.0).all()
    assert run.q[-1, 0] < 0.0  # a quarter of a small swing takes pi / 2 / sqrt(g) = 0.5 s
    assert run.audit().ok, str(run.audit())


@pytest.mark.parametrize("how", [{"dt": 4e-3}, {"rtol": 1e-9}], ids=("dt", "rtol"))
def test_a_floor_that_moves_throws(how):
    """z >= A sin(w t): the mass leaves where the floor falls away faster than it, at A w^2 sin(w t) = g."""
    A, w = 0.05, 20.0
    scene = particle()
    scene.add_unilateral(nga.UnilateralConstraint(lambda t, q: q[2] - A * np.sin(w * t), name="floor"))
    run = nga.simulate(scene, [0.0, 0.0, 0.0], [0.0, 0.0, A * w], t_end=0.1, **how)
    leaves = np.arcsin(G / (A * w * w)) / w
    times = [event.t for event in run.events if event.kind == "lift-off"]
    assert times[0] == pytest.approx(leaves, abs=8e-3 if "dt" in how else 1e-6)
    s = 0.1 - leaves
    flight = A * np.sin(w * leaves) + A * w * np.cos(w * leaves) * s - 0.5 * G * s * s
    assert run.q[-1, 2] == pytest.approx(flight, abs=2e-4 if "dt" in how else 1e-7)
    assert run.g_N.min() > -1e-9


def slope(x):
    """Of the wall z = 0.3 x^2 - x / 2."""
    return 0.6 * x - 0.5


def along_wall():
    """A mass that slides with friction along the wall."""
    scene = particle()
    gap = lambda t, q: (q[2] - 0.3 * q[0] ** 2 + 0.5 * q[0]) / np.hypot(1.0, slope(q[0]))  # noqa: E731
    slip = lambda t, q, v: np.array([(v[0] + slope(q[0]) * v[2]) / np.hypot(1.0, slope(q[0])), v[1]])  # noqa: E731
    scene.add_unilateral(nga.UnilateralConstraint(gap, 0.0, 0.2, slip, name="wall"))
    return scene


def slides_along_wall(t, y):
    """Rates of (x, y) and their velocities."""
    s, length = slope(y[0]), np.hypot(1.0, slope(y[0]))
    presses = (G + 0.6 * y[2] ** 2) / length
    slip = np.array([length * y[2], y[3]])
    friction = -0.2 * presses * slip / np.linalg.norm(slip)
    return y[2], y[3], friction[0] / length - presses * s / length, friction[1]


@pytest.mark.parametrize("rtols", [(1e-4,), pytest.param((1e-6, 1e-8), marks=pytest.mark.long)])
def test_order_two_along_a_curved_wall(rtols):
    """Against an ode of the two coordinates that the wall leaves; within ten times the tolerance with rtol."""
    t_end, errors = 0.1, []
    exact = solve_ivp(slides_along_wall, (0, t_end), [0.0, 0.0, 1.0, 0.2], "DOP853", rtol=1e-12, atol=1e-13).y[:2, -1]
    for accuracy in ({"dt": 1e-2}, {"dt": 1e-3}, *({"rtol": rtol} for rtol in rtols)):
        run = nga.simulate(along_wall(), [0.0, 0.0, 0.0], [1.0, 0.2, -0.5], t_end=t_end, **accuracy)
        errors.append(np.abs(run.q[-1, :2] - exact).max())
        if "rtol" in accuracy:
            assert errors.pop() < 10 * accuracy["rtol"]
    assert run.audit().ok, str(run.audit())
    assert np.log10(errors[0] / errors[1]) > 1.9


@pytest.mark.parametrize("side", [-0.01, 0.01])
@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-6}])
@pytest.mark.parametrize("along, mu", [(0, 0.3), (2, 1.0)])
def test_both_sides_of_slip_and_of_lift_off(along, mu, side, accuracy):
    """A load along the floor of mu m g, and one upwards of m g, each +- 1 %."""
    scene, load = on_floor(mu), np.zeros(3)
    load[along] = mu * G * (1 + side)
    scene.add_force(nga.Control(lambda t, q, v: load))
    run = nga.simulate(scene, [0.0, 0.0, 0.1], t_end=0.05, **accuracy)
    moved = run.q[-1, :3] - [0.0, 0.0, 0.1]
    assert moved[along] == pytest.approx(max(0.0, side) * mu * G * 0.05**2 / 2, abs=1e-9)
    assert run.audit().ok, str(run.audit())


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_of_its_rows(seed):
    """Accelerations along a motion, rates by q and accelerations by v, against differences at random states."""
    system, rng, h = System(along_wall()), np.random.default_rng(seed), 1e-5
    sub, n = system.contacts.subset(np.arange(1)), system.model.nv
    q, v, a = rng.normal(size=(3, n))
    v[-1], a[-1] = 1.0, 0.0  # the clock

    def rows(q, v):
        system.dynamics(float(q[-1]), q, v, a)
        return system.contact_rows(sub, q, v, a, float(q[-1]))

    here = rows(q, v)
    acceleration, (X, Y) = here.acceleration.copy(), system.row_derivatives([here], v, a)
    ends = [rows(q + s * v + 0.5 * s * s * a, v + s * a).rate.copy() for s in (h, -h)]
    assert acceleration == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-6)
    for i, e in enumerate(np.eye(n)[:3]):
        ends = [rows(q + s * e, v).rate.copy() for s in (h, -h)]
        assert X[:, i] == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-5)
        # of second degree in v, so that a long step is exact
        ends = [rows(q, v + s * e).acceleration.copy() for s in (0.5, -0.5)]
        assert Y[:, i] == pytest.approx(ends[0] - ends[1], abs=1e-5)


def test_saved_resumed_and_by_hand(tmp_path):
    scene = on_floor(mu=0.3)
    q0, v0 = [0.0, 0.0, 0.12], [0.5, 0.0, 0.0]
    whole = nga.simulate(scene, q0, v0, t_end=0.12, dt=4e-3)
    half = nga.simulate(scene, q0, v0, t_end=0.08, dt=4e-3)
    half.save(tmp_path / "half.npz")
    loaded = nga.Trajectory.load(tmp_path / "half.npz")
    assert loaded.audit().ok, str(loaded.audit())
    assert np.array_equal(nga.simulate(scene, state=loaded.final_state, t_end=0.12).q[-1], whole.q[-1])
    simulator = nga.Simulator(scene, 4e-3, record=True)
    state = simulator.initial_state(q0, v0)
    for _ in range(30):
        state = simulator.step(state)
    assert np.array_equal(simulator.trajectory().q, whole.q)
    assert len(whole.contact_frames(5)[2]) == 2


def test_beside_contacts_limits_and_states():
    """A slider between its limits on a plane of shapes, pushed by a filter against an own wall."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slider")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(joint)
    model.lowerPositionLimit[0], model.upperPositionLimit[0] = -0.5, 2.0
    scene = nga.Scene(model)
    scene.add_geometry("ball", coal.Sphere(0.1), parent="slider")
    scene.add_plane("end", point=(1.5, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    scene.add_contact("ball", "end")
    scene.add_unilateral(nga.UnilateralConstraint(lambda t, q: 1.0 + 0.1 * t - q[0], name="own"))
    scene.add_state("thrust", lambda t, q, v, z: 5.0 * (4.0 - z), force=lambda t, q, v, z: z)
    run = nga.simulate(scene, [0.0], t_end=1.5, dt=2e-2)
    assert run.q[-1, 0] == pytest.approx(1.15, abs=1e-9) and run.v[-1, 0] == pytest.approx(0.1, abs=1e-9)
    own = run.contact_names.index("own")
    assert run.la_N[-1, own] == pytest.approx(run.states["thrust"][-1], rel=1e-6)
    assert run.audit().ok, str(run.audit())


def test_errors_say_what_to_do():
    scene = on_floor()
    with pytest.raises(nga.SceneError, match="needs both, mu and slip"):
        nga.UnilateralConstraint(lambda t, q: q[0], mu=0.3)
    with pytest.raises(nga.SceneError, match="gap gave 2 numbers; expected one"):
        scene.add_unilateral(nga.UnilateralConstraint(lambda t, q: q[:2]))
    with pytest.raises(nga.SceneError, match="'floor' already"):
        scene.add_unilateral(nga.UnilateralConstraint(lambda t, q: q[0], name="floor"))
    with pytest.raises(nga.SceneError, match="e_N = 2"):
        nga.UnilateralConstraint(lambda t, q: q[0], e_N=2.0)
    with pytest.raises(nga.SceneError, match="expected a UnilateralConstraint"):
        scene.add_unilateral(None)
    with pytest.raises(nga.Penetration, match="floor by 0.1"):
        nga.simulate(scene, [0.0, 0.0, 0.0], t_end=0.1, dt=1e-2)
