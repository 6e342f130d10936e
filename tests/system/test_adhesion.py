"""Contacts that hold a stated force: how long, how they let go, and that friction feels what presses."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.integrators.release import first_release
from ngalpha_pin.results.energy_balance import balance
from ngalpha_pin.system.system import System

G, F = 9.81, 20.0
ACCURACIES = [{"dt": 1e-2}, {"dt": 1e-3}, {"rtol": 1e-8, "atol": 1e-10}]


def pad(normal=(0.0, 0.0, -1.0), load=None, way=0.0, **law):
    """A ball of 1 kg without rotation at, or before, a plane: a ceiling by default, with a load downwards."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "pad")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(1.0, 0.05), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("wall", normal=normal)
    scene.add_geometry("pad", coal.Sphere(0.05), parent="pad")
    scene.add_contact("pad", "wall", **{"adhesion": F, **law})
    if load:
        scene.add_force(nga.Control(lambda t, q, v: np.array([0.0, 0.0, -load(t)])))
    return scene, (0.05 + way) * np.array(normal)


def test_release_under_a_load_that_grows():
    """It lets go where weight and load are the force that it holds, and falls from there on: of second order in dt."""
    moment, errors = (F - G) / 40, []
    for accuracy in ({"dt": 1e-2}, {"dt": 1e-3}, {"rtol": 1e-4}, {"rtol": 1e-6}, {"rtol": 1e-8, "atol": 1e-10}):
        scene, q0 = pad(load=lambda t: 40 * t)
        run = nga.simulate(scene, q0, t_end=0.5, **accuracy)
        s = np.maximum(run.t - moment, 0.0)
        errors.append(np.abs(run.q[:, 2] + 0.05 + F * s**2 / 2 + 40 * s**3 / 6).max())
        assert run.audit().ok
        assert ((run.adhesion == 0.0) == (run.t >= moment - 1e-12)[:, None]).all()
        net = run.la_N - run.adhesion
        assert net.min() >= -F
        assert np.abs(net[run.t < moment, 0] + G + 40 * run.t[run.t < moment]).max() < 1e-9
        assert [event.kind for event in run.events] == ["lift-off"]
        if "rtol" in accuracy:
            assert run.events[0].t == pytest.approx(moment, abs=1e-12)
            assert errors.pop() < accuracy["rtol"]
    assert np.log10(errors[0] / errors[1]) > 1.95


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("side", [-2e-9, 2e-9])
def test_holds_the_force_stated(accuracy, side):
    scene, q0 = pad(load=lambda t: F - G + side * F)
    run = nga.simulate(scene, q0, t_end=0.05, **accuracy)
    assert (run.q[-1, 2] < q0[2] - 1e-3) == (side > 0.0)
    if side < 0.0:
        assert np.abs(run.q - q0).max() < 1e-15


def test_load_that_jumps_tears_it_off_at_once():
    for accuracy in ACCURACIES:
        scene, q0 = pad()
        jump = lambda t, q, v: np.array([0.0, 0.0, -30.0 * (t >= 0.0955)])  # noqa: E731
        scene.add_force(nga.Control(jump, breakpoints=(0.0955,)))
        run = nga.simulate(scene, q0, t_end=0.2, **accuracy)
        s = np.maximum(run.t - 0.0955, 0.0)
        assert np.abs(run.q[:, 2] + 0.05 + (G + 30) * s**2 / 2).max() < 1e-9
        assert run.audit().ok


@pytest.mark.parametrize("e_N", [0.0, 0.5])
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_begins_to_hold_where_it_stays_closed(e_N, accuracy):
    """A pad thrown at a ceiling sticks without restitution, and bounces off with it: an impact holds nothing."""
    scene, q0 = pad(way=0.1, e_N=e_N)
    run = nga.simulate(scene, q0, np.array([0.0, 0.0, 2.0]), t_end=0.2, **accuracy)
    assert run.audit().ok
    if e_N == 0.0:
        assert run.q[-1, 2] == pytest.approx(-0.05, abs=1e-12) and run.adhesion[-1] == [F]
    else:
        assert not run.adhesion.any() and run.v[-1, 2] < 0.0


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("side", [-0.01, 0.01])
def test_pad_on_a_wall_slides_where_friction_of_what_presses_is_too_small(accuracy, side):
    mu = G / F * (1 + side)
    scene, q0 = pad(normal=(1.0, 0.0, 0.0), mu=mu)
    run = nga.simulate(scene, q0, t_end=0.2, **accuracy)
    fall = max(0.0, G - mu * F) * run.t**2 / 2
    assert np.abs(run.q[:, 2] + fall).max() < 1e-9
    assert np.abs(run.q[:, 0] - 0.05).max() < 1e-12
    assert run.audit().ok
    assert np.abs(balance(run).left_over).max() < 1e-12


def plate(load):
    """A plate of 1 kg below a ceiling at two pads, with a load that grows beside the middle."""
    model, up = pin.Model(), pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))
    model.addJoint(0, pin.JointModelPlanar(), up, "plate")
    model.appendBodyToJoint(1, pin.Inertia.FromBox(1.0, 0.4, 0.02, 0.2), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = nga.Scene(model)
    scene.add_plane("ceiling", normal=(0.0, 0.0, -1.0))
    for name, x in (("left", -0.2), ("right", 0.2)):
        scene.add_geometry(name, coal.Sphere(0.02), parent="plate", placement=pin.SE3(np.eye(3), np.array([x, 0, 0])))
    scene.add_contact("*t", "ceiling", adhesion=F)
    # the force acts at the plate's own point x = 0.15
    scene.add_force(nga.Control(lambda t, q, v: load * t * np.array([-q[3], -q[2], -0.15 * 1.0]), derivatives=False))
    q0 = pin.neutral(model)
    q0[1] = -0.02
    return scene, q0


def test_pad_after_pad_lets_go():
    """The one beside the load first; the other one takes over what it can: fixed steps against a run with rtol."""
    scene, q0 = plate(60.0)
    exact = nga.simulate(scene, q0, t_end=0.42, rtol=1e-10, atol=1e-12, t_eval=np.linspace(0, 0.42, 43))
    assert len(np.unique(exact.adhesion > 0.0, axis=0)) == 3
    errors = []
    for dt in (5e-3, 1e-3):
        run = nga.simulate(scene, q0, t_end=0.42, dt=dt)
        assert run.audit().ok
        errors.append(np.abs(run.q[:: round(1e-2 / dt)] - exact.q).max())
    assert np.log(errors[0] / errors[1]) / np.log(5) > 1.9


def test_symmetric_pads_let_go_together():
    scene, q0 = plate(0.0)
    scene.forces.clear()
    scene.add_force(nga.Control(lambda t, q, v: np.array([0.0, -300.0 * t, 0.0])))
    run = nga.simulate(scene, q0, t_end=0.15, dt=2e-3)
    moment = (2 * F - G) / 300
    s = np.maximum(run.t - moment, 0.0)
    assert np.abs(run.q[:, 1] + 0.02 + 2 * F * s**2 / 2 + 300 * s**3 / 6).max() < 1e-5
    assert np.abs(run.v[:, 2]).max() < 1e-12 and run.audit().ok


def test_saved_resumed_and_at_rest(tmp_path):
    scene, q0 = pad(load=lambda t: 40 * t)
    whole, half = (nga.simulate(scene, q0, t_end=t, dt=1e-2) for t in (0.4, 0.2))
    half.save(tmp_path / "half.npz")
    state = nga.Trajectory.load(tmp_path / "half.npz").final_state
    assert (nga.simulate(scene, state=state, t_end=0.4, dt=1e-2).q[-1] == whole.q[-1]).all()
    simulator = nga.Simulator(scene, 1e-2)
    state = simulator.initial_state(q0)
    for _ in range(40):
        state = simulator.step(state)
    assert (state.q == whole.q[-1]).all()
    resting, q0 = pad()
    found = nga.static_equilibrium(resting, q0)
    assert found.q == pytest.approx(q0) and found.la_N == pytest.approx([F - G])
    moreau = nga.simulate(scene, q0, t_end=0.5, dt=1e-3, method=nga.MoreauJean())
    assert moreau.q[-1] == pytest.approx(nga.simulate(scene, q0, t_end=0.5, dt=1e-3).q[-1], abs=2e-2)
    with pytest.raises(nga.SceneError, match="adhesion"):
        pad(adhesion=-1.0)


def test_root_of_the_forces():
    forces = [np.array([9.0, 9.0, 9.0]), np.array([0.6, 3.4, 2.0]), np.array([0.5, 3.5, 2.0])]
    assert first_release([0.0, 0.4, 0.5], forces) == pytest.approx(1.0, abs=1e-12)
    assert first_release([0.4, 0.5], [x[1:] for x in forces[1:]]) == np.inf


def test_not_beside_beams():
    scene = robots.load("hopper")[0]
    pair = scene.contacts[0]
    scene.contacts[0] = replace(pair, law=replace(pair.law, adhesion=1.0))
    with pytest.raises(nga.SceneError, match="adhesion.*beams"):
        System(scene)
