"""Static above kinetic friction and Stribeck's curve: slip with a closed form, stick-slip, impacts, derivatives."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import ngalpha_pin as nga
from ngalpha_pin.contact.laws import ContactResidual
from ngalpha_pin.scene.friction_curve import curve_from_plain, curve_to_plain
from ngalpha_pin.system.system import System

G = 9.81
EXPONENTIAL = nga.Stribeck(0.4, 0.2, 0.3, 1.0)
OWN = nga.FrictionCurve(lambda v: (0.2 + 0.2 / (1 + v), -0.2 / (1 + v) ** 2))


def block(mu, spring=0.0, joint=pin.JointModelTranslation, e_N=0.0, **surface):
    """A ball of 1 kg that does not turn, on a plane, on a spring along x."""
    model = pin.Model()
    model.addJoint(0, joint(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("block", coal.Sphere(0.1), parent="block")
    scene.add_contact("block", "ground", mu=mu, e_N=e_N, **surface)
    if spring:
        scene.add_force(nga.Control(lambda t, q, v: np.array([-spring * q[0], 0.0, 0.0]), derivatives=True))
    return scene, np.array([0.0, 0.0, 0.1])


@pytest.mark.parametrize("mu", [EXPONENTIAL, OWN, nga.Stribeck(0.4, 0.2, 0.3)])
def test_slip_that_slows_down(mu):
    """To rest, on a plane, along a straight line: of second order while it slips, within the tolerance with rtol."""
    scene, q0 = block(mu)

    def slows(t, y):
        return [y[1], -G * mu(np.array([max(y[1], 0.0)]))[0][0]]

    stops = lambda t, y: y[1]  # noqa: E731
    stops.terminal = True
    slip = solve_ivp(slows, (0, 2), [0.0, 0.5], rtol=1e-12, atol=1e-14, events=stops, dense_output=True)
    exact, half = slip.y[0, -1], slip.sol(0.1)[0]
    v0, errors, slides = np.array([0.4, 0.3, 0.0]), [], []
    for accuracy in ({"dt": 1e-2}, {"dt": 1e-3}, {"rtol": 1e-4}, {"rtol": 1e-6}, {"rtol": 1e-8}):
        run = nga.simulate(scene, q0, v0, t_end=0.24, **accuracy)
        errors.append(abs(np.linalg.norm(run.q[-1, :2]) - exact))
        assert run.audit().ok
        assert np.abs(run.v[-1]).max() < 1e-12
        if "rtol" in accuracy:
            assert errors.pop() < 10 * accuracy["rtol"]
        else:
            slides.append(abs(np.linalg.norm(run.q[round(0.1 / accuracy["dt"]), :2]) - half))
    assert np.log10(slides[0] / slides[1]) > 1.9
    # over the end of the slip the error depends on where in its step it ends
    assert errors[0] < 1e-2**2 and errors[1] < 1e-3**2


@pytest.mark.parametrize("side", [-0.01, 0.01])
@pytest.mark.parametrize("accuracy", [{"dt": 1e-2}, {"rtol": 1e-8}])
def test_sticks_up_to_the_static_coefficient(side, accuracy):
    scene, q0 = block(EXPONENTIAL)
    scene.add_force(nga.Control(lambda t, q, v: np.array([0.4 * G * (1 + side), 0.0, 0.0])))
    run = nga.simulate(scene, q0, t_end=0.3, **accuracy)
    assert (np.abs(run.q - q0).max() < 1e-14) == (side < 0.0)
    assert run.audit().ok


def stick_slip(mu, spring, belt, t_end):
    """Onsets of slip of a block on a belt, from events of solve_ivp [s]."""
    onsets, t, x = [], 0.0, 0.0

    def sticks(t, y):
        return mu.static * G - spring * y[0]

    def slides(t, y):
        return y[1] - belt

    sticks.terminal = slides.terminal = True
    slides.direction = 1.0
    while t < t_end:
        stuck = solve_ivp(lambda t, y: [belt], (t, t_end), [x], events=sticks, rtol=1e-12, atol=1e-14)
        t, x = stuck.t[-1], stuck.y[0, -1]
        onsets.append(t)
        slip = lambda t, y: [y[1], -spring * y[0] + G * mu(np.array([max(belt - y[1], 0.0)]))[0][0]]  # noqa: E731
        # off the belt by what the first moment of slip makes
        moved = solve_ivp(slip, (t, t_end), [x + 1e-9, belt - 1e-9], events=slides, rtol=1e-12, atol=1e-14)
        t, x = moved.t[-1], moved.y[0, -1]
    return np.array(onsets[:-1])


def test_stick_slip_period_of_a_mass_on_a_belt():
    """Against an event-driven run of its own, to 1e-4."""
    mu, spring, belt = nga.Stribeck(0.4, 0.25, 0.1), 100.0, 0.1
    scene, q0 = block(mu, spring, surface_velocity=(belt, 0.0, 0.0))
    v0 = np.array([belt, 0.0, 0.0])
    onsets = stick_slip(mu, spring, belt, 3.0)
    period = onsets[2] - onsets[1]
    assert onsets[1] - onsets[0] == pytest.approx(period, rel=1e-9)
    found = []
    for accuracy in ({"dt": 4e-3}, {"rtol": 1e-8, "atol": 1e-10}):
        run = nga.simulate(scene, q0, v0, t_end=1.3, **accuracy)
        assert run.audit().ok
        # a deflection just before it slips is crossed, with the speed of the belt, once a period
        x, level = run.q[:, 0], 0.39 * G / spring
        up = np.flatnonzero((x[:-1] < level) & (x[1:] >= level))
        crossings = run.t[up] + (level - x[up]) / belt
        found.append(crossings[1] - crossings[0])
    assert found[0] == pytest.approx(period, rel=1e-4)
    assert found[1] == pytest.approx(period, rel=1e-7)


@pytest.mark.parametrize("speed", [0.5, 0.05])
def test_impact_has_the_coefficient_of_the_slip_that_is_left(speed):
    scene, q0 = block(EXPONENTIAL, e_N=0.5)
    q0[2] += 0.05
    v0 = np.array([speed, 0.0, 0.0])
    down = np.sqrt(2 * G * 0.05)
    run = nga.simulate(scene, q0, v0, t_end=0.15, dt=1e-2)
    # at its own moment: where the coefficient is not found, the end of the step captures the impact
    assert run.impacts.t[0] == pytest.approx(down / G, abs=1e-9)
    v = run.impacts.v_after[0]
    mu = EXPONENTIAL(np.array([abs(v[0])]))[0][0]
    assert v[0] == pytest.approx(max(0.0, speed - mu * 1.5 * down), abs=1e-9)
    assert run.audit().ok


def test_derivative_of_slipping_rows():
    """Dense and by entries, against differences, of random kinematics and forces."""
    scene = block(EXPONENTIAL)[0]
    system, rng = System(scene), np.random.default_rng(0)
    sub = system.contacts.subset(np.arange(1))
    k, m, n = 1, 2, 7
    gamma_c, beta_c = 0.004, 1e-5
    for _ in range(10):
        y, x, r = rng.normal(size=n), np.abs(rng.normal(size=n)), np.full(n, 1e3)
        y[[0, 1, 4]] = -1.0  # closed
        A = rng.normal(size=(n, n))

        def residual(x, y, r=r):
            z = x.copy()
            z[:k] += beta_c * x[k + k + m : k + k + m + k]
            z[k : 2 * k + m] += gamma_c * x[2 * k + m :]
            return ContactResidual(sub, y, z, x[k : 2 * k + m], y[2 * k : 2 * k + m], r, False)

        here = residual(x, y)
        assert here.slips and here.slope.any()
        Dz = np.eye(n, n + 1)
        Dz[0, 4] = beta_c
        Dz[np.arange(1, 4), np.arange(4, 7)] = gamma_c
        J = here.jacobian(np.column_stack((A, np.zeros(n))), Dz)[:, :n]
        h = 1e-6
        found = [
            (residual(x + h * e, y + h * A @ e).R - residual(x - h * e, y - h * A @ e).R) / (2 * h) for e in np.eye(n)
        ]
        slipping = [2, 3, 5, 6]
        assert np.abs(J - np.array(found).T)[slipping].max() < 1e-6
        dense = np.zeros((2, n, n))
        for place, (values, at) in zip(dense, here.derivatives(gamma_c, np.full(here.sub.k, beta_c)), strict=True):
            np.add.at(place, at, values)
        assert np.abs(dense[0] @ A + dense[1] - J).max() < 1e-12


def test_declaration_and_files(tmp_path):
    for make, words in (
        (lambda: nga.Stribeck(-0.1, 0.2, 0.3), "mu_s"),
        (lambda: nga.Stribeck(0.3, 0.2, 0.0), "v_s"),
        (lambda: nga.FrictionCurve(lambda v: (0.2 + v, 0.0)), "slope"),
        (lambda: nga.FrictionCurve(lambda v: 0.3), "mu, slope"),
        (lambda: nga.FrictionCurve(lambda v: 1 / 0), "failed"),
        (lambda: block(OWN)[0].set_surface("*", mu=OWN), "mu"),
    ):
        with pytest.raises(nga.SceneError, match=words):
            make()
    assert curve_from_plain(curve_to_plain(OWN, True)) == OWN and curve_from_plain(curve_to_plain(None, True)) is None
    for mu in (EXPONENTIAL, OWN):
        scene, q0 = block(mu)
        run = nga.simulate(scene, q0, np.array([1.0, 0.0, 0.0]), t_end=0.05, dt=1e-2)
        run.save(tmp_path / "run.npz")
        loaded = nga.Trajectory.load(tmp_path / "run.npz")
        assert loaded.audit().ok
        speed = np.array([0.0, 0.1, 2.0])
        kept = loaded.scene.contacts[0].law.curve(speed)
        assert np.abs(np.array(kept) - mu(speed)).max() < 1e-9
