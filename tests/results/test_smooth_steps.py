"""Work in steps of chosen accuracy, longer than a trapezoid bears, against closed forms; a wrong run is seen."""

import dataclasses

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.results.energy_balance import balance
from ngalpha_pin.results.smooth_steps import smooth_steps


def soft_ball(belt=None):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="ball")
    moves = {} if belt is None else {"surface_velocity": (belt, 0.0, 0.0)}
    scene.add_contact("ball", "ground", mu=0.4, compliance=nga.KelvinVoigt(2e3, 5.0), **moves)
    return scene


def spring_and_damper(**how):
    """An oscillator whose damper has taken half of its energy at the end."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.gravity.linear = np.zeros(3)
    scene = nga.Scene(model)
    scene.add_force(nga.JointSpring("slide", 400.0, damping=2.0))
    return nga.simulate(scene, np.array([0.1]), t_end=0.35, **how)


@pytest.mark.parametrize(("rtol", "left"), [(1e-4, 1e-3), (1e-6, 3e-4), (1e-8, 3e-5)])
def test_a_soft_ball_on_a_belt(rtol, left):
    """Steps of up to 40 ms, half of the time that the contact takes."""
    q0, v0 = np.array([0, 0, 0.11, 0, 0, 0, 1.0]), np.array([0.6, 0.2, -0.3, 1.0, 2.0, 4.0])
    run = nga.simulate(soft_ball(0.5), q0, v0, t_end=0.15, rtol=rtol)
    account = balance(run)
    assert len(smooth_steps(run).step) == len(run.t) - 1
    assert account.error < left
    assert run.audit().ok, str(run.audit())
    # the belt gives what friction takes from it: its speed times the momentum along it
    momentum = _along_x(run)
    assert account.surfaces[-1] == pytest.approx(0.5 * (momentum[-1] - momentum[0]), rel=1e-3)


def _along_x(run):
    """Momentum of the ball along the belt, in the world."""
    return np.array([(pin.Quaternion(q[3:]).toRotationMatrix() @ v[:3])[0] for q, v in zip(run.q, run.v, strict=True)])


@pytest.mark.parametrize(("rtol", "left"), [(1e-3, 1e-2), (1e-6, 3e-4), (1e-9, 1e-5)])
def test_a_damper(rtol, left):
    run = spring_and_damper(rtol=rtol)
    account = balance(run)
    assert account.error < left
    assert account.joints[-1] == pytest.approx(account.change[-1], abs=left * account.scale)


def test_a_force_that_is_given():
    """Its work is what the motion has gained, in steps in which it swings by two radians."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_force(nga.Control(lambda t, q, v: np.array([10.0 * np.sin(20.0 * t)])))
    run = nga.simulate(scene, np.zeros(1), t_end=1.0, rtol=1e-6)
    account, speed = balance(run), 0.5 * (1.0 - np.cos(20.0))
    assert account.controls[-1] == pytest.approx(speed**2 / 2, rel=5e-3)
    power = 10.0 * np.sin(20.0 * run.t) * run.v[:, 0]
    assert np.abs(np.trapezoid(power, run.t) - speed**2 / 2) > 10 * np.abs(account.controls[-1] - speed**2 / 2)


def test_an_impact_ends_a_step():
    """A ball that slides through bounces: what is before the impact and what is behind it have rates of their own."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPlanar(), pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3)), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="ball")
    scene.add_contact("ball", "ground", mu=0.3, e_N=0.5)
    run = nga.simulate(scene, np.array([0, 0.3, 1, 0.0]), np.array([2.0, 0, 0]), t_end=1.0, rtol=1e-6)
    assert len(run.impacts.t) > 5
    assert balance(run).error < 1e-6


@pytest.mark.parametrize("part", [0.06, -0.06])
def test_no_wrong_energy_is_accepted_however_long_the_steps_are(part):
    """A soft ball whose energy jumps by six hundredths in the middle of its contact, with steps of a fourth of it."""
    run = nga.simulate(soft_ball(), np.array([0, 0, 0.3, 0, 0, 0, 1.0]), t_end=0.6, rtol=1e-3)
    assert run.audit().energy.closes
    v = run.v.copy()
    late = run.t > 0.3
    v[late] *= np.sqrt(np.maximum(1.0 + part * run.energy.kinetic.max() / np.maximum(run.energy.kinetic, 1e-6), 0.0))[
        late, None
    ]
    assert not dataclasses.replace(run, v=v).audit().energy.closes
