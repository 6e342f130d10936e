"""Work of dampers: closed forms where steps resolve them, and nearly what there was where they hardly do."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.results.energy_balance import balance


def slider(damping, gravity=0.0):
    """1 kg on a slide along z with a damper [N s/m]."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.damping[:] = damping
    scene = nga.Scene(model)
    scene.joints = nga.JointLaws(damping=True)
    return scene


def dampers(run):
    return balance(run).joints[-1]


def test_work_of_a_damper_that_steps_resolve_is_of_the_second_order():
    """v = exp(-5 t): the damper takes 1/2 (1 - exp(-10 t)) J."""
    right = -0.5 * (1.0 - np.exp(-2.0))
    coarse, fine = (
        dampers(nga.simulate(slider(5.0), np.zeros(1), np.ones(1), t_end=0.2, dt=dt)) - right for dt in (1e-2, 5e-3)
    )
    assert abs(coarse) < 1e-3 and coarse / fine == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize(("rho_inf", "within"), [(0.9, 0.01), (0.5, 0.09)])
def test_a_damper_that_stops_in_a_step_takes_little_more_than_there_was(rho_inf, within):
    """0.5 J, with c dt / m = 1: the powers at the ends of the steps say 25 to 28 % more."""
    method = nga.GeneralizedAlpha(rho_inf=rho_inf)
    run = nga.simulate(slider(100.0), np.zeros(1), np.ones(1), t_end=0.1, dt=1e-2, method=method)
    v = run.v[:, 0]
    assert -100.0 * 1e-2 * (v[1:] ** 2 + v[:-1] ** 2).sum() / 2.0 < -0.62
    assert dampers(run) == pytest.approx(-0.5, rel=within)


def test_a_damper_works_on_both_sides_of_an_impact():
    """Falling through a damper on the ground and back: the account closes to the order of the method."""
    scene = slider(2.0, gravity=9.81)
    scene.add_geometry("ball", coal.Sphere(0.1), "slide")
    scene.add_plane("ground")
    scene.add_contact("ball", "ground", e_N=0.8)
    left = [
        np.abs(balance(nga.simulate(scene, np.array([0.6]), t_end=0.6, dt=dt)).left_over).max() for dt in (1e-2, 5e-3)
    ]
    assert left[0] < 5e-3 and left[1] < 0.4 * left[0]
