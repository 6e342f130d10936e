"""Position gains about a motion that is given over time: with the torque of that motion they follow it exactly."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, PchipInterpolator, make_interp_spline

import ngalpha_pin as nga

KNOTS = np.array([0.0, 0.1, 0.25, 0.45, 0.6])
PATH = np.array([[0.0, 0.0], [0.1, -0.2], [0.1, 0.3], [-0.2, 0.3], [0.0, 0.0]])
MASSES, KP, KD = np.array([1.0, 2.0]), np.array([50.0, 90.0]), 4.0


def slides(effort=np.inf):
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    for name, mass in zip("ab", MASSES, strict=True):
        joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    if np.isfinite(effort):
        model.upperEffortLimit[:], model.lowerEffortLimit[:] = effort, -effort
    return nga.Scene(model)


def path():
    return PchipInterpolator(KNOTS, PATH)


def with_force(force, effort=np.inf):
    scene = slides(effort)
    scene.add_force(force)
    return scene


@pytest.mark.parametrize("as_functions", [False, True], ids=["spline", "functions"])
def test_follows_what_is_given(as_functions):
    """The spline and a torque that jumps at its knots: the error is that of the method, or of the tolerance."""
    q = path()
    v, a = q.derivative(), q.derivative(2)
    if as_functions:
        given = {"q_ref": lambda t: q(t), "v_ref": lambda t: v(t), "breakpoints": KNOTS[1:-1]}
    else:
        given = {"q_ref": q}
    law = nga.JointPD(**given, kp=KP, kd=KD, tau_ff=lambda t: MASSES * a(t))
    assert np.array_equal(law.breakpoints, KNOTS[1:-1])
    errors = []
    for accuracy in ({"dt": 4e-3}, {"dt": 1e-3}, {"rtol": 1e-9}):
        run = nga.simulate(with_force(law), q(0.0), v(0.0), t_end=0.6, **accuracy)
        errors.append([np.abs(run.q - q(run.t)).max(), np.abs(run.v - v(run.t)).max()])
        assert run.audit().ok is True, str(run.audit())
    assert (np.log(np.divide(errors[0], errors[1])) / np.log(4.0) > 1.9).all()
    assert max(errors[1]) < 1e-3 and max(errors[2]) < 1e-8


def test_limits_of_effort_bound_all_of_it():
    """A reference far away: the motors pull with their limit, 0.4 N."""
    law = nga.JointPD(np.ones(2), 1e3, 1.0, v_ref=np.ones(2), tau_ff=lambda t: np.full(2, t))
    run = nga.simulate(with_force(law, 0.4), np.zeros(2), t_end=0.2, dt=1e-2)
    assert run.v[-1] == pytest.approx(0.4 / MASSES * 0.2, rel=1e-9)


def test_velocity_of_a_spline_is_its_derivative():
    """Against an integration with the derivative written out, and with the reference standing still."""
    q = make_interp_spline(KNOTS, PATH, k=3)

    def rate(t, y, moving):
        x, v = np.split(y, 2)
        return np.concatenate((v, (KP * (q(t) - x) + KD * (moving * q.derivative()(t) - v)) / MASSES))

    for moving, given in ((1.0, {}), (0.0, {"v_ref": np.zeros(2)})):
        law = nga.JointPD(q, KP, KD, **given)
        run = nga.simulate(with_force(law), PATH[0], t_end=0.5, rtol=1e-9)
        right = solve_ivp(rate, (0.0, 0.5), np.zeros(4), rtol=1e-11, atol=1e-13, args=(moving,)).y[:, -1]
        assert np.concatenate((run.q[-1], run.v[-1])) == pytest.approx(right, abs=1e-8)


def test_spline_beside_a_body_that_moves_freely():
    """Its coordinates are held by no one: they may stand still in the spline, and the others have their rates."""
    alone, beside = with_force(nga.JointPD(make_interp_spline(KNOTS, PATH, k=3), KP, KD)), slides()
    beside.add_body("ball", coal.Sphere(0.1), mass=1.0)
    q0 = np.concatenate((PATH[0], beside.reference()[2:]))
    rows = np.hstack((PATH, np.tile(q0[2:], (len(PATH), 1))))
    beside.add_force(nga.JointPD(make_interp_spline(KNOTS, rows, k=3), np.append(KP, np.ones(6)), KD))
    expected = nga.simulate(alone, PATH[0], t_end=0.5, dt=1e-2)
    run = nga.simulate(beside, q0, t_end=0.5, dt=1e-2)
    np.testing.assert_allclose(run.q[:, :2], expected.q, atol=1e-12)
    assert run.v[-1, 2:] == pytest.approx(np.zeros(6), abs=1e-12)


def test_energy_is_stored_where_nothing_is_fed_in():
    rest = np.zeros(2)
    assert nga.JointPD(rest, KP, KD).energy is not None
    for given in ({"v_ref": rest}, {"tau_ff": rest}):
        assert nga.JointPD(rest, KP, KD, **given).energy is None
    assert nga.JointPD(path(), KP, KD).energy is None


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (
            lambda: nga.JointPD(lambda t: np.zeros(2), KP, KD),
            "v_ref is missing.* Give v_ref=function of t .* shape \\(nv,\\)",
        ),
        (lambda: nga.JointPD(CubicSpline(KNOTS, PATH[:, :1]), KP, KD), "JointPD: q_ref: got .* shape \\(2,\\)"),
        (lambda: nga.JointPD(np.zeros(2), KP, KD, v_ref=np.zeros(3)), "v_ref has shape \\(3,\\)"),
        (lambda: nga.JointPD(np.zeros(2), KP, KD, tau_ff=lambda t: "push"), "tau_ff: got 'push'"),
        (lambda: nga.JointPD(np.zeros(2), KP, KD, tau_ff=lambda t: 1 / t), "tau_ff: the function failed at t = 0"),
    ],
)
def test_what_cannot_be_used_is_said(law, words):
    with pytest.raises(nga.SceneError, match=words):
        with_force(law())


def test_spline_of_coordinates_that_are_no_rates():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "turn")
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, 0.1, 0.2, 0.3), pin.SE3.Identity())
    circle = CubicSpline([0.0, 0.5, 1.0], [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    with pytest.raises(nga.SceneError, match="v_ref is missing: joint 'turn'"):
        nga.Scene(model).add_force(nga.JointPD(circle, 1.0, 1.0))
