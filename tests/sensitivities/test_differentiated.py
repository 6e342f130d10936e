"""What a run with derivatives says beside them."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from central_differences import EXACT, agreed, by_start, end, random_directions
from contact_scenes import balls

import ngalpha_pin as nga
from ngalpha_pin.errors import NgalphaError, SceneError
from ngalpha_pin.sensitivities.statuses import Status

ABOVE = np.array([0.0, 0.0, 0.3])


def bar(e_N):
    """A bar whose two ends, small balls, are above the ground."""
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelPlanar(), pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3)), "bar")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), 0.02 * np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(j)
    scene = nga.Scene(model)
    scene.add_plane("ground")
    for name, x in (("left", -0.2), ("right", 0.2)):
        scene.add_geometry(name, coal.Sphere(0.02), parent="bar", placement=pin.SE3(np.eye(3), np.array([x, 0, 0])))
    scene.add_contact("left", "ground", e_N=e_N)
    scene.add_contact("right", "ground", e_N=e_N)
    return scene, np.array([0.0, 0.1, 1.0, 0.0])


def test_runs_with_and_without_derivatives_have_the_same_bits():
    scene, q0, v0 = nga.robots.load("rotating_ball", omega=50.0, e_N=0.5)
    how = {"t_end": 0.6, "dt": 1e-2}
    plain = nga.simulate(scene, q0, v0, **how)
    run = nga.simulate(scene, q0, v0, sensitivities=nga.Sensitivities(q0=True, parameters=["mu"]), **how)
    for name in ("t", "q", "v", "a", "P_N", "la_N", "La_F", "n_iter"):
        np.testing.assert_array_equal(getattr(run, name), getattr(plain, name))
    assert plain.derivatives is None
    assert run.derivatives.names == ("q0[0]", "q0[1]", "q0[2]", "mu")
    assert run.derivatives.q.shape == (61, 3, 4)


def test_a_flat_landing_with_a_rebound_has_no_derivative_by_the_angle():
    scene, q0 = bar(e_N=0.5)
    with pytest.warns(UserWarning, match=r"no derivative at t = 0.13 s.*left/ground, right/ground"):
        run = nga.simulate(scene, q0, t_end=0.2, dt=1e-2, sensitivities=nga.Sensitivities(q0=True))
    found = run.derivatives
    assert Status.AMBIGUOUS.value in found.status
    assert np.isnan(end(run)[:, 2]).all()
    # its height moves both ends alike
    fall = np.sqrt(2 * 0.08 / 9.81)
    assert np.isfinite(end(run)[:, :2]).all()
    assert end(run)[4, 1] == pytest.approx(1.5 / fall, abs=1e-9)


def test_a_flat_landing_at_rest_is_said_and_can_be_refused():
    scene, q0 = bar(e_N=0.0)
    how = {"t_end": 0.2, "dt": 1e-2}
    with pytest.warns(UserWarning, match="several contacts close at once"):
        run = nga.simulate(scene, q0, sensitivities=nga.Sensitivities(q0=True), **how)
    assert np.isfinite(run.derivatives.q).all()
    with pytest.warns(UserWarning):
        run = nga.simulate(scene, q0, sensitivities=nga.Sensitivities(q0=True, on_undefined="nan"), **how)
    assert np.isnan(run.derivatives.q[-1]).all()
    with pytest.raises(NgalphaError, match="no derivative at t = 0.13 s"):
        nga.simulate(scene, q0, sensitivities=nga.Sensitivities(q0=True, on_undefined="raise"), **how)


@pytest.mark.parametrize("name", ("four_bar", "slider_crank"))
def test_closed_loops_along_the_motions_that_they_leave(name):
    scene, q0, v0 = nga.robots.load(name)
    how = {"t_end": 0.05, "dt": 1e-3, "method": EXACT}
    dq, dv = random_directions(scene, q0, v0, 2)
    asked = nga.Sensitivities(q0=dq, v0=dv)
    run = nga.simulate(scene, q0, v0, sensitivities=asked, **how)
    # a change of q0 alone takes v0 along, so that the loop stays closed
    expected, allowed = agreed(lambda h: by_start(scene, q0, v0, dq, dv, h, **how), 1e-6)
    np.testing.assert_allclose(end(run)[:, :2] + end(run)[:, 2:], expected, rtol=0, atol=allowed)


@pytest.mark.parametrize(
    ("scene", "said"),
    (
        (balls(1, mu=0.3, adhesion=1.0), "adhesion"),
        (balls(40), "crowd"),
    ),
)
def test_scenes_without_derivatives_say_why(scene, said):
    q0 = np.concatenate([ABOVE + [i, 0.0, 0.0] for i in range(scene.model.nq // 3)])
    with pytest.raises(SceneError, match=said):
        nga.simulate(scene, q0, t_end=1e9, dt=1e-3, sensitivities=nga.Sensitivities(q0=True))


def test_a_control_of_unknown_derivatives_is_refused():
    scene = balls(1)
    scene.add_force(nga.Control(lambda t, q, v: -q))
    with pytest.raises(SceneError, match="derivatives=True"):
        nga.simulate(scene, ABOVE, t_end=1e9, dt=1e-3, sensitivities=nga.Sensitivities(q0=True))


@pytest.mark.parametrize("given", ({"method": nga.MoreauJean()}, {"rtol": 1e-6}))
def test_other_methods_have_none(given):
    how = {"dt": 1e-3} if "rtol" not in given else {}
    with pytest.raises(SceneError, match="derivatives|sensitivities"):
        nga.simulate(balls(1), ABOVE, t_end=1.0, sensitivities=nga.Sensitivities(q0=True), **how, **given)


def test_what_is_asked_for_is_checked():
    with pytest.raises(SceneError, match="on_undefined"):
        nga.Sensitivities(on_undefined="guess")
    with pytest.raises(SceneError, match="sensitivities: q0"):
        nga.simulate(balls(1), ABOVE, t_end=1.0, dt=0.1, sensitivities=nga.Sensitivities(q0=np.eye(2)))
    with pytest.raises(SceneError, match="Sensitivities"):
        nga.simulate(balls(1), ABOVE, t_end=1.0, dt=0.1, sensitivities=["mu"])
