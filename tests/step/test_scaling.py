"""Tolerances and rows are the same in any units: a run in millimetres and milligrams has the same iterations."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.step import scaling
from ngalpha_pin.system.system import System


def ball(length, mass):
    """A ball with spin above a plane, in units of length and mass."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0 * mass, 0.1 * length), pin.SE3.Identity())
    model.gravity.linear = np.array([0.0, 0.0, -9.81 * length])
    scene = nga.Scene(model)
    scene.add_geometry("ball", coal.Sphere(0.1 * length), parent="ball")
    scene.add_plane("ground")
    scene.add_contact("ball", "ground", mu=0.3)
    q0 = pin.neutral(model)
    q0[2] = 0.15 * length
    return scene, q0, np.array([0.0, 0.0, 0.0, 3.0, 20.0, 1.0])


@pytest.mark.parametrize("length, mass", [(1e3, 1.0), (1e-3, 1e6), (1.0, 1e-6)])
def test_same_run_in_any_units(length, mass):
    here, there = (nga.simulate(*ball(*units), t_end=0.2, dt=2e-3) for units in ((1.0, 1.0), (length, mass)))
    assert list(there.solver_path) == list(here.solver_path)
    # where an end of slip is looked for, rounding decides about the last one of twenty iterations
    assert np.abs(there.n_iter - here.n_iter)[here.solver_path != "slip"].max() == 0
    assert np.abs(there.n_iter - here.n_iter).max() <= 2
    np.testing.assert_allclose(there.q[:, :3] / length, here.q[:, :3], atol=1e-10)
    np.testing.assert_allclose(there.P_N / (length * mass), here.P_N, atol=1e-9 * here.P_N.max())


def test_force_unit_is_at_least_the_weight():
    scene, q0, v0 = ball(1.0, 4.0)
    system = System(scene)
    assert system.weight == pytest.approx(2.0 * 9.81)
    assert scaling.SMALLEST > 0.0 and GeneralizedAlpha().tol < 1e-8
